"""The one error type that crosses the wall towards the user."""


class UserError(Exception):
    """Something the user can act on, told in one line: what is wrong, where, and what to do.

    The command line prints the message and ends with a non-zero status; operators report it.
    Everything else that escapes is a bug and keeps its traceback.
    """

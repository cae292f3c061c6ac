"""Keeping Blender's own chatter out of the command line's few lines."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def quiet(descriptor: int) -> Iterator[int]:
    """Discard output of C code to file descriptor 1 or 2; yields a descriptor that still writes there.

    It acts on the whole process: for background use only.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    kept = os.dup(descriptor)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, descriptor)
        yield kept
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os.dup2(kept, descriptor)
        os.close(kept)
        os.close(nowhere)

"""Common code of the operators: polls, with the reason shown on a disabled button, and reports of errors."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import bpy

from ...core.base.errors import UserError
from ...scene import parts
from ...scene.base import version
from ...scene.base.remedy_words import WORDS
from ...scene.lens.lens import is_in_focus
from .solving import running_solve

Result = set[str]
Item = tuple[str, str, str]
"""Identifier, name and tooltip of an enumeration's item."""
Condition = Callable[[Any, bpy.types.Context], bool]
"""Takes an operator's class and the context."""
NO_CAMERA = "The camera was deleted; Restore Objects, under Details, brings it back"


def classes_of(*modules: ModuleType) -> tuple[Any, ...]:
    """Return the classes that modules define for Blender, in the order of their definitions."""
    return tuple(
        each for module in modules for each in vars(module).values()
        if isinstance(each, type) and issubclass(each, bpy.types.bpy_struct)
        and each.__module__ == module.__name__
    )  # fmt: skip


def label_of(cls: type) -> str:
    """Return the label of a class of ours by its name: Find Clip for VIRTUAL_APERTURE_OT_find_clip."""
    return cls.__name__[len("VIRTUAL_APERTURE_OT_") :].replace("_", " ").title()


def each_of(*conditions: Condition) -> Condition:
    """Return a condition that is met where all of some are, which are asked in order."""
    return lambda cls, context: all(condition(cls, context) for condition in conditions)


def polls(*conditions: Condition) -> Any:
    """Return an operator's `poll` of conditions, which are asked in order."""
    return classmethod(each_of(*conditions))


def may_change(cls: Any, context: bpy.types.Context) -> bool:
    """Poll whether changes of the scene will be saved."""
    try:
        check_may_change(context.scene)
    except UserError as error:
        cls.poll_message_set(sentence(str(error)))
        return False
    return True


def check_may_change(scene: bpy.types.Scene) -> None:
    """Check that changes of the scene will be saved.

    Raises:
        UserError: The scene is linked, or a newer version made it.
    """
    if scene.library is not None:
        file = Path(scene.library.filepath).name
        raise UserError(f"{scene.name} is linked from {file}; open that file, or append the scene from it")
    version.check(scene.virtual_aperture)


def sentence(text: str) -> str:
    """Return a message as a button's or a panel's text begins."""
    return text[0].upper() + text[1:]


def is_met(cls: Any, condition: object, message: str) -> bool:
    """Poll a condition; `message` is the button's reason otherwise."""
    if not condition:
        cls.poll_message_set(message)
    return bool(condition)


def requires(is_true: Callable[[bpy.types.Context], object], message: str) -> Condition:
    """Return a condition of a poll; `message` is the button's reason otherwise."""
    return lambda cls, context: is_met(cls, is_true(context), message)


is_idle = requires(lambda _: running_solve() is None, "A clip is being solved; ESC cancels it")
has_clip = requires(lambda c: c.scene.virtual_aperture.footage, "Choose a clip first")
has_solve = requires(lambda c: c.scene.virtual_aperture.points is not None, "Solve the clip first")
has_focus = each_of(
    has_solve,
    requires(
        lambda c: is_in_focus(c.scene.virtual_aperture), "Pick what should be sharp first, with Pick Focus"
    ),
)
"""Polls: no clip is being solved; a clip is chosen; the scene holds a solved clip; something is in focus."""


def has_points(cls: Any, context: bpy.types.Context) -> bool:
    """Poll: vertices of the point cloud can be selected."""
    if not may_change(cls, context) or not has_solve(cls, context):
        return False
    points = context.scene.virtual_aperture.points
    if points.mode == "EDIT":
        return True
    if not parts.is_in(context.scene, points):
        cls.poll_message_set("The point cloud was deleted; Restore Objects, under Details, brings it back")
    elif points.name not in context.view_layer.objects:
        cls.poll_message_set("The point cloud's collection is excluded from the view layer")
    else:
        cls.poll_message_set("Select the point cloud, press Tab for Edit Mode and select vertices")
    return False


def asked(operator: Any, context: bpy.types.Context, event: bpy.types.Event, **words: str) -> Result:
    """Ask the user with `invoke_confirm`, whose texts are `words`; a yes calls the operator's `execute`."""
    answer: Result = context.window_manager.invoke_confirm(operator, event, **words)
    return answer


def refused(error: RuntimeError) -> UserError:
    """Return the error of an operator called from Python."""
    return UserError(str(error).removeprefix("Error: ").strip())


def reported(
    execute: Callable[[Any, bpy.types.Context], Result],
) -> Callable[[Any, bpy.types.Context], Result]:
    """Turn a UserError into the operator's error report, which scripts see as RuntimeError."""

    def wrapped(self: Any, context: bpy.types.Context) -> Result:
        try:
            return execute(self, context)
        except UserError as error:
            self.report({"ERROR"}, error.worded(WORDS))
            return {"CANCELLED"}

    return wrapped


def listed(items: Callable[[bpy.types.Context], list[Item]]) -> Callable[[Any, Any], list[Item]]:
    """Return a function for an enumeration's items, whose strings it keeps: Blender has no hold of them."""
    kept: list[Item] = []

    def listing(_operator: Any, context: bpy.types.Context | None) -> list[Item]:
        kept[:] = items(context or bpy.context)
        return kept

    return listing


class Named:
    """A mixin of operators: VIRTUAL_APERTURE_OT_find_clip is virtual_aperture.find_clip, Find Clip."""

    def __init_subclass__(cls: Any) -> None:
        super().__init_subclass__()
        cls.bl_idname = cls.__name__.replace("_OT_", ".").lower()
        cls.bl_label = vars(cls).get("bl_label") or label_of(cls)

    def once_more(self: Any, **changed: object) -> None:
        """Call the operator again in the window, with its properties but those that are `changed`.

        Raises:
            UserError: The call is refused.
        """
        call = getattr(bpy.ops.virtual_aperture, type(self).__name__.partition("_OT_")[2])
        try:
            call("INVOKE_DEFAULT", **self.as_keywords() | changed)
        except RuntimeError as error:
            raise refused(error) from None


class Acts(Named):
    """A mixin of operators that do something at once."""

    def act(self, context: bpy.types.Context) -> str | None:
        """Do it; return a line about it, if there is one to be shown, or raise UserError."""
        raise NotImplementedError

    @reported
    def execute(self: Any, context: bpy.types.Context) -> Result:
        if said := self.act(context):
            self.report({"INFO"}, said)
        return {"FINISHED"}


class Edits(Acts):
    """One that changes the scene, and can be undone and repeated."""

    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

"""The list of subjects, and the operators that focus on one and carry it through the clip."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import bpy

from ...core.base.counting import counted
from ...core.base.errors import UserError
from ...core.base.progress import part
from ...core.focus.place import Place
from ...core.focus.pull import FocusMark
from ...core.frame.nearest_person import directed
from ...core.frame.repaired_depth import repaired_subject
from ...core.frame.repairs import Repair
from ...core.subjects.carried import UNSURE
from ...scene.base import redraw
from ...scene.base.timeline import clip_frame, go_to
from ...scene.focus import focus_marks
from ...scene.lens import blender_focus
from ...scene.lens.depth_of_field import length_words
from ...scene.lens.repairs import repairs_of
from ...scene.sources import subjects
from ...scene.sources.shot import Shot, shot_of
from ..base.operators import Acts, has_solve, may_change, polls, requires
from ..base.text import list_row
from ..base.work import WorksMeanwhile
from ..jobs.report_list import draw_jump
from ..picking.pick_subject import VIRTUAL_APERTURE_OT_pick_subject
from ..picking.pick_vertices import ADD_MARK, focus_on
from . import thumbnails


class VIRTUAL_APERTURE_UL_subjects(bpy.types.UIList):  # noqa: N801
    """Name, and how many strokes mark it."""

    def draw_item(
        self, _context: bpy.types.Context, layout: bpy.types.UILayout, _data: object,
        subject: bpy.types.PropertyGroup, _icon: int, _active_data: object, _active: str, index: int = 0,
    ) -> None:  # fmt: skip
        row = layout.split(factor=0.65)
        row.prop(subject, "name", text="", emboss=False, icon="OUTLINER_OB_ARMATURE")
        row.label(text=counted(len(subject.strokes), "stroke"))


has_subject = requires(
    lambda context: subjects.active(context.scene.virtual_aperture),
    "No subject is marked; Pick Subject marks one",
)
has_suggestions = requires(
    lambda context: len(context.scene.virtual_aperture.marks.suggested),
    "There are no suggestions; Suggest Focus Marks makes some",
)
no_other = requires(lambda _: not WorksMeanwhile._under_way, "Another subject is being worked on")


class OfActive(Acts):
    """An operator on the active subject."""

    bl_options = {"UNDO"}  # noqa: RUF012

    poll = polls(may_change, has_solve, has_subject)


class WorksOnActive(OfActive, WorksMeanwhile):
    """One that computes something of it first."""

    poll = polls(no_other, may_change, has_solve, has_subject)

    def work(self, context: bpy.types.Context) -> Callable[[], Any]:
        subject = subjects.active(context.scene.virtual_aperture)
        assert subject is not None  # `poll` asks for it.
        self._name, self._frame = subject.name, clip_frame(context.scene)
        return self.work_on(shot_of(context.scene), repairs_of(context.scene.virtual_aperture))

    def work_on(self, shot: Shot, repairs: Sequence[Repair]) -> Callable[[], Any]:
        """Return the computation of the subject."""
        raise NotImplementedError


class VIRTUAL_APERTURE_OT_focus_subject(WorksOnActive, bpy.types.Operator):  # noqa: N801
    """Focus on the whole active subject at the current frame, and follow it as it moves"""

    bl_label = "Focus on Subject"
    doing = "Finding the subject's distance in all frames"

    add: ADD_MARK

    def work_on(self, shot: Shot, repairs: Sequence[Repair]) -> Callable[[], Place]:
        return partial(subject_place, shot, self._name, self._frame, repairs)

    def finish(self, scene: bpy.types.Scene, found: Place) -> str:
        return focus_on(scene.virtual_aperture, self._frame, [found], self.add)


class VIRTUAL_APERTURE_OT_suggest_marks(WorksMeanwhile, bpy.types.Operator):  # noqa: N801
    """Suggest focus marks on the nearest person, and where one enters or turns away. The focus stays until
    you take a suggestion"""

    bl_label = "Suggest Focus Marks"
    bl_options = {"UNDO"}  # noqa: RUF012
    doing = "Finding people and faces in all frames"

    poll = polls(may_change, has_solve, no_other)

    def work(self, context: bpy.types.Context) -> Callable[[], list[FocusMark]]:
        return partial(suggestions, shot_of(context.scene), repairs_of(context.scene.virtual_aperture))

    def finish(self, scene: bpy.types.Scene, found: list[FocusMark]) -> str:
        focus_marks.suggest(scene.virtual_aperture, found)
        redraw.panels()
        return f"{counted(len(found), 'suggestion')}; click one to make it a focus mark"


class VIRTUAL_APERTURE_OT_take_suggestion(Acts, bpy.types.Operator):  # noqa: N801
    """Make this suggestion a focus mark, or all of them. Frames that have a mark keep it"""

    bl_options = {"UNDO"}  # noqa: RUF012

    frame: bpy.props.IntProperty(name="Frame", options={"SKIP_SAVE"})
    every: bpy.props.BoolProperty(name="All", description="Take all suggestions", options={"SKIP_SAVE"})

    poll = polls(may_change, has_solve, has_suggestions)

    def act(self, context: bpy.types.Context) -> str:
        settings = context.scene.virtual_aperture
        frames = [mark.frame for mark in settings.marks.suggested if self.every or mark.frame == self.frame]
        if not frames:
            raise UserError(f"nothing is suggested at frame {self.frame}")
        blender_focus.release(settings)
        focus_marks.take(settings, frames)
        go_to(context.scene, frames[0])
        return counted(len(settings.marks.items), "focus mark")


class VIRTUAL_APERTURE_OT_dismiss_suggestions(Acts, bpy.types.Operator):  # noqa: N801
    """Remove the suggestions. Focus marks stay"""

    bl_options = {"UNDO"}  # noqa: RUF012

    poll = polls(has_suggestions)

    def act(self, context: bpy.types.Context) -> None:
        focus_marks.suggest(context.scene.virtual_aperture, [])


class VIRTUAL_APERTURE_OT_carry_subject(WorksOnActive, bpy.types.Operator):  # noqa: N801
    """Find the active subject in all frames now, and list the frames where another stroke would help"""

    bl_label = "Track Through Clip"
    doing = "Tracking the subject through the clip"

    def work_on(self, shot: Shot, _repairs: Sequence[Repair]) -> Callable[[], list[int]]:
        return partial(unsure_frames, shot, self._name)

    def finish(self, scene: bpy.types.Scene, found: list[int]) -> str:
        items = scene.virtual_aperture.subjects.items
        subject = next((each for each in items if each.name == self._name), None)
        if subject is None:
            raise UserError(f"there is no subject {self._name!r} any longer")
        subject.unsure = " ".join(map(str, found))
        redraw.panels()
        if not found:
            return f"{self._name} is tracked through all frames"
        return f"{self._name} is uncertain in {counted(len(found), 'frame')}; a stroke there helps"


def subject_place(shot: Shot, name: str, frame: int, repairs: Sequence[Repair]) -> Place:
    """Return the focus on a subject in a frame; errors as of `repaired_subject`."""
    return repaired_subject(shot.context, name, frame, repairs)


def suggestions(shot: Shot, repairs: Sequence[Repair]) -> list[FocusMark]:
    """Return the suggested focus marks; errors as of `directed`."""
    return directed(shot.context, repairs)


def unsure_frames(shot: Shot, name: str) -> list[int]:
    """Carry a subject through all frames; those in which another stroke would help.

    Errors as of `MovingParts.named` and `ClipSubject.mask`.
    """
    clip = shot.context
    carried = clip.parts.subjects.carried(next(each for each in clip.marked if each.name == name))
    frames = [int(frame) for frame in clip.reconstruction.frames]
    found = []
    for number, frame in enumerate(frames):
        with part(number, len(frames)):
            if carried.cut(frame).sure < UNSURE:
                found.append(frame)
            # Kept for renders.
            clip.parts.named(name).mask(frame)
    return found


class VIRTUAL_APERTURE_OT_remove_subject(OfActive, bpy.types.Operator):  # noqa: N801
    """Remove the active subject and its strokes. Focus marks on it stay"""

    bl_label = "Remove Subject"

    def act(self, context: bpy.types.Context) -> str:
        settings = context.scene.virtual_aperture
        subject = subjects.active(settings)
        assert subject is not None  # `poll` asks for it.
        name = subject.name
        subjects.remove_active(settings.subjects)
        return f"Removed the subject {name}"


def draw(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw the list, its operators, and the frames in which the active subject is unsure."""
    settings = context.scene.virtual_aperture
    group = settings.subjects
    layout.operator(VIRTUAL_APERTURE_OT_pick_subject.bl_idname, icon="BRUSH_DATA")
    layout.operator(VIRTUAL_APERTURE_OT_suggest_marks.bl_idname, icon="COMMUNITY")
    column = layout.column(align=True)
    for mark in settings.marks.suggested:
        words = f"{mark.frame}: {mark.name}, {length_words(settings, mark.distance)}"
        name = VIRTUAL_APERTURE_OT_take_suggestion.bl_idname
        column.operator(name, text=words, icon_value=thumbnails.icon(settings, mark)).frame = mark.frame
    if len(settings.marks.suggested):
        row = column.row(align=True)
        row.operator(
            VIRTUAL_APERTURE_OT_take_suggestion.bl_idname, text="Take All", icon="CHECKMARK"
        ).every = True
        row.operator(VIRTUAL_APERTURE_OT_dismiss_suggestions.bl_idname, text="Dismiss", icon="X")
    if not len(group.items):
        return
    side = list_row(layout, "subjects", group).column(align=True)
    side.operator(VIRTUAL_APERTURE_OT_pick_subject.bl_idname, text="", icon="ADD").new = True
    side.operator(VIRTUAL_APERTURE_OT_remove_subject.bl_idname, text="", icon="REMOVE")
    layout.operator(VIRTUAL_APERTURE_OT_focus_subject.bl_idname, icon="CON_TRACKTO")
    layout.operator(VIRTUAL_APERTURE_OT_carry_subject.bl_idname, icon="TRACKING_FORWARDS")
    subject = subjects.active(settings)
    if subject is not None and (unsure := [int(frame) for frame in subject.unsure.split()]):
        line = layout.row(align=True)
        line.label(text=f"Uncertain in {counted(len(unsure), 'frame')}", icon="QUESTION")
        draw_jump(line, context, unsure)

"""Subjects that the user marks by strokes, as they are kept in the .blend."""

from collections.abc import Collection, Sequence
from itertools import count

import bpy
from bpy.props import BoolProperty, CollectionProperty, FloatVectorProperty, IntProperty, StringProperty

from ...core.focus.place import Place
from ...core.subjects.strokes import MarkedSubject, Stroke
from ..base import redraw
from ..base.option_properties import hidden

DEFAULT_NAME = "Subject"


class VirtualApertureStrokePlace(bpy.types.PropertyGroup):
    """A corner of a stroke."""

    xy: FloatVectorProperty(
        name="Place",
        description="Position as fractions of the image, from the top left",
        size=2,
        min=0,
        max=1,
    )


class VirtualApertureStroke(bpy.types.PropertyGroup):
    """A line over a subject in one frame, or over what does not belong to it."""

    frame: IntProperty(name="Frame", description="Frame it was drawn in")
    adds: BoolProperty(
        name="Adds",
        description="Whether what is under the stroke is added to the subject, or taken away",
        default=True,
    )
    places: CollectionProperty(type=VirtualApertureStrokePlace)


def _renamed(subject: bpy.types.PropertyGroup, _context: bpy.types.Context) -> None:
    """Keep names unique."""
    items = subject.id_data.virtual_aperture.subjects.items
    others = {each.name for each in items if each != subject}
    if subject.name in others or not subject.name:
        subject.name = _free(subject.name or DEFAULT_NAME, others)


def _free(name: str, taken: Collection[str]) -> str:
    """A name, with a number behind it where it is taken."""
    return next(each for n in count(1) if (each := name if n == 1 else f"{name} {n}") not in taken)


class VirtualApertureSubject(bpy.types.PropertyGroup):
    """Something that moves by itself, as the user marks it."""

    name: StringProperty(name="Name", description="Name of the subject", update=_renamed)
    strokes: CollectionProperty(type=VirtualApertureStroke)
    unsure: hidden(StringProperty, "Uncertain Frames", "Frames where another stroke would help")


class VirtualApertureSubjects(bpy.types.PropertyGroup):
    """The subjects of a clip."""

    items: CollectionProperty(type=VirtualApertureSubject)
    active: IntProperty(name="Subject", description="Subject that strokes are added to", min=0)


def marked_of(settings: bpy.types.PropertyGroup) -> tuple[MarkedSubject, ...]:
    """Return the subjects as the core takes them; those without a stroke that adds are left out."""
    found = (MarkedSubject(each.name, strokes_of(each)) for each in settings.subjects.items)
    return tuple(each for each in found if any(stroke.adds for stroke in each.strokes))


def strokes_of(subject: bpy.types.PropertyGroup) -> tuple[Stroke, ...]:
    """Return the strokes of a subject as the core takes them."""
    return tuple(
        Stroke(stroke.frame, tuple((float(p.xy[0]), float(p.xy[1])) for p in stroke.places), stroke.adds)
        for stroke in subject.strokes
    )


def active(settings: bpy.types.PropertyGroup) -> bpy.types.PropertyGroup | None:
    """Subject that strokes are added to."""
    group = settings.subjects
    return group.items[group.active] if group.active < len(group.items) else None


def free_name(settings: bpy.types.PropertyGroup, taken: Collection[str] = ()) -> str:
    """Return the name of a new subject, other than names that are `taken` beside those of the subjects."""
    return _free(DEFAULT_NAME, {*taken, *(each.name for each in settings.subjects.items)})


def mark_new(settings: bpy.types.PropertyGroup, places: Sequence[Place]) -> str:
    """Mark the new subjects that places are on; their names and a verb, empty where there are none."""
    names = [each.marks.name for each in places if each.marks is not None]
    for each in places:
        if each.marks is not None:
            set_strokes(settings, each.marks.name, each.marks.strokes)
    return f"{', '.join(names)} {'is' if len(names) == 1 else 'are'} marked" if names else ""


def set_marked(settings: bpy.types.PropertyGroup, subjects: Sequence[MarkedSubject]) -> None:
    """Write subjects in place of those that are there."""
    settings.subjects.items.clear()
    for subject in subjects:
        add_strokes(settings, subject.name, subject.strokes)


def add_strokes(settings: bpy.types.PropertyGroup, name: str, strokes: Sequence[Stroke]) -> None:
    """Add strokes to the subject of a name, which is made where there is none, and becomes the active one."""
    items = settings.subjects.items
    at = next((n for n, each in enumerate(items) if each.name == name), len(items))
    if at == len(items):
        items.add().name = name
    settings.subjects.active = at
    for stroke in strokes:
        kept = items[at].strokes.add()
        kept.frame, kept.adds = stroke.frame, stroke.adds
        for place in stroke.places:
            kept.places.add().xy = place


def set_strokes(settings: bpy.types.PropertyGroup, name: str, strokes: Sequence[Stroke]) -> None:
    """Replace the strokes of a subject; see `add_strokes`."""
    for each in settings.subjects.items:
        if each.name == name:
            each.strokes.clear()
            each.unsure = ""
    add_strokes(settings, name, strokes)
    changed(settings)


def remove_active(group: bpy.types.PropertyGroup) -> None:
    """Remove the active one of a group of subjects or repairs."""
    group.items.remove(group.active)
    group.active = max(min(group.active, len(group.items) - 1), 0)
    changed(group)


def changed(group: bpy.types.PropertyGroup) -> None:
    """Have the scene drawn again after strokes have changed."""
    group.id_data.update_tag()
    redraw.viewports()


CLASSES = (VirtualApertureStrokePlace, VirtualApertureStroke, VirtualApertureSubject, VirtualApertureSubjects)

"""Subjects that the user marks by strokes, as they are kept in the .blend."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    FloatVectorProperty,
    IntProperty,
    StringProperty,
)

from ..core.subjects.marked import MarkedSubject, Stroke

DEFAULT_NAME = "Subject"


class VirtualApertureStrokePlace(bpy.types.PropertyGroup):
    """A corner of a stroke."""

    xy: FloatVectorProperty(
        name="Place", description="Shares of the picture, from its top left", size=2, min=0, max=1
    )


class VirtualApertureStroke(bpy.types.PropertyGroup):
    """A line over a subject in one frame, or over what does not belong to it."""

    frame: IntProperty(name="Frame", description="Frame of the clip that it was drawn in")
    adds: BoolProperty(
        name="Adds",
        description="What is under the stroke belongs to the subject; else it does not",
        default=True,
    )
    places: CollectionProperty(type=VirtualApertureStrokePlace)


class VirtualApertureSubject(bpy.types.PropertyGroup):
    """Something that moves by itself, as the user marks it."""

    name: StringProperty(name="Name", description="Name of the subject", default=DEFAULT_NAME)
    strokes: CollectionProperty(type=VirtualApertureStroke)
    unsure: StringProperty(
        name="Unsure Frames", description="Frames in which a stroke would help", options={"HIDDEN"}
    )


class VirtualApertureSubjects(bpy.types.PropertyGroup):
    """The subjects of a clip."""

    items: CollectionProperty(type=VirtualApertureSubject)
    active: IntProperty(name="Subject", description="The subject that strokes are added to", min=0)


def marked_of(settings: bpy.types.PropertyGroup) -> tuple[MarkedSubject, ...]:
    """The subjects as the core takes them; those without a stroke that adds are left out."""
    found = (
        MarkedSubject(
            each.name,
            tuple(
                Stroke(
                    stroke.frame, tuple((float(p.xy[0]), float(p.xy[1])) for p in stroke.places), stroke.adds
                )
                for stroke in each.strokes
            ),
        )
        for each in settings.subjects.items
    )
    return tuple(each for each in found if any(stroke.adds for stroke in each.strokes))


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


CLASSES = (
    VirtualApertureStrokePlace,
    VirtualApertureStroke,
    VirtualApertureSubject,
    VirtualApertureSubjects,
)

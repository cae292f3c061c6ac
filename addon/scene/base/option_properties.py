"""Blender properties made from declared options (`core/base/options.py`)."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import bpy
import numpy as np
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, StringProperty

from ...core.base.options import Option

Update = Callable[[Any, bpy.types.Context], None]


def property_of(option: Option, update: Update | None = None) -> Any:
    """Return the Blender property that holds an option, for a class's annotations."""
    arguments: dict[str, Any] = {"name": option.label, "description": option.help, "default": option.initial}
    if update is not None:
        arguments["update"] = update
    if not option.can_be_keyed:
        arguments["options"] = set()
    if option.choices is not None:
        items = [(key, key.title(), each.help, each.number) for key, each in option.choices.items()]
        return EnumProperty(items=items, **arguments)
    if option.kind is bool:
        return BoolProperty(**arguments)
    bounds = {
        "min": option.least, "max": option.most, "soft_min": option.soft_least, "soft_max": option.soft_most,
    }  # fmt: skip
    arguments |= {name: value for name, value in bounds.items() if value is not None and np.isfinite(value)}
    if option.kind is int:
        return IntProperty(**arguments)
    return FloatProperty(subtype=option.unit, precision=option.precision, **arguments)


def hidden(kind: Callable[..., Any], name: str, description: str, **more: Any) -> Any:
    """Return a property of a kind, such as `StringProperty`, that the interface does not show."""
    return kind(name=name, description=description, options={"HIDDEN"}, **more)


def path_property(name: str, description: str, subtype: str = "FILE_PATH", **more: Any) -> Any:
    """Return a property that is a path, which may be relative to the .blend."""
    options = {"PATH_SUPPORTS_BLEND_RELATIVE"}
    return StringProperty(name=name, description=description, subtype=subtype, options=options, **more)


def with_options(
    options: Mapping[str, Option], update: Update | None = None, updating: Iterable[str] | None = None
) -> Callable[[type], type]:
    """Return a class decorator that adds a property for each option by its name.

    `update` is called when those named in `updating` change, by default all.
    """

    def decorate(group: type) -> type:
        follows = set(options if updating is None else updating)
        group.__annotations__ |= {
            name: property_of(each, update if name in follows else None) for name, each in options.items()
        }
        return group

    return decorate


def values_of(group: bpy.types.PropertyGroup, options: Mapping[str, Option]) -> dict[str, Any]:
    """Return the values of options in a property group, by name; choices as identifiers."""
    return {name: getattr(group, name) for name in options}

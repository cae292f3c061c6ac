"""Files of settings that a released version stored, and what they hold.

`python -m tests.scene.stored_settings` writes those of the present version, once for each release that adds
a property: `stored/VERSION.blend` and `stored/VERSION.json`. None is ever changed.
"""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any, get_type_hints

import bpy

ROOT = Path(__file__).resolve().parents[2]
STORED = Path(__file__).parent / "stored"
ENGINE = "VIRTUAL_APERTURE"


def parts(scene: bpy.types.Scene) -> dict[str, bpy.types.PropertyGroup]:
    """The property groups that a .blend keeps of a scene."""
    return {"scene": scene.virtual_aperture, "passes": scene.view_layers[0].virtual_aperture_passes}


def stored(group: bpy.types.PropertyGroup) -> list[bpy.types.Property]:
    """The properties of a group whose values files have: not those that are computed."""
    declared = get_type_hints(type(group))
    held = [each for each in group.bl_rna.properties if each.identifier in declared]
    return [each for each in held if "get" not in declared[each.identifier].keywords]


def other_value(held: bpy.types.Property) -> Any:
    """A value that is not the default."""
    if held.type == "BOOLEAN":
        return not held.default
    if held.type == "ENUM":
        return next(item.identifier for item in held.enum_items if item.identifier != held.default)
    if held.type == "STRING":
        return f"//some {held.identifier}"
    low = max(held.hard_min, -4)
    high = min(held.hard_max, max(low, 0) + 4)
    values = [low + (high - low) * share for share in (0.25, 0.5, 0.75)]
    wanted = [round(each) if held.type == "INT" else each for each in values]
    default = held.default
    if getattr(held, "is_array", False):
        return wanted[: held.array_length]
    return next(each for each in wanted if each != default)


def fill(group: bpy.types.PropertyGroup) -> None:
    """Give every stored property of a group, and of those within, a value that is not its default."""
    for held in stored(group):
        if held.type == "COLLECTION":
            fill(getattr(group, held.identifier).add())
        elif held.type == "POINTER" and isinstance(getattr(group, held.identifier), bpy.types.PropertyGroup):
            fill(getattr(group, held.identifier))
        elif held.type == "POINTER":
            if held.fixed_type.identifier == "Object":
                setattr(group, held.identifier, bpy.data.objects["Kept"])
        else:
            setattr(group, held.identifier, other_value(held))


def values(group: bpy.types.PropertyGroup) -> dict[str, Any]:
    """The stored values of a group, as JSON has them."""
    found: dict[str, Any] = {}
    for held in stored(group):
        name, value = held.identifier, getattr(group, held.identifier)
        if held.type == "COLLECTION":
            found[name] = [values(each) for each in value]
        elif held.type == "POINTER":
            is_group = isinstance(value, bpy.types.PropertyGroup)
            found[name] = values(value) if is_group else value.name if value else None
        elif getattr(held, "is_array", False):
            found[name] = list(value)
        else:
            found[name] = value
    return found


def enums(kind: bpy.types.Struct, path: str = "") -> dict[str, dict[str, int]]:
    """The items of a group's enumerations, and the numbers by which files have them."""
    found: dict[str, dict[str, int]] = {}
    for held in kind.properties:
        name = f"{path}.{held.identifier}".lstrip(".")
        if held.type == "ENUM":
            found[name] = {item.identifier: item.value for item in held.enum_items}
        elif held.type in ("POINTER", "COLLECTION") and held.identifier != "rna_type":
            inner = held.fixed_type
            if "VirtualAperture" in inner.identifier:
                found |= enums(inner, name)
    return found


def held_by(scene: bpy.types.Scene) -> dict[str, Any]:
    """All that a .blend keeps of a scene."""
    groups = parts(scene)
    return {
        "values": {name: values(group) for name, group in groups.items()},
        "enums": {name: enums(group.bl_rna) for name, group in groups.items()},
    }


def main() -> None:
    import addon

    addon.register()
    bpy.ops.wm.read_homefile(app_template="", use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    scene.collection.objects.link(bpy.data.objects.new("Kept", bpy.data.meshes.new("Kept")))
    for group in parts(scene).values():
        fill(group)
    scene.render.engine = ENGINE
    version = tomllib.loads((ROOT / "blender_manifest.toml").read_text())["version"]
    STORED.mkdir(exist_ok=True)
    blend = STORED / f"{version}.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend), compress=True, relative_remap=False)
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    (STORED / f"{version}.json").write_text(json.dumps(held_by(bpy.context.scene), indent=1) + "\n")


if __name__ == "__main__":
    main()

"""A layout that remembers what panels draw, and knows what Blender's own would refuse."""

from __future__ import annotations

from typing import Any

import bpy

CONTAINERS = {"row", "column", "box", "split", "column_flow", "grid_flow"}


class Recorder:
    """Takes what `bpy.types.UILayout` takes; AssertionError for a property, operator, icon or argument that
    does not exist. What was drawn lies in `props`, `operators` and `texts` of the outermost layout.
    """

    def __init__(self, within: Recorder | None = None) -> None:
        lists: tuple[list[str], ...] = (
            ([], [], []) if within is None else (within.props, within.operators, within.texts)
        )
        self.__dict__.update(zip(("props", "operators", "texts"), lists, strict=True))
        self.__dict__["active"] = True if within is None else within.active

    def __setattr__(self, name: str, value: object) -> None:
        assert name in bpy.types.UILayout.bl_rna.properties, f"a layout has no {name}"
        self.__dict__[name] = value

    def __getattr__(self, name: str) -> Any:
        functions = bpy.types.UILayout.bl_rna.functions
        assert name in functions, f"a layout has no {name}"
        parameters = functions[name].parameters

        def draw(*args: Any, **kwargs: Any) -> Any:
            for key in kwargs:
                assert key in parameters, f"{name} takes no {key}"
            if "icon" in kwargs:
                assert kwargs["icon"] in parameters["icon"].enum_items, f"there is no icon {kwargs['icon']}"
            self.texts.extend([kwargs["text"]] if kwargs.get("text") else [])
            if name in CONTAINERS:
                return Recorder(self)
            if name == "prop":
                self._prop(*args)
            elif name.startswith("operator"):
                return self._operator(*args)
            return None

        return draw

    def _prop(self, data: bpy.types.bpy_struct, name: str) -> None:
        assert name in data.bl_rna.properties, f"{data} has no property {name}"
        self.props.append(name if self.active else f"({name})")

    def _operator(self, idname: str, choice: str = "") -> Any:
        group, name = idname.split(".")
        # KeyError for an operator that is not registered.
        properties = getattr(getattr(bpy.ops, group), name).get_rna_type().properties
        assert not choice or choice in properties, f"{idname} has no property {choice}"
        self.operators.append(idname)
        return _Properties(idname, set(properties.keys()))


class _Properties:
    """What an operator button can be given."""

    def __init__(self, idname: str, names: set[str]) -> None:
        self.__dict__.update(idname=idname, names=names)

    def __setattr__(self, name: str, _value: object) -> None:
        assert name in self.names, f"{self.idname} has no property {name}"


def draw(panel: type[bpy.types.Panel]) -> Recorder:
    """What a panel draws with the present context."""
    layout = Recorder()
    panel.draw(type("Self", (), {"layout": layout})(), bpy.context)
    return layout

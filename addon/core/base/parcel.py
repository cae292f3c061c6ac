"""Python values as bytes for another of our processes: calls with their arguments, and results.

The reader takes only classes and functions of this package, and those in `PLAIN`, which NumPy's arrays and
paths consist of. The package may have another name in the other process.
"""

from __future__ import annotations

import io
import pickle
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from importlib import import_module
from typing import Any

ROOT = __name__.removesuffix(".core.base.parcel")
PLAIN = {
    "builtins": {"frozenset", "range", "set", "slice", "complex", "bytearray"},
    "collections": {"OrderedDict", "deque"},
    "fractions": {"Fraction"},
    "functools": {"partial"},
    "numpy": {"dtype", "ndarray"},
    "numpy._core.multiarray": {"_reconstruct", "scalar"},
    "numpy._core.numeric": {"_frombuffer"},
    "pathlib": {"PosixPath", "WindowsPath"},
    "pathlib._local": {"PosixPath", "WindowsPath"},
}
"""Names by module."""
Named = Callable[[Any], object]
"""Returns a name that stands for a thing, or None; or the thing of a name."""


def no_name(_thing: object) -> None:
    """Name nothing."""


def pack(value: object, name: Named = no_name) -> bytes:
    """Return a value as bytes.

    Dataclasses are their fields: values that they have cached stay behind.

    Args:
        value: The value.
        name: Returns a name that stands for a thing, of which no more is packed, or None.
    """
    file = io.BytesIO()
    file.write(f"{ROOT}\n".encode())
    _Packer(file, name).dump(value)
    return file.getvalue()


def unpack(data: bytes, thing: Named = no_name) -> Any:
    """Return the value of `pack`; `thing` returns what a name stands for.

    Raises:
        pickle.UnpicklingError: It has anything else but plain values and ours.
    """
    file = io.BytesIO(data)
    return _Reader(file, file.readline().decode().strip(), thing).load()


class _Packer(pickle.Pickler):
    def __init__(self, file: io.BytesIO, name: Named) -> None:
        super().__init__(file, 5)
        self._name = name

    def persistent_id(self, thing: object) -> object:
        return self._name(thing)

    def reducer_override(self, thing: Any) -> Any:
        is_plain = is_dataclass(thing) and type(thing).__reduce__ is object.__reduce__
        if isinstance(thing, type) or not is_plain:
            return NotImplemented
        return _made, (type(thing), {each.name: getattr(thing, each.name) for each in fields(thing)})


class _Reader(pickle.Unpickler):
    def __init__(self, file: io.BytesIO, root: str, thing: Named) -> None:
        super().__init__(file)
        self._root, self._thing = root, thing

    def persistent_load(self, name: Any) -> Any:
        return self._thing(name)

    def find_class(self, module: str, name: str) -> Any:
        if module.startswith(f"{self._root}."):
            return getattr(import_module(ROOT + module.removeprefix(self._root)), name)
        if name in PLAIN.get(module, ()):
            return super().find_class(module, name)
        raise pickle.UnpicklingError(f"{module}.{name} is not of this package")


def _made[T](kind: type[T], values: dict[str, Any]) -> T:
    """Return a dataclass with these values, which were checked where it was made."""
    made = object.__new__(kind)
    for name, value in values.items():
        object.__setattr__(made, name, value)
    return made

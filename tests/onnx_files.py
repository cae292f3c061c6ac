"""Small networks as ONNX files, written byte by byte: the protobuf that exporters write."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

Side = int | str
"""Of a tensor's shape: a number, or the name of what is left open."""

OPSET = 13
"""ONNX's version of operations."""

ANY: tuple[Side, ...] = ("batch", 3, "height", "width")
"""A picture of any size."""


def network(
    nodes: Sequence[bytes],
    weights: dict[str, np.ndarray],
    shape: Sequence[Side],
    outputs: Sequence[str] = ("y",),
) -> bytes:
    """A model from the input `x` of a shape to outputs whose shapes are left open."""
    graph = b"".join(_field(1, each) for each in nodes) + _field(2, "graph")
    graph += b"".join(_field(5, _tensor(name, values)) for name, values in weights.items())
    open_sides = ("batch", "channels", "rows", "columns")
    graph += _field(11, _value("x", shape)) + b"".join(
        _field(12, _value(each, open_sides)) for each in outputs
    )
    return _field(1, 7) + _field(7, graph) + _field(8, _field(1, "") + _field(2, OPSET))


def node(kind: str, inputs: Sequence[str], output: str, **numbers: int) -> bytes:
    """An operation, its attributes whole numbers."""
    data = b"".join(_field(1, name) for name in inputs) + _field(2, output) + _field(4, kind)
    for name, number in numbers.items():
        data += _field(5, _field(1, name) + _field(3, number) + _field(20, 2))
    return data


def red(shape: tuple[Side, ...] = ANY, times: float = 40.0) -> bytes:
    """A network to which red things are salient, and whose second output is none of them."""
    weight = np.zeros((1, 3, 1, 1), np.float32)
    weight[0, :2, 0, 0] = times, -times
    nodes = [node("Conv", ["x", "w", "b"], "odds"), node("Sigmoid", ["odds"], "y"), node("Relu", ["x"], "z")]
    return network(nodes, {"w": weight, "b": np.array([-8.0], np.float32)}, shape, ("y", "z"))


def _tensor(name: str, values: np.ndarray) -> bytes:
    kind = {"float32": 1, "int64": 7}[values.dtype.name]
    sides = b"".join(_field(1, side) for side in values.shape)
    return sides + _field(2, kind) + _field(8, name) + _field(9, values.tobytes())


def _value(name: str, shape: Sequence[Side]) -> bytes:
    sides = b"".join(_field(1, _field(1 if isinstance(side, int) else 2, side)) for side in shape)
    return _field(1, name) + _field(2, _field(1, _field(1, 1) + _field(2, sides)))


def _field(number: int, value: int | str | bytes) -> bytes:
    if isinstance(value, int):
        return _varint(number << 3) + _varint(value % (1 << 64))
    data = value.encode() if isinstance(value, str) else value
    return _varint(number << 3 | 2) + _varint(len(data)) + data


def _varint(number: int) -> bytes:
    data = bytearray()
    while number > 127:
        data.append(number & 127 | 128)
        number >>= 7
    return bytes([*data, number])

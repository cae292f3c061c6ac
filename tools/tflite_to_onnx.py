"""Convert a TensorFlow Lite model with sparse weights into an ONNX model that OpenCV's `dnn` reads.

OpenCV 5.0 reads neither `DENSIFY` nor `DEPTH_TO_SPACE` of TensorFlow Lite. Here sparse weights are stored
dense, and `DEPTH_TO_SPACE` becomes the operator of ONNX. Only the operators of MediaPipe's detectors are
supported.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import onnx
import tflite
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

Array = NDArray[np.generic]

OPSET = 13
"""ONNX operator set: the first with `Pad`, `Resize` and `Reshape` as they are written here."""
TYPES: dict[int, type[np.generic]] = {
    tflite.TensorType.FLOAT32: np.float32,
    tflite.TensorType.FLOAT16: np.float16,
    tflite.TensorType.INT32: np.int32,
    tflite.TensorType.INT8: np.int8,
}
OPERATORS = {
    getattr(tflite.BuiltinOperator, name): name for name in dir(tflite.BuiltinOperator) if name.isupper()
}
SPATIAL = (0, 2, 3, 1)
"""Axes of an (n, c, h, w) tensor in the order (n, h, w, c)."""


@dataclass
class Graph:
    """An ONNX graph under construction; every four-dimensional tensor in it is (n, c, h, w)."""

    nodes: list[onnx.NodeProto] = field(default_factory=list)
    constants: list[onnx.TensorProto] = field(default_factory=list)

    def constant(self, name: str, values: Array) -> str:
        """Add a constant and return its name."""
        self.constants.append(numpy_helper.from_array(np.ascontiguousarray(values), name))
        return name

    def node(self, kind: str, inputs: list[str], output: str, **attributes: object) -> str:
        """Add a node and return the name of its output."""
        self.nodes.append(helper.make_node(kind, inputs, [output], name=output, **attributes))
        return output


class Converter:
    """Converts one model: constants are folded, operators are translated one by one."""

    def __init__(self, data: bytes) -> None:
        self.model = tflite.Model.GetRootAsModel(data, 0)
        self.source = self.model.Subgraphs(0)
        self.graph = Graph()
        self.values: dict[int, Array] = {}
        self.named: set[int] = set()

    def convert(self) -> onnx.ModelProto:
        """Return the ONNX model: its input is (1, 3, h, w), its outputs keep their names and shapes."""
        for index in range(self.source.OperatorsLength()):
            self._operator(self.source.Operators(index))
        entry = self.source.Inputs(0)
        _, height, width, channels = self._shape(entry)
        outputs = [
            helper.make_tensor_value_info(self._name(each), TensorProto.FLOAT, self._shape(each))
            for each in self.source.OutputsAsNumpy()
        ]
        given = helper.make_tensor_value_info(
            self._name(entry), TensorProto.FLOAT, (1, channels, height, width)
        )
        graph = helper.make_graph(self.graph.nodes, "detector", [given], outputs, self.graph.constants)
        made = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=8)
        onnx.checker.check_model(made)
        return made

    def _operator(self, operator: tflite.Operator) -> None:
        code = self.model.OperatorCodes(operator.OpcodeIndex())
        kind = OPERATORS[max(code.BuiltinCode(), code.DeprecatedBuiltinCode())]
        inputs, output = operator.InputsAsNumpy(), int(operator.Outputs(0))
        if kind in ("DEQUANTIZE", "DENSIFY"):
            self.values[output] = self._value(int(inputs[0])).astype(np.float32)
            return
        translate: dict[str, Callable[[tflite.Operator, list[int], int], None]] = {
            "CONV_2D": self._convolution,
            "DEPTHWISE_CONV_2D": self._convolution,
            "ADD": self._add,
            "PAD": self._pad,
            "RESHAPE": self._reshape,
            "DEPTH_TO_SPACE": self._depth_to_space,
            "RESIZE_BILINEAR": self._resize,
            "CONCATENATION": self._concatenation,
        }
        if kind not in translate:
            raise ValueError(f"the operator {kind} is not known; known are {', '.join(translate)}")
        translate[kind](operator, [int(each) for each in inputs], output)

    def _convolution(self, operator: tflite.Operator, inputs: list[int], output: int) -> None:
        is_depthwise = operator.BuiltinOptionsType() == tflite.BuiltinOptions.DepthwiseConv2DOptions
        options = tflite.DepthwiseConv2DOptions() if is_depthwise else tflite.Conv2DOptions()
        options.Init(operator.BuiltinOptions().Bytes, operator.BuiltinOptions().Pos)
        # Stored as (out, h, w, in); depthwise as (1, h, w, out).
        kernel = self._value(inputs[1]).transpose((3, 0, 1, 2) if is_depthwise else (0, 3, 1, 2))
        stride = (options.StrideH(), options.StrideW())
        before, after = (0, 0), (0, 0)
        if options.Padding() == tflite.Padding.SAME:
            before, after = self._same(self._shape(inputs[0])[1:3], kernel.shape[2:], stride)
        weights = [self._constant(inputs[1], kernel), self._constant(inputs[2], self._value(inputs[2]))]
        result = self.graph.node(
            "Conv", [self._name(inputs[0]), *weights], self._before_activation(output, options),
            strides=stride, pads=[*before, *after], group=kernel.shape[0] if is_depthwise else 1,
        )  # fmt: skip
        self._activate(result, output, options)

    @staticmethod
    def _same(
        size: tuple[int, ...], kernel: tuple[int, ...], stride: tuple[int, int]
    ) -> tuple[list[int], list[int]]:
        """Padding before and after with which the output has size / stride pixels, rounded up."""
        total = [
            max((-(-side // step) - 1) * step + reach - side, 0)
            for side, reach, step in zip(size, kernel, stride, strict=True)
        ]
        return [each // 2 for each in total], [each - each // 2 for each in total]

    def _add(self, operator: tflite.Operator, inputs: list[int], output: int) -> None:
        options = self._options(operator, tflite.AddOptions())
        result = self.graph.node(
            "Add", [self._name(each) for each in inputs], self._before_activation(output, options)
        )
        self._activate(result, output, options)

    def _pad(self, operator: tflite.Operator, inputs: list[int], output: int) -> None:
        pads = self._value(inputs[1])[[0, 3, 1, 2]].T.astype(np.int64).ravel()
        sides = self.graph.constant(f"{self._name(output)}/pads", pads)
        self.graph.node("Pad", [self._name(inputs[0]), sides], self._name(output))

    def _reshape(self, operator: tflite.Operator, inputs: list[int], output: int) -> None:
        source = self._name(inputs[0])
        if len(self._shape(inputs[0])) == 4:
            source = self.graph.node("Transpose", [source], f"{self._name(output)}/rows", perm=[0, 2, 3, 1])
        shape = self.graph.constant(f"{self._name(output)}/shape", np.array(self._shape(output), np.int64))
        self.graph.node("Reshape", [source, shape], self._name(output))

    def _depth_to_space(self, operator: tflite.Operator, inputs: list[int], output: int) -> None:
        size = self._options(operator, tflite.DepthToSpaceOptions()).BlockSize()
        self.graph.node(
            "DepthToSpace", [self._name(inputs[0])], self._name(output), blocksize=size, mode="DCR"
        )

    def _resize(self, operator: tflite.Operator, inputs: list[int], output: int) -> None:
        options = self._options(operator, tflite.ResizeBilinearOptions())
        mode = "half_pixel" if options.HalfPixelCenters() else "asymmetric"
        if options.AlignCorners():
            mode = "align_corners"
        size = np.array([self._shape(output)[axis] for axis in (0, 3, 1, 2)], np.int64)
        name = self.graph.constant(f"{self._name(output)}/size", size)
        self.graph.node(
            "Resize", [self._name(inputs[0]), "", "", name], self._name(output),
            mode="linear", coordinate_transformation_mode=mode,
        )  # fmt: skip

    def _concatenation(self, operator: tflite.Operator, inputs: list[int], output: int) -> None:
        axis = self._options(operator, tflite.ConcatenationOptions()).Axis() % len(self._shape(output))
        if len(self._shape(output)) == 4:
            axis = SPATIAL.index(axis)
        self.graph.node("Concat", [self._name(each) for each in inputs], self._name(output), axis=axis)

    def _options(self, operator: tflite.Operator, options: object) -> object:
        options.Init(operator.BuiltinOptions().Bytes, operator.BuiltinOptions().Pos)
        return options

    def _before_activation(self, output: int, options: object) -> str:
        is_linear = options.FusedActivationFunction() == tflite.ActivationFunctionType.NONE
        return self._name(output) if is_linear else f"{self._name(output)}/linear"

    def _activate(self, result: str, output: int, options: object) -> None:
        function, name = options.FusedActivationFunction(), self._name(output)
        if function == tflite.ActivationFunctionType.RELU:
            self.graph.node("Relu", [result], name)
        elif function == tflite.ActivationFunctionType.RELU6:
            bounds = [self.graph.constant(f"{name}/{each}", np.float32(each)) for each in (0, 6)]
            self.graph.node("Clip", [result, *bounds], name)
        elif function != tflite.ActivationFunctionType.NONE:
            raise ValueError(f"the activation {function} is not known")

    def _name(self, tensor: int) -> str:
        return str(self.source.Tensors(tensor).Name().decode())

    def _shape(self, tensor: int) -> tuple[int, ...]:
        return tuple(int(side) for side in self.source.Tensors(tensor).ShapeAsNumpy())

    def _constant(self, tensor: int, values: Array) -> str:
        """The name of a constant of the model, added the first time it is used."""
        if tensor not in self.named:
            self.named.add(tensor)
            self.graph.constant(self._name(tensor), values)
        return self._name(tensor)

    def _value(self, tensor: int) -> Array:
        """The values of a constant, dense."""
        if tensor in self.values:
            return self.values[tensor]
        described = self.source.Tensors(tensor)
        buffer = self.model.Buffers(described.Buffer()).DataAsNumpy()
        values = np.frombuffer(buffer.tobytes(), TYPES[described.Type()])
        sparsity = described.Sparsity()
        return (
            values.reshape(self._shape(tensor))
            if sparsity is None
            else dense(values, sparsity, self._shape(tensor))
        )


def dense(values: Array, sparsity: tflite.SparsityParameters, shape: tuple[int, ...]) -> Array:
    """Return a sparse tensor with its zeros.

    Args:
        values: (n,) stored values.
        sparsity: Places of the values, dimension by dimension, each dense or compressed
            (TensorFlow Lite's schema, `SparsityParameters`).
        shape: Shape of the result.

    Returns:
        Array of `shape` and the dtype of `values`.
    """
    order, blocks = sparsity.TraversalOrderAsNumpy(), sparsity.BlockMapAsNumpy()
    blocks = np.zeros(0, int) if isinstance(blocks, int) else blocks
    at = np.zeros((1, 0), np.int64)
    for level in range(len(order)):
        dimension = sparsity.DimMetadata(level)
        if dimension.Format() == tflite.DimensionType.DENSE:
            count = np.full(len(at), dimension.DenseSize())
            along = np.tile(np.arange(dimension.DenseSize()), len(at))
        else:
            count, along = np.diff(_numbers(dimension, "ArraySegments")), _numbers(dimension, "ArrayIndices")
        at = np.column_stack([np.repeat(at, count, axis=0), along])
    places = np.zeros((len(at), len(shape)), np.int64)
    # Dimensions after the tensor's own count within blocks.
    sides = {int(axis): _block_side(sparsity, order, len(shape) + i) for i, axis in enumerate(blocks)}
    for level, dimension in enumerate(order):
        if dimension < len(shape):
            places[:, dimension] += at[:, level] * sides.get(int(dimension), 1)
        else:
            places[:, blocks[dimension - len(shape)]] += at[:, level]
    result = np.zeros(shape, values.dtype)
    result[tuple(places.T)] = values
    return result


def _block_side(sparsity: tflite.SparsityParameters, order: Array, dimension: int) -> int:
    level = int(np.flatnonzero(order == dimension)[0])
    return int(sparsity.DimMetadata(level).DenseSize())


def _numbers(dimension: tflite.DimensionMetadata, name: str) -> NDArray[np.int64]:
    """One of the two lists of a compressed dimension, whatever integers it is stored as."""
    kinds = {
        tflite.SparseIndexVector.Int32Vector: tflite.Int32Vector,
        tflite.SparseIndexVector.Uint16Vector: tflite.Uint16Vector,
        tflite.SparseIndexVector.Uint8Vector: tflite.Uint8Vector,
    }
    stored, vector = getattr(dimension, name)(), kinds[getattr(dimension, f"{name}Type")()]()
    vector.Init(stored.Bytes, stored.Pos)
    return np.asarray(vector.ValuesAsNumpy(), np.int64)


def convert(data: bytes) -> bytes:
    """Convert a model.

    Args:
        data: Content of a `.tflite` file.

    Returns:
        Content of an `.onnx` file, whose picture is (1, 3, h, w) and whose outputs are those of the model.

    Raises:
        ValueError: The model uses an operator or an activation that is not supported.
    """
    return bytes(Converter(data).convert().SerializeToString())

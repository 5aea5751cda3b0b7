"""A graph of ONNX, written node by node: what agents are exported as."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pneumarm.extras import extra
from pneumarm.networks.layers import Layers

OPSET = 17
_FORMAT = 8
"""Versions of operators and of the file that runtimes of the last years read."""


class Graph:
    """A graph in single precision; values are known by their names, the first dimension of all is the sample."""

    def __init__(self) -> None:
        """Begin an empty graph.

        Raises:
            UnusableInput: the library that writes it is not installed.

        """
        self._onnx = extra("onnx", "onnx", "an agent as ONNX")
        self._nodes: list[Any] = []
        self._constants: list[Any] = []
        self._inputs: list[Any] = []
        self._outputs: list[Any] = []

    def input(self, name: str, *shape: int) -> str:
        """Add an input (samples, *shape) of single precision."""
        self._inputs.append(self._info(name, self._onnx.TensorProto.FLOAT, shape))
        return name

    def output(self, value: str, name: str, *shape: int, whole: bool = False) -> None:
        """Let ``value`` (samples, *shape) be an output of this ``name``; ``whole`` numbers are of 64 bits."""
        kinds = self._onnx.TensorProto
        self._nodes.append(self._onnx.helper.make_node("Identity", [value], [name]))
        self._outputs.append(self._info(name, kinds.INT64 if whole else kinds.FLOAT, shape))

    def constant(self, value: ArrayLike, kind: Any = np.float32) -> str:
        """Return the name of a constant."""
        name = f"constant_{len(self._constants)}"
        array = np.array(value, kind, order="C")
        self._constants.append(self._onnx.numpy_helper.from_array(array, name))
        return name

    def node(self, kind: str, *inputs: str | ArrayLike, **attributes: Any) -> str:
        """Add a node of a ``kind`` and return the name of its only output; numbers become constants."""
        name = f"{kind.lower()}_{len(self._nodes)}"
        names = [one if isinstance(one, str) else self.constant(one) for one in inputs]
        self._nodes.append(self._onnx.helper.make_node(kind, names, [name], **attributes))
        return name

    def columns(self, value: str, places: Sequence[int]) -> str:
        """Return the columns of ``value`` (samples, n) at ``places``."""
        return self.node("Gather", value, self.constant(places, np.int64), axis=1)

    def reshaped(self, value: str, *shape: int) -> str:
        """Return ``value`` as (samples, *shape)."""
        return self.node("Reshape", value, self.constant((-1, *shape), np.int64))

    def joined(self, values: Sequence[str], axis: int = 1) -> str:
        """Return ``values`` one after the other."""
        return self.node("Concat", *values, axis=axis)

    def network(self, layers: Layers, inputs: str) -> str:
        """Return the outputs of a network with hyperbolic tangents between its ``layers``."""
        value = inputs
        for number, layer in enumerate(layers):
            value = self.node("Add", self.node("MatMul", value, layer[:-1]), layer[-1])
            if number < len(layers) - 1:
                value = self.node("Tanh", value)
        return value

    def model(self, name: str, words: str, notes: dict[str, str]) -> bytes:
        """Return the file's content; ``words`` say what it is, ``notes`` what its numbers mean."""
        helper = self._onnx.helper
        graph = helper.make_graph(
            self._nodes, name, self._inputs, self._outputs, initializer=self._constants, doc_string=words
        )
        model = helper.make_model(
            graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=_FORMAT, producer_name="pneumarm"
        )
        helper.set_model_props(model, notes)
        self._onnx.checker.check_model(model, full_check=True)
        content: bytes = model.SerializeToString()
        return content

    def _info(self, name: str, kind: int, shape: tuple[int, ...]) -> Any:
        return self._onnx.helper.make_tensor_value_info(name, kind, ["samples", *shape])

"""FCRN as an ONNX graph: ResNet-50, up-projections, one height per pixel (Laina et al., 3DV 2016).

It is the paper's tactile depth network (section 4.1). Batch normalisation is folded into the convolutions before it,
also through the interleaving of an up-projection, which does not mix channels.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import onnx
from onnx import helper, numpy_helper

from midastouch_common.files import atomic_path

from ..onnx_network import write_card
from .fcrn import BLOCKS, NORM, QUARTERS

_EPSILON = 1e-5  # of batch normalisation
_OPSET, _IR = 17, 8  # as old as the operators allow, for old ONNX Runtimes


class Graph:
    """Nodes and weights of the network under construction. Values are passed by name."""

    def __init__(self, state: dict[str, np.ndarray]):
        self._state = state
        self.nodes: list[onnx.NodeProto] = []
        self.weights: list[onnx.TensorProto] = []

    def add(self, operator: str, *inputs: str, output: str = "", **attributes: Any) -> str:
        """Add a node; return the name of its value."""
        output = output or f"{operator.lower()}_{len(self.nodes)}"
        self.nodes.append(helper.make_node(operator, list(inputs), [output], **attributes))
        return output

    def constant(self, name: str, values: np.ndarray) -> str:
        """Add float32 weights; return their name."""
        self.weights.append(numpy_helper.from_array(np.ascontiguousarray(values, np.float32), name))
        return name

    def convolution(self, x: str, name: str, norm: str, stride: int = 1, pads: tuple[int, ...] | None = None) -> str:
        """Add convolution `name` with the batch normalisation `norm` ("" for none); pads default to half the kernel."""
        kernel = self._state[f"{name}.weight"]
        bias = self._state.get(f"{name}.bias", np.zeros(len(kernel)))
        if norm:
            weight, shift, mean, variance = (self._state[f"{norm}.{part}"].astype(float) for part in NORM)
            scale = weight / np.sqrt(variance + _EPSILON)
            kernel, bias = kernel * scale.astype(np.float32)[:, None, None, None], (bias - mean) * scale + shift
        inputs = x, self.constant(f"{name}.weight", kernel), self.constant(f"{name}.bias", bias)
        half = kernel.shape[2] // 2
        return self.add("Conv", *inputs, strides=[stride, stride], pads=pads or [half] * 4)

    def bottleneck(self, x: str, name: str, stride: int, project: bool) -> str:
        """Add a residual bottleneck; the stride is that of its 3 x 3 convolution, as in torchvision's ResNet."""
        y = self.add("Relu", self.convolution(x, f"{name}.conv1", f"{name}.bn1"))
        y = self.add("Relu", self.convolution(y, f"{name}.conv2", f"{name}.bn2", stride))
        y = self.convolution(y, f"{name}.conv3", f"{name}.bn3")
        if project:
            x = self.convolution(x, f"{name}.downsample.0", f"{name}.downsample.1", stride)
        return self.add("Relu", self.add("Add", y, x))

    def up_projection(self, x: str, name: str) -> str:
        """Add an up-projection to twice the size and half the channels: a sum of two branches of four interleaved
        convolutions."""

        def interleaved(branch: int, norm: str) -> str:
            quarters = [
                self.convolution(x, f"{name}.conv{branch}_{k}", norm, pads=pads)
                for k, (_, pads) in enumerate(QUARTERS, 1)
            ]
            return self.add("DepthToSpace", self.add("Concat", *quarters, axis=1), blocksize=2, mode="DCR")

        y = self.add("Relu", interleaved(1, f"{name}.bn1_1"))
        y = self.convolution(y, f"{name}.conv3", f"{name}.bn1_2")
        return self.add("Relu", self.add("Add", y, interleaved(2, f"{name}.bn2")))

    def model(self, x: str, x_shape: tuple[int, ...], y: str, y_shape: tuple[int, ...]) -> onnx.ModelProto:
        """Return the graph from its input `x` to its output `y`, of these shapes after the batch."""
        x_info, y_info = (
            helper.make_tensor_value_info(name, onnx.TensorProto.FLOAT, ["batch", *shape])
            for name, shape in ((x, x_shape), (y, y_shape))
        )
        graph = helper.make_graph(self.nodes, "fcrn", [x_info], [y_info], self.weights)
        return helper.make_model(graph, opset_imports=[helper.make_opsetid("", _OPSET)], ir_version=_IR)


def fcrn_model(state: dict[str, np.ndarray]) -> onnx.ModelProto:
    """Return the network with the weights of a state dict, names and shapes as in `fcrn.expected_shapes`.

    Input "image" (N, 3, 320, 240) float32, normalised grey levels; output "height" (N, 1, 320, 240) float32.
    """
    graph = Graph(state)
    x = graph.add("Relu", graph.convolution("image", "conv1", "bn1", 2))
    x = graph.add("MaxPool", x, kernel_shape=[3, 3], strides=[2, 2], pads=[1, 1, 1, 1])
    for level, blocks in enumerate(BLOCKS, 1):
        for block in range(blocks):
            first = block == 0
            x = graph.bottleneck(x, f"layer{level}.{block}", 2 if first and level > 1 else 1, first)
    x = graph.convolution(x, "conv2", "bn2")
    for level in range(1, 5):
        x = graph.up_projection(x, f"up{level}")
    x = graph.add("Relu", graph.convolution(x, "conv3", ""))
    # the map is 160 x 128 here, because ten and eight coarse cells are not exactly 320 and 240 pixels
    scales = graph.constant("scales", np.array([1, 1, 2, 1.875]))
    graph.add("Resize", x, "", scales, output="height", mode="linear", coordinate_transformation_mode="half_pixel")
    return graph.model("image", (3, 320, 240), "height", (1, 320, 240))


def save_fcrn(state: dict[str, np.ndarray], card: dict, folder: Path) -> Path:
    """Write the network of a state dict and its model card to `folder`; return the network's file."""
    path = folder / f"{card['network']}.onnx"
    with atomic_path(path) as temporary:
        onnx.save(fcrn_model(state), temporary)
    write_card(card | {"architecture": "fcrn"}, path)
    return path

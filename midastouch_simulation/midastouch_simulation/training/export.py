"""Export of trained networks to ONNX files with model cards, and start of a training from such a file."""

from __future__ import annotations

import warnings
from pathlib import Path

import onnx
import torch
from onnx import numpy_helper
from torch import nn

from midastouch_common.errors import InputError
from midastouch_common.files import atomic_path
from midastouch_perception.onnx_network import write_card


def export_onnx(
    model: torch.nn.Module, inputs: dict[str, torch.Tensor], outputs: list[str], card: dict, path: Path
) -> Path:
    """Write `model` as ONNX with a free batch size, and its model card as JSON next to it; return `path`.

    The model is moved to the CPU. inputs: example tensors by name, in the order of `forward`. outputs: names of the
    tensors that the model returns.
    """
    with atomic_path(path) as temporary, warnings.catch_warnings():
        warnings.simplefilter("ignore", torch.jit.TracerWarning)  # that sizes become fixed numbers is wanted
        torch.onnx.export(
            model.cpu(),
            tuple(inputs.values()),
            str(temporary),
            input_names=list(inputs),
            output_names=outputs,
            dynamic_axes={name: {0: "batch"} for name in [*inputs, *outputs]},
            opset_version=17,
            dynamo=False,
        )
    write_card(card, path)
    return path


@torch.no_grad()
def unfold(model: nn.Module, path: str | Path, *batch: torch.Tensor) -> None:
    """Give `model` the weights of an ONNX export of the same architecture, so that both compute the same.

    The export has each normalisation folded into its convolution, so that the mean and variance are lost: they are
    measured again on `batch` (the model's inputs, on any device), and the normalisation's factors follow from them.
    Raises InputError if the convolutions or linear layers have other shapes.
    """
    graph = onnx.load(str(path)).graph
    values = {i.name: torch.from_numpy(numpy_helper.to_array(i).copy()) for i in graph.initializer}
    exported = [node.input for node in graph.node if node.op_type in ("Conv", "Gemm")]
    layers = [layer for layer in model.modules() if isinstance(layer, (nn.Conv2d, nn.Linear))]
    shapes = [(tuple(values[w].shape), tuple(values[b].shape)) for _, w, b in exported]
    if shapes != [(tuple(layer.weight.shape), tuple(layer.weight.shape[:1])) for layer in layers]:
        raise InputError(f"{path}: its layers are not those of the network to train; start from another one")
    device, bias = next(model.parameters()).device, []
    for layer, (_, weight, offset) in zip(layers, exported, strict=True):
        layer.weight.copy_(values[weight])
        bias.append(values[offset].to(device))
        if layer.bias is not None:
            layer.bias.copy_(values[offset])
    biases = dict(zip(layers, bias, strict=True))
    hooks = []
    for group in model.modules():
        if isinstance(group, nn.Sequential):
            for convolution, norm in zip(group, list(group)[1:], strict=False):
                if isinstance(norm, nn.BatchNorm2d):
                    hooks.append(norm.register_forward_pre_hook(_measure(biases[convolution])))
    model.eval()(*(part.to(device) for part in batch))
    for hook in hooks:
        hook.remove()


def _measure(bias: torch.Tensor):
    """Return a hook that sets a normalisation by its first input so that it only adds `bias`."""

    def hook(norm: nn.BatchNorm2d, inputs: tuple[torch.Tensor, ...]) -> None:
        norm.running_mean.copy_(inputs[0].mean(dim=(0, 2, 3)))
        norm.running_var.copy_(inputs[0].var(dim=(0, 2, 3)))
        norm.weight.copy_((norm.running_var + norm.eps).sqrt())
        norm.bias.copy_(norm.running_mean + bias)

    return hook

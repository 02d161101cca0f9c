"""Trained networks as ONNX files with their model cards."""

from __future__ import annotations

import json
from pathlib import Path

import torch

from midastouch_common.files import atomic_path


def export_onnx(
    model: torch.nn.Module, inputs: dict[str, torch.Tensor], outputs: list[str], card: dict, path: Path
) -> Path:
    """Write `model` as ONNX with a free batch size, and its model card as JSON beside it; returns `path`.

    inputs: example tensors by name, in the order of `forward`; outputs: names of what it returns.
    """
    with atomic_path(path) as temporary:
        torch.onnx.export(
            model,
            tuple(inputs.values()),
            str(temporary),
            input_names=list(inputs),
            output_names=outputs,
            dynamic_axes={name: {0: "batch"} for name in [*inputs, *outputs]},
            opset_version=17,
            dynamo=False,
        )
    with atomic_path(path.with_suffix(".json")) as temporary:
        temporary.write_text(json.dumps(card, indent=2) + "\n")
    return path

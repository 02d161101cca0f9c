"""Turn weights trained by the paper's authors into network files that this package runs."""

from __future__ import annotations

from pathlib import Path

from midastouch_common.errors import InputError
from midastouch_common.files import sha256

from .checkpoint import read_checkpoint
from .state_dict import matched, plain_names
from .tcn import minkloc3d_network
from .tcn.minkloc3d import save_minkloc3d
from .tdn import fcrn_shapes

EXPECTED_SHAPES = {
    "tdn_fcrn": fcrn_shapes.expected_shapes,
    "tcn_minkloc3d": minkloc3d_network.expected_shapes,
}


def import_weights(path: str | Path, out: str | Path, voxel_size: float = 1e-3) -> Path:
    """Write the network in a checkpoint, with its model card, to the folder `out`; returns the network's file.

    The names of its tensors tell which of the two networks it is. voxel_size: of MinkLoc3D, in units of the cloud
    scaled to [-1, 1] (0.001 in the official code). Raises InputError: not a checkpoint, of neither network, tensors
    missing, unexpected or of other shape.
    """
    path = Path(path)
    state = plain_names(read_checkpoint(path))
    shared = {name: len(state.keys() & shapes().keys()) for name, shapes in EXPECTED_SHAPES.items()}
    network = max(shared, key=shared.__getitem__)
    if not shared[network]:
        some = ", ".join(list(state)[:3]) or "none"
        raise InputError(
            f"{path}: holds neither the depth network (FCRN) nor the code network (MinkLoc3D); tensors: {some} ..."
        )
    state = matched(state, EXPECTED_SHAPES[network](), f"{path}: not the official {network}")
    card = {
        "network": network,
        "source": {"file": path.name, "sha256": sha256(path)},
        "parameters": sum(values.size for name, values in state.items() if "running" not in name),
        "licence": "that of the imported file",
        "command": f"midastouch import-weights {path.name}",
    }
    if network == "tcn_minkloc3d":
        return save_minkloc3d(state, card, Path(out), voxel_size)
    try:
        from .tdn.fcrn_graph import save_fcrn  # the only place that needs the package onnx
    except ImportError as error:
        raise InputError(f"{path}: writing this network needs the package onnx; pip install onnx") from error
    return save_fcrn(state, card, Path(out))

"""Conversion of weights trained by the paper's authors to network files that this package runs."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np

from midastouch_common.errors import InputError
from midastouch_common.files import require_file, sha256
from midastouch_common.missing_modules import install_extra, pip_install

from .arrays import read_npz
from .state_dict import matched, plain_names
from .tcn import minkloc3d_network
from .tcn.minkloc3d import save_minkloc3d
from .tdn import fcrn

EXPECTED_SHAPES = {"tdn_fcrn": fcrn.expected_shapes, "tcn_minkloc3d": minkloc3d_network.expected_shapes}
# keys under which training scripts store the state dict, if the file holds more than that
_STATE_KEYS = ("state_dict", "model_state_dict", "model")


def import_weights(path: str | Path, out: str | Path, voxel_size: float = 1e-3) -> Path:
    """Write the network in a checkpoint, with its model card, to the folder `out`; return the network's file.

    The names of its tensors show which of the two networks it is. voxel_size: of MinkLoc3D, in units of the cloud
    scaled to [-1, 1] (0.001 in the official code). Raises InputError if the file is no checkpoint, if its tensors are
    of neither network, missing, unexpected or of other shape, or if a package to read or write it is missing.
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
        from .tdn.fcrn_graph import save_fcrn  # only this needs the package onnx
    except ImportError as error:
        raise InputError(f"{path}: writing this network needs the package onnx: {pip_install('onnx')}") from error
    return save_fcrn(state, card, Path(out))


def read_checkpoint(path: str | Path) -> dict[str, np.ndarray]:
    """Return {name: values} of the tensors in a weight file, whose format is recognised by its content.

    A NumPy archive needs no other package. A PyTorch checkpoint needs torch, which reads tensors only (`weights_only`);
    .safetensors needs safetensors; both are in the `train` extra. Raises InputError if the file is missing, cut short,
    of none of the formats or not of tensors alone, or if a package is missing.
    """
    path = require_file(path, "weight")
    with path.open("rb") as stream:
        start = stream.read(9)
    if start.startswith(b"\x80") or (start.startswith(b"PK") and _is_torch_archive(path)):
        read = _read_torch
    elif start.startswith(b"PK"):
        read = read_npz
    elif start[8:] == b"{":
        read = _read_safetensors
    else:
        raise InputError(
            f"{path}: begins with {start!r}, not a PyTorch checkpoint, .safetensors or .npz; download it again"
        )
    try:
        return read(path)
    except InputError:
        raise
    except ModuleNotFoundError as error:
        raise InputError(
            f"{path}: reading this file needs the package {error.name}; {install_extra('train')}"
        ) from error
    except Exception as error:  # damaged bytes make torch's and NumPy's readers fail in any way
        reason = (str(error) or type(error).__name__).splitlines()[0]
        raise InputError(f"{path}: not a complete checkpoint of tensors alone ({reason}); get it again") from error


def _is_torch_archive(path: Path) -> bool:
    try:
        with zipfile.ZipFile(path) as archive:
            return any(name.endswith("/data.pkl") for name in archive.namelist())
    except (OSError, ValueError, zipfile.BadZipFile):
        return False  # cut short: the reader of NumPy archives reports that


def _read_safetensors(path: Path) -> dict[str, np.ndarray]:
    from safetensors.numpy import load_file

    return load_file(path)


def _read_torch(path: Path) -> dict[str, np.ndarray]:
    import torch

    content = torch.load(path, map_location="cpu", weights_only=True)
    if not isinstance(content, dict):
        raise InputError(f"{path}: holds a {type(content).__name__}, not a state dict; save model.state_dict()")
    for state in (content, *(content.get(key) for key in _STATE_KEYS)):
        if isinstance(state, dict):
            tensors = {str(name): values.detach() for name, values in state.items() if torch.is_tensor(values)}
            if tensors:  # NumPy has no bfloat16
                return {k: (v.float() if v.is_floating_point() else v).numpy() for k, v in tensors.items()}
    held = ", ".join(map(str, content)) or "nothing"
    raise InputError(f"{path}: holds no state dict, only {held}; save model.state_dict()")

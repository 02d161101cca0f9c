"""Loading of ONNX networks, shipped ones or your own, with their model cards."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np

from midastouch_common.errors import InputError
from midastouch_common.files import atomic_path, require_file, sha256

from .backends import CPU, load_backend

_LONGEST_CODE = 4096
_CHECKSUM = "sha256"  # in a card
WEIGHTS = Path(__file__).parent / "weights"


def network_path(kind: str, name_or_path: str | Path) -> Path:
    """Return the file of a network of a kind ("tdn", "tcn"): shipped, by name, or any, by path; InputError if none."""
    path = WEIGHTS / f"{kind}_{name_or_path}.onnx"
    if not path.is_file():
        path = Path(name_or_path)
        if path.suffix != ".onnx":
            known = ", ".join(sorted(p.stem.removeprefix(f"{kind}_") for p in WEIGHTS.glob(f"{kind}_*.onnx")))
            raise InputError(f"{kind} network '{name_or_path}' is not known; use {known} or the path of an .onnx")
        require_file(path, "network")
    return path


class OnnxNetwork:
    """Network in an ONNX file, run with at most `threads` threads and no more than there are cores.

    backend: as for `load_backend`. Attributes: network_id, "<file stem>-<first 12 digits of the content's SHA-256>";
    card, the model card (JSON next to the file); path; backend, the name of the one in use. Raises InputError: unknown
    name, no such file, not an ONNX network, damaged network, missing or broken card, unusable backend.
    """

    def __init__(self, kind: str, name_or_path: str | Path, threads: int = 1, backend: str = CPU):
        path = network_path(kind, name_or_path)
        self._backend = load_backend(path, threads, backend)
        self.backend = self._backend.name
        self.card, self.path = read_card(path), path
        self.network_id = network_id(path, self.card)

    def require_inputs(self, *names: str) -> None:
        """Raise InputError unless these are the network's inputs: depth and code networks are easily mixed up."""
        if tuple(self._backend.inputs) != names:
            raise InputError(
                f"{self.path}: a network of {', '.join(self._backend.inputs)}, not of {', '.join(names)}; "
                "are depth and code network mixed up?"
            )

    def run(self, *inputs: np.ndarray) -> np.ndarray:
        """Run the network on its inputs in their order, float32 with the batch first; return its first output."""
        return self._backend.run(dict(zip(self._backend.inputs, inputs, strict=True)), self._backend.outputs[0])


def network_id(path: Path, card: dict) -> str:
    """Return the id of a network by its content; InputError if that is not the content in its card."""
    digest = sha256(path)
    if card.get(_CHECKSUM, digest) != digest:
        raise InputError(f"{path}: damaged, or not the network of its model card {path.stem}.json; copy both again")
    return f"{path.stem}-{digest[:12]}"


def read_card(network: Path) -> dict:
    """Read the model card of a network's file. Raises InputError if it is missing or broken."""
    path = network.with_suffix(".json")
    try:
        card = json.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: no readable model card next to the network; copy it there") from error
    if not isinstance(card, dict):
        raise InputError(f"{path}: not a model card; copy the network's own there")
    return card


def code_settings(card: dict, network: Path) -> tuple[int, dict[str, float]]:
    """Return the length of the codes and the calibration of their score in the card of a code network.

    Raises InputError if they are missing or impossible.
    """
    try:
        dim, calibration = int(card["dim"]), dict(card["calibration"])
        temperature, outlier = float(calibration["temperature"]), float(calibration["outlier"])
        if not (0 < dim <= _LONGEST_CODE and 0 < temperature < math.inf and 0 < outlier < 1):
            raise ValueError(f"{dim}, {calibration}")
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise InputError(
            f"{network.with_suffix('.json')}: not the model card of a code network (dim, calibration: {error}); "
            "copy the network's own there"
        ) from error
    return dim, calibration


def write_card(card: dict, network: Path) -> None:
    """Write the model card of a network's file, which must be there, with its checksum."""
    card = card | {_CHECKSUM: sha256(network)}
    with atomic_path(network.with_suffix(".json")) as temporary:
        temporary.write_text(json.dumps(card, indent=2) + "\n")

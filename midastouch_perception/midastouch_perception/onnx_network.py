"""Loading of shipped or own ONNX networks with their model cards."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import onnxruntime

from midastouch_common.errors import InputError
from midastouch_common.files import atomic_path, sha256

WEIGHTS = Path(__file__).parent / "weights"


def network_path(kind: str, name_or_path: str | Path) -> Path:
    """The file of a shipped network ("tdn", "tcn") by name, or of another by path. InputError if there is none."""
    path = WEIGHTS / f"{kind}_{name_or_path}.onnx"
    if not path.is_file():
        path = Path(name_or_path)
        if path.suffix != ".onnx" or not path.is_file():
            known = ", ".join(sorted(p.stem.removeprefix(f"{kind}_") for p in WEIGHTS.glob(f"{kind}_*.onnx")))
            raise InputError(f"{kind} network '{name_or_path}' is not known; use {known} or the path of an .onnx")
    return path


class OnnxNetwork:
    """An ONNX file run by ONNX Runtime on the CPU, with at most `threads` threads and no more than there are cores.

    Attributes: network_id, "<file stem>-<first 12 digits of the content's SHA-256>"; card, the model card (JSON
    beside the file); outputs, their names. Raises InputError: unknown name, no such file, not an ONNX network,
    missing or broken card.
    """

    def __init__(self, kind: str, name_or_path: str | Path, threads: int = 1):
        path = network_path(kind, name_or_path)
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = min(threads, len(os.sched_getaffinity(0)))
        options.inter_op_num_threads = 1
        # threads that wait for work busily would take the cores from the rest of the pipeline
        options.add_session_config_entry("session.intra_op.allow_spinning", "0")
        options.log_severity_level = 3
        try:
            self.session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
        except Exception as error:  # ONNX Runtime's exceptions have no common base
            reason = str(error).splitlines()[0]
            raise InputError(f"{path}: not a usable ONNX network ({reason}); copy or export it again") from error
        self._options = onnxruntime.RunOptions()
        self._options.only_execute_path_to_fetches = True  # not the layers of other outputs too
        self._inputs = [i.name for i in self.session.get_inputs()]
        self.outputs = [o.name for o in self.session.get_outputs()]
        self.card, self._path = read_card(path), path
        self.network_id = f"{path.stem}-{sha256(path)[:12]}"

    def require_inputs(self, *names: str) -> None:
        """InputError unless the network takes these: depth and code networks are easily mixed up."""
        if tuple(self._inputs) != names:
            raise InputError(
                f"{self._path}: a network of {', '.join(self._inputs)}, not of {', '.join(names)}; "
                "are depth and code network mixed up?"
            )

    def run(self, *inputs: np.ndarray, output: str | None = None) -> np.ndarray:
        """The output of that name, by default the first, for the network's inputs in their
        declared order, float32 with the batch first."""
        names = [output or self.outputs[0]]
        return self.session.run(names, dict(zip(self._inputs, inputs, strict=True)), self._options)[0]


def read_card(network: Path) -> dict:
    """The model card of a network's file. Raises InputError if it is missing or broken."""
    path = network.with_suffix(".json")
    try:
        card = json.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: no readable model card beside the network; copy it there") from error
    if not isinstance(card, dict):
        raise InputError(f"{path}: not a model card; copy the network's own there")
    return card


def write_card(card: dict, network: Path) -> None:
    """Write the model card of a network's file."""
    with atomic_path(network.with_suffix(".json")) as temporary:
        temporary.write_text(json.dumps(card, indent=2) + "\n")

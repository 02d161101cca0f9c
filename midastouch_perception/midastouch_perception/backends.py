"""Backends of ONNX networks: ONNX Runtime on the CPU, or another library or device that is installed and faster.

A backend must give the same results as ONNX Runtime on the CPU, so reduced precision is turned off.
"""

from __future__ import annotations

import importlib.util
import os
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from statistics import median

import numpy as np
import onnxruntime

from midastouch_common.errors import InputError
from midastouch_common.missing_modules import pip_install

CPU, AUTO = "cpu", "auto"
_WARM_UP, _RUNS = 5, 15
_EQUAL = 1e-4  # of the largest number in a result: largest difference between backends
_PROVIDERS = {
    CPU: ("CPUExecutionProvider", {}),
    "cuda": ("CUDAExecutionProvider", {"use_tf32": "0"}),
    "tensorrt": ("TensorrtExecutionProvider", {"trt_fp16_enable": "0"}),
}
"""Execution providers of ONNX Runtime with their options, by backend."""
INSTALLED_BY = {
    "openvino": pip_install("openvino"),
    "cuda": f"{pip_install('onnxruntime-gpu')}, in place of onnxruntime, with CUDA and cuDNN",
    "tensorrt": f"{pip_install('onnxruntime-gpu')}, in place of onnxruntime, with TensorRT",
}
BACKENDS = (AUTO, CPU, *INSTALLED_BY)


class Backend(ABC):
    """Loaded network. Attributes: name, one of `BACKENDS`; inputs, their shapes by name, None for a free size; outputs,
    their names."""

    name: str
    inputs: dict[str, list[int | None]]
    outputs: list[str]

    @abstractmethod
    def run(self, inputs: Mapping[str, np.ndarray], output: str) -> np.ndarray:
        """Return the output of that name for inputs by name, float32 with the batch first."""


class OnnxRuntime(Backend):
    """ONNX Runtime, on the CPU or another device. Args: as for `load_backend`; name, a key of `_PROVIDERS`.

    Exceptions of ONNX Runtime, which have no common base, are passed on.
    """

    def __init__(self, path: Path, threads: int, name: str = CPU):
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads, options.inter_op_num_threads = threads, 1
        # threads that spin while they wait for work would take the cores from the rest of the pipeline
        options.add_session_config_entry("session.intra_op.allow_spinning", "0")
        options.log_severity_level = 3
        provider = _PROVIDERS[name]
        self._session = onnxruntime.InferenceSession(str(path), options, providers=[provider])
        if self._session.get_providers()[0] != provider[0]:  # it falls back to the CPU, and only logs that
            raise RuntimeError(f"{provider[0]} does not load; are its libraries installed?")
        self._options = onnxruntime.RunOptions()
        self._options.only_execute_path_to_fetches = True  # skip the layers of other outputs
        self.name = name
        self.inputs = {
            each.name: [size if isinstance(size, int) else None for size in each.shape]
            for each in self._session.get_inputs()
        }
        self.outputs = [each.name for each in self._session.get_outputs()]

    def run(self, inputs: Mapping[str, np.ndarray], output: str) -> np.ndarray:
        return self._session.run([output], dict(inputs), self._options)[0]


class OpenVino(Backend):
    """OpenVINO on the CPU, in single precision. Args: as for `load_backend`. Exceptions of OpenVINO are passed on."""

    name = "openvino"

    def __init__(self, path: Path, threads: int):
        import openvino

        settings = {
            "INFERENCE_NUM_THREADS": threads,
            "PERFORMANCE_HINT": "LATENCY",
            "INFERENCE_PRECISION_HINT": "f32",  # otherwise half precision on processors that are faster with it
        }
        self._model = openvino.Core().compile_model(str(path), "CPU", settings)
        self.inputs = {
            each.any_name: [None if size.is_dynamic else size.get_length() for size in each.partial_shape]
            for each in self._model.inputs
        }
        self.outputs = [each.any_name for each in self._model.outputs]

    def run(self, inputs: Mapping[str, np.ndarray], output: str) -> np.ndarray:
        return np.array(self._model(dict(inputs))[output])


def load_backend(path: Path, threads: int, name: str = CPU, clock: Callable[[], float] = time.perf_counter) -> Backend:
    """Load a network in an ONNX file for a backend, with at most `threads` threads and no more than one per core.

    AUTO takes the fastest installed backend with the same results, measured in a few runs by `clock` [s].
    Raises InputError: not an ONNX network, no such backend, or one that is not installed or does not load.
    """
    if name not in BACKENDS:
        raise InputError(f"backend '{name}': not known; there are {', '.join(BACKENDS)}")
    threads = min(threads, len(os.sched_getaffinity(0)))
    if name == CPU:
        return _on_cpu(path, threads)
    if name == AUTO:
        cpu = _on_cpu(path, threads)
        return _fastest(cpu, [made for make in installed().values() if (made := _made(make, path, threads))], clock)
    if (make := installed().get(name)) is None:
        raise InputError(f"backend '{name}': not installed; {INSTALLED_BY[name]}, or set it to {CPU}")
    try:
        return make(path, threads)
    except Exception as error:
        _on_cpu(path, threads)  # raises if the file is at fault, not the backend
        reason = str(error).splitlines()[0]
        raise InputError(f"backend '{name}': does not load ({reason}); mend that, or set it to {CPU}") from error


def _on_cpu(path: Path, threads: int) -> OnnxRuntime:
    try:
        return OnnxRuntime(path, threads)
    except Exception as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"{path}: not a usable ONNX network ({reason}); copy or export it again") from error


def installed() -> dict[str, Callable[[Path, int], Backend]]:
    """Return the installed backends other than the CPU: functions of a file and a number of threads, by name."""
    there = onnxruntime.get_available_providers()
    out = {name: partial(OnnxRuntime, name=name) for name in _PROVIDERS if _PROVIDERS[name][0] in there and name != CPU}
    return out | ({"openvino": OpenVino} if importlib.util.find_spec("openvino") else {})


def _made(make: Callable[[Path, int], Backend], path: Path, threads: int) -> Backend | None:
    try:
        return make(path, threads)
    except Exception:  # of any kind: a library without its device counts as not installed
        return None


def _fastest(cpu: Backend, others: list[Backend], clock: Callable[[], float]) -> Backend:
    """Return the fastest backend for a batch of one among those with the same results as the CPU."""
    rng = np.random.default_rng(0)
    inputs = {
        name: rng.standard_normal([size or 1 for size in shape]).astype(np.float32)
        for name, shape in cpu.inputs.items()
    }
    expected = cpu.run(inputs, cpu.outputs[0])
    alike = [cpu, *(each for each in others if _equal(each.run(inputs, cpu.outputs[0]), expected))]
    if len(alike) == 1:
        return cpu
    took: dict[str, list[float]] = {each.name: [] for each in alike}
    for _ in range(_WARM_UP + _RUNS):  # in turn, so that other load on the machine affects all of them
        for each in alike:
            before = clock()
            each.run(inputs, cpu.outputs[0])
            took[each.name].append(clock() - before)
    return min(alike, key=lambda each: median(took[each.name][_WARM_UP:]))


def _equal(found: np.ndarray, expected: np.ndarray) -> bool:
    return found.shape == expected.shape and bool(np.abs(found - expected).max() <= _EQUAL * np.abs(expected).max())

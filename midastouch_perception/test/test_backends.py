import itertools
import re

import numpy as np
import pytest

from midastouch_common.errors import InputError
from midastouch_perception import backends
from midastouch_perception.backends import AUTO, BACKENDS, CPU, INSTALLED_BY, Backend, load_backend
from midastouch_perception.onnx_network import WEIGHTS
from midastouch_perception.tdn import load_tdn

TDN = WEIGHTS / "tdn_fast.onnx"


class Made(Backend):
    """A backend that wraps the CPU's: by `off` beside its answers, each run lasting `seconds` of the clock."""

    def __init__(self, name, clock, seconds, off=0.0):
        self.name, self._clock, self._seconds, self._off = name, clock, seconds, off
        self._cpu = load_backend(TDN, 1)
        self.inputs, self.outputs = self._cpu.inputs, self._cpu.outputs

    def run(self, inputs, output):
        self._clock.now += self._seconds
        return self._cpu.run(inputs, output) + np.float32(self._off)


class Clock:
    now = 0.0

    def __call__(self) -> float:
        self.now += 1e-3  # the CPU's own run
        return self.now


@pytest.fixture
def with_others(monkeypatch):
    """Has others installed: their arguments by name."""

    def install(**others) -> Clock:
        clock = Clock()
        made = {name: lambda *_, name=name, given=given: Made(name, clock, *given) for name, given in others.items()}
        monkeypatch.setattr(backends, "installed", lambda: made)
        return clock

    return install


@pytest.mark.parametrize("name", [name for name in BACKENDS if name != AUTO])
def test_every_backend_that_is_here_answers_as_the_cpu_does(name):
    if name != CPU and name not in backends.installed():
        pytest.skip(f"not installed: {INSTALLED_BY[name]}")
    tdn, rng = load_tdn("fast", backend=name), np.random.default_rng(0)
    assert tdn.backend == name
    difference = 40 * rng.standard_normal((3, 160, 120, 3)).astype(np.float32)
    for some in (difference, difference[0]):
        np.testing.assert_allclose(tdn.penetration(some), load_tdn("fast").penetration(some), atol=1e-7)


def test_the_fastest_is_taken_that_answers_alike(with_others):
    clock = with_others(slow=(2.0,), fast=(0.0,), wrong=(-1e-3, 1.0))
    assert load_backend(TDN, 1, AUTO, clock).name == CPU, "all others last as long, or are wrong"
    clock = with_others(slow=(2.0,), fast=(-5e-4,), wrong=(-9e-4, 1.0))
    assert load_backend(TDN, 1, AUTO, clock).name == "fast"
    with_others()
    assert load_backend(TDN, 1, AUTO, lambda: pytest.fail("there is nothing to measure")).name == CPU


def test_what_cannot_be_loaded_is_as_if_it_were_not_there(monkeypatch, tmp_path):
    def broken(*_):
        raise RuntimeError("no such device")

    monkeypatch.setattr(backends, "installed", lambda: {"cuda": broken})
    assert load_backend(TDN, 1, AUTO).name == CPU
    with pytest.raises(InputError, match=r"'cuda': does not load \(no such device\).*set it to cpu"):
        load_backend(TDN, 1, "cuda")

    (tmp_path / "broken.onnx").write_bytes(b"no network")
    for name in (AUTO, CPU, "cuda"):
        with pytest.raises(InputError, match=r"broken\.onnx: not a usable ONNX network"):
            load_backend(tmp_path / "broken.onnx", 1, name)


def test_an_unusable_choice_is_refused_with_what_helps(monkeypatch):
    with pytest.raises(InputError, match=r"'gpu': not known; there are auto, cpu"):
        load_backend(TDN, 1, "gpu")
    monkeypatch.setattr(backends, "installed", dict)
    for name, how in INSTALLED_BY.items():
        with pytest.raises(InputError, match=f"'{name}': not installed; {re.escape(how)}"):
            load_backend(TDN, 1, name)


def test_no_more_threads_than_cores(monkeypatch):
    taken = []
    monkeypatch.setattr(backends, "OnnxRuntime", lambda path, threads: taken.append(threads))
    monkeypatch.setattr(backends.os, "sched_getaffinity", lambda _: set(itertools.islice(itertools.count(), 2)))
    load_backend(TDN, 8)
    load_backend(TDN, 1)
    assert taken == [2, 1]

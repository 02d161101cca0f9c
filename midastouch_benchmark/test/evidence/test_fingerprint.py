"""The fingerprint of the code as it is: stays when inputs differ as machines do, changes when an estimate does."""

import dataclasses
import json

import numpy as np
import pytest

from midastouch_benchmark.evidence import constants, fingerprint
from midastouch_benchmark.evidence.fingerprint import (
    ESTIMATES,
    PERCEPTION,
    REAL_GEL,
    RENEW,
    Part,
    differences,
    ids,
    read,
)
from midastouch_benchmark.evidence.probes import Probe
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.noise_model import NoiseModel
from midastouch_perception.tcn.inference import TactileCodeNet


@pytest.mark.slow
def test_the_committed_fingerprint_is_of_today_s_code():
    _, names = read()
    assert fingerprint.today() == names, f"estimates or constants have changed; run: {RENEW}, and commit the file"


def of(values: float, **constants: float) -> Part:
    return Part({"p": Probe(np.full((2, 1), values), [0.1])}, {name: [one] for name, one in constants.items()})


def test_names_of_constants_may_change_and_values_may_not():
    one = {PERCEPTION: of(1.0, A=1), ESTIMATES: of(2.0, B=1)}
    renamed = {PERCEPTION: of(1.05, A=1), ESTIMATES: of(2.05, C=1)}
    assert differences(one, renamed) == {PERCEPTION: [], ESTIMATES: []}
    changed = {PERCEPTION: of(1.0, A=1), ESTIMATES: of(2.0, B=1.5)}
    assert differences(one, changed) == {PERCEPTION: [], ESTIMATES: ["constant B"]}


def test_rounding_of_another_machine_is_no_other_constant():
    before = {"A": [4.5e-19, 0.333333341], "B": ["id", 9e-10]}
    assert not constants.changed(before, {"A": [0.333333311, -5.8e-19], "B": ["id", 9e-10]})
    assert constants.changed(before, {"A": [0.0, 0.33334], "B": ["other", 9e-10]}) == ["A", "B"]
    assert constants.changed(before, {"B": ["id", 9.1e-10]}) == ["B"]


def test_what_changes_the_perception_changes_the_estimates():
    one = {PERCEPTION: of(1.0), ESTIMATES: of(2.0)}
    assert differences(one, {PERCEPTION: of(1.4), ESTIMATES: of(2.0)}) == {
        PERCEPTION: ["probe 'p'"], ESTIMATES: ["probe 'p'"],
    }  # fmt: skip
    assert ids(one)[ESTIMATES] != ids(one | {PERCEPTION: of(1.4)})[ESTIMATES]


@pytest.mark.slow
def test_a_part_that_did_not_change_keeps_its_id(tmp_path, monkeypatch):
    path = tmp_path / "fingerprint.json"
    first = {PERCEPTION: of(1.0, A=1), ESTIMATES: of(2.0)}
    monkeypatch.setattr(fingerprint, "steady", lambda: first)
    fingerprint.write(path)
    before = read(path)[1]
    now = {PERCEPTION: of(1.05, A=1), ESTIMATES: of(3.0), REAL_GEL: of(4.0)}
    monkeypatch.setattr(fingerprint, "steady", lambda: now)
    monkeypatch.setattr(fingerprint, "measure", lambda seed=None: now)
    assert fingerprint.write(path) == {PERCEPTION: [], ESTIMATES: ["probe 'p'"], REAL_GEL: ["there was none"]}
    after = read(path)[1]
    assert after[PERCEPTION] == before[PERCEPTION]
    assert after[ESTIMATES] != before[ESTIMATES]
    assert json.loads(path.read_text())[PERCEPTION]["probes"]["p"]["values"] == [[1.0], [1.0]]


def test_what_is_made_of_real_gel_changes_no_estimate():
    one = {PERCEPTION: of(1.0), ESTIMATES: of(2.0), REAL_GEL: of(3.0)}
    assert differences(one, one | {REAL_GEL: of(3.4)}) == {PERCEPTION: [], ESTIMATES: [], REAL_GEL: ["probe 'p'"]}
    assert ids(one | {REAL_GEL: of(3.4)})[ESTIMATES] == ids(one)[ESTIMATES]


def test_a_difference_counts_that_every_run_has():
    one = {PERCEPTION: of(1.0), ESTIMATES: of(2.0)}
    off = {PERCEPTION: of(1.0), ESTIMATES: of(3.0)}
    assert differences(one, off, one)[ESTIMATES] == []
    assert differences(one, off, off)[ESTIMATES] == ["probe 'p'"]


@pytest.mark.slow
def test_other_inputs_in_the_sixth_digit_leave_it_as_it_is():
    committed, _ = read()
    runs = [fingerprint.measure(seed=seed) for seed in (1001, 1002)]
    assert not any(differences(committed, *runs).values())


def probes_changed(config: FilterConfig | None = None) -> list[str]:
    """By the probes alone, without the values of constants."""
    committed, _ = read()
    without = {name: dataclasses.replace(part, constants={}) for name, part in committed.items()}
    return differences(without, *(fingerprint.measure(config, seed) for seed in (None, 1001)))[ESTIMATES]


@pytest.mark.parametrize("changed", [{"keyframe_spacing": 0.0125}, {"converged_probability": 0.985}])
def test_every_default_is_compared_by_its_value(changed, monkeypatch):
    before = constants.of_filter()
    monkeypatch.setattr(constants, "FilterConfig", lambda: FilterConfig(**changed))
    assert set(changed) <= set(constants.changed(before, constants.of_filter()))


@pytest.mark.slow
@pytest.mark.parametrize("changed", [{"keyframe_spacing": 0.0125}, {"penetration_noise": 1.05e-4}])
def test_a_setting_that_changes_estimates_is_seen_by_the_probes(changed):
    assert probes_changed(FilterConfig(**changed))


@pytest.mark.slow
def test_a_number_deep_in_the_filter_is_seen_by_the_probes(monkeypatch):
    as_is = NoiseModel.of
    monkeypatch.setattr(NoiseModel, "of", classmethod(lambda _, c: dataclasses.replace(as_is(c), map_patches=2.8)))
    assert probes_changed()


@pytest.mark.slow
def test_other_weights_are_seen_by_the_probes(monkeypatch):
    as_is = TactileCodeNet.encode

    def encode(net, maps):
        codes = as_is(net, maps) * np.linspace(0.98, 1.02, net.dim, dtype=np.float32)
        return codes / np.linalg.norm(codes, axis=-1, keepdims=True)

    monkeypatch.setattr(TactileCodeNet, "encode", encode)
    fingerprint.scenes.cache_clear()
    try:
        assert "probe 'codes'" in probes_changed()
    finally:
        fingerprint.scenes.cache_clear()

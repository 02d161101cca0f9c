import numpy as np
import pytest

from midastouch_benchmark.evidence.constants import changed
from midastouch_benchmark.evidence.probes import Probe


@pytest.fixture
def probe() -> Probe:
    return Probe(np.array([[1.0, 10.0], [2.0, 20.0], [3.0, 30.0]]), [1e-3, 1e-2])


def test_what_differs_by_less_than_matters_agrees(probe):
    assert probe.agrees(Probe(probe.values + np.array([2.9e-3, 2.9e-2]), [0, 0]))
    assert not probe.agrees(Probe(probe.values + np.array([0, 3.1e-2]), [0, 0]))


def test_few_numbers_of_many_may_be_off():
    probe = Probe(np.zeros((10, 10)), [1e-3] * 10)
    off = np.zeros((10, 10))
    off[0, :2] = 1.0
    assert probe.agrees(Probe(off, [0] * 10))
    off[0, 2] = 1.0
    assert not probe.agrees(Probe(off, [0] * 10))


def test_another_shape_does_not_agree(probe):
    assert not probe.agrees(Probe(probe.values[:2], [0, 0]))
    assert not probe.agrees(Probe(probe.values[:, :1], [0]))


def test_a_steady_probe_ends_before_nudges_lead_elsewhere(probe):
    nudges = [Probe(probe.values + np.array([[0, 0], [5e-4, 0], [8e-3, 0]]), [0, 0]), probe]
    steady = probe.steadied(nudges)
    assert steady.values.tolist() == [[1, 10], [2, 20]]
    assert np.allclose(steady.tolerance, [[1e-3, 1e-2], [2e-3, 1e-2]])
    assert steady.agrees(Probe(probe.values + np.array([[0, 0], [1.9e-3, 0], [100, 100]]), [0, 0]))


def test_a_probe_survives_its_file(probe):
    back = Probe.from_json(probe.to_json())
    assert np.array_equal(back.values, probe.values)
    assert back.tolerance.tolist() == [[1e-3, 1e-2]] * 3


def test_constants_are_compared_by_the_names_that_both_have():
    assert changed({"A": [1], "B": [2], "GONE": [3]}, {"A": [1], "B": [2.5], "NEW": [4]}) == ["B"]
    assert changed({"A": [1], "B": [2, 3]}, {"A": [1, 5], "B": [2, 4]}) == ["B"]

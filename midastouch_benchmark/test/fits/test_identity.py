import numpy as np
import pytest

from midastouch_benchmark.fits.identity import NOISE, WeighedSlide, trials_of


def slide(code: list[list[float]], contradicted: list[list[float]], truth: int) -> WeighedSlide:
    """Keyframes, each a touch of its own."""
    return WeighedSlide(np.ones(len(code)), np.array(code), np.array(contradicted), truth)


def test_only_an_object_that_explains_touches_becomes_probable():
    own = slide([[3.0, 0.0]] * 20, [[0.0, 1.0]] * 20, 0)
    for one in (own, slide([[0.0, 0.0]] * 20, [[1.0, 1.0]] * 20, 2)):
        probabilities = one.probabilities(NOISE)
        assert probabilities.sum(axis=1) == pytest.approx(1.0)
        assert probabilities[-1].argmax() == one.truth
        assert one.surprise(NOISE) < np.log(3)


def test_an_object_without_a_hypothesis_keeps_its_evidence():
    probabilities = slide([[3.0], [0.0]], [[0.0], [0.0]], 0).probabilities(NOISE)
    np.testing.assert_array_equal(probabilities[0], probabilities[1])


@pytest.mark.parametrize("size", [1, 2])
def test_half_of_what_is_touched_is_known(size):
    trials = trials_of(size, ["a", "b", "c", "d"], ["part"])
    touched = sorted(name for _, name in trials)
    assert touched == sorted(2 * (["a", "b", "c", "d"] + ["part"] * (size == 1)))
    assert sum(name in known for known, name in trials) == len(trials) / 2

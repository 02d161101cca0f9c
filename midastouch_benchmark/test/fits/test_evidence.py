import dataclasses

import numpy as np
import pytest

from midastouch_benchmark.fits.evidence import (
    ALONE,
    DIAGONAL,
    FREE,
    NOISE,
    Judged,
    fitted,
    made_by_code,
    reliability,
    surprise,
)

TRUE = dataclasses.replace(NOISE, map_patches=1.0, residual_floor=0.05)


def drawn(count: int, rng: np.random.Generator) -> list[Judged]:
    """Comparisons of four hypotheses by six maps, of which one is right as often as the constants of `TRUE` say."""
    made = []
    for _ in range(count):
        each = Judged(np.exp(rng.uniform(-4, 0, (4, 6))), rng.uniform(0.2, 1.0, 6), np.zeros(4, bool))
        each.right[rng.choice(4, p=each.probabilities(TRUE))] = True
        made.append(each)
    return made


@pytest.fixture(scope="module")
def objects() -> list[list[Judged]]:
    rng = np.random.default_rng(0)
    return [drawn(100, rng) for _ in range(6)]


def test_constants_are_found_again(objects):
    assert fitted(ALONE, objects).residual_floor == NOISE.residual_floor
    found = fitted(FREE, objects)
    assert found.map_patches == pytest.approx(TRUE.map_patches, rel=0.3)
    assert surprise(objects, found) <= surprise(objects, TRUE) < surprise(objects, fitted(ALONE, objects))


def test_surer_and_less_sure_constants_surprise_more(objects):
    sure, unsure = (dataclasses.replace(TRUE, map_patches=factor * TRUE.map_patches) for factor in (2.0, 0.5))
    assert surprise(objects, TRUE) < min(surprise(objects, sure), surprise(objects, unsure))


def test_an_excluded_truth_surprises_by_so_much_and_no_more():
    excluded = Judged(np.array([[1e-3], [1.0]]), np.ones(1), np.array([False, True]))
    sure = dataclasses.replace(NOISE, map_patches=1e3)
    less_sure = dataclasses.replace(NOISE, map_patches=3.0, residual_floor=0.024)
    assert excluded.surprise(less_sure) == pytest.approx(3.0 * np.log(1.024 / 0.025), rel=1e-3)
    assert excluded.surprise(sure) == 20.0
    assert surprise([[excluded] * 9, [dataclasses.replace(excluded, right=~excluded.right)]], sure) == 10.0


def test_calibrated_probabilities_are_right_as_often_as_they_say(objects):
    lines = list(reliability(objects, TRUE))
    for line in lines:
        claims, holds, count = (float(each.split()[-1]) for each in line.replace(" of ", ", ").split(",")[-3:])
        assert abs(claims - holds) < 3.5 * np.sqrt(claims * (1 - claims) / count), line
    assert sum(int(line.split()[-1]) for line in lines) == 600


def test_objects_made_by_code_are_seeded_and_fit_a_hand():
    first, second = (list(made_by_code(3, 1, seed=5)) for _ in range(2))
    assert [mesh.name.partition("_")[0] for mesh in first] == ["part", "part", "part", "shape"]
    assert [mesh.sha256 for mesh in first] == [mesh.sha256 for mesh in second]
    assert all(DIAGONAL[0] <= mesh.diagonal <= DIAGONAL[1] for mesh in first)

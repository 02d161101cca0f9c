import numpy as np
import pytest

from midastouch_benchmark.trials import cache as module
from midastouch_benchmark.trials.cache import Cache, SlideKind
from midastouch_benchmark.trials.other_shapes import DIFFERENCES, OtherShapeCache, cut_off, dented, noisy, scaled
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.objects import bundled_objects
from midastouch_perception.sensor_model import SensorModel


@pytest.fixture(scope="module")
def eyebolt() -> ObjectMesh:
    return ObjectMesh.load(bundled_objects()["eyebolt"])


def distances(change, mesh: ObjectMesh) -> np.ndarray:
    """m, of points of the changed surface to the mesh."""
    changed = change(mesh, np.random.default_rng(1))
    points = changed.sample_surface(5000, np.random.default_rng(2))[0]
    return np.linalg.norm(points - mesh.closest_points(points)[0], axis=1)


def test_a_scaled_object_differs_by_three_percent_in_place(eyebolt):
    sizes = {round(scaled(eyebolt, np.random.default_rng(k)).diagonal / eyebolt.diagonal, 4) for k in range(8)}
    assert sizes == {1.03, round(1 / 1.03, 4)}
    assert scaled(eyebolt, np.random.default_rng(0)).bounds.mean(axis=0) == pytest.approx(eyebolt.bounds.mean(axis=0))


def test_only_what_sticks_out_farthest_is_missing(eyebolt):
    away = distances(cut_off, eyebolt)
    assert 0.8 < (away < 1e-4).mean() < 0.97
    changed = cut_off(eyebolt, np.random.default_rng(0))
    assert (changed.bounds[1] - changed.bounds[0]).max() < 0.97 * (eyebolt.bounds[1] - eyebolt.bounds[0]).max()


def test_a_dent_is_deep_and_small(eyebolt):
    away = distances(dented, eyebolt)
    assert (away < 1e-4).mean() > 0.5
    assert 1e-3 < away.max() < 3.1e-3


def test_a_noisy_scan_is_off_by_half_a_millimetre(eyebolt):
    assert np.sqrt(np.square(distances(noisy, eyebolt)).mean()) == pytest.approx(5e-4, rel=0.3)


def test_slides_over_changed_objects_are_kept_apart(eyebolt, tmp_path, monkeypatch):
    touched = {}

    def simulate(mesh, sensor, length, seed, out, progress, leap):
        touched[out] = mesh
        out.mkdir(parents=True)

    monkeypatch.setattr(module, "simulate_sequence", simulate)
    monkeypatch.setattr(module, "load_sequence", lambda path: path)
    paths = []
    for kind in (Cache, OtherShapeCache):
        cache = kind(tmp_path, slides=SlideKind(0.1))
        vars(cache)["networks"] = type("Networks", (), {"sensor": SensorModel.load("digit_tacto")})
        paths += [cache.slide(eyebolt, number) for number in range(len(DIFFERENCES))]
    assert len(set(paths)) == 2 * len(DIFFERENCES)
    same = [np.array_equal(touched[path].vertices, eyebolt.vertices) for path in paths]
    assert same == [True] * len(DIFFERENCES) + [False] * len(DIFFERENCES)

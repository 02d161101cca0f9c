"""The best matches of a penetration map among all poses of a book."""

import numpy as np
import pytest

from midastouch_benchmark.single_touch.matches import TOP, exhaustive_matches
from midastouch_common import se3
from midastouch_perception.rendering.contact_poses import ContactSampling, sample_contact_poses
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_model import SensorModel


@pytest.fixture(scope="module")
def sensor() -> SensorModel:
    return SensorModel.load("digit_tacto")


@pytest.fixture(scope="module")
def book(mesh, sensor) -> np.ndarray:
    """Poses (120, 4, 4) on the block: the first is on an end of its pin, as no other is."""
    on_pin = se3.make(se3.exp(np.r_[np.zeros(4), 0.1, 0.4])[:3, :3], np.array([0.025, 0.016, 0.0442]))
    others = sample_contact_poses(mesh, 400, np.random.default_rng(0), sensor, ContactSampling(free_fraction=0.0))
    away = np.linalg.norm(others[:, :3, 3] - on_pin[:3, 3], axis=1) > 0.02
    return np.concatenate([on_pin[None], others[away][:119]])


def matches(mesh, sensor, book, maps, seed=1):
    return exhaustive_matches(mesh, sensor, book, maps, np.random.default_rng(seed))


def test_the_measured_pose_is_among_the_matches(mesh, sensor, book):
    beside = book[:1] @ se3.exp(np.r_[1e-3, -5e-4, 2e-4, 0, 0, 0.05])
    maps = PenetrationRenderer(mesh, sensor.for_maps).render(beside)
    assert maps.max() > 3e-4
    counted = []
    found = exhaustive_matches(mesh, sensor, book, maps, np.random.default_rng(1), counted.append)
    assert found.shape == (1, TOP)
    assert len(set(found[0])) == TOP
    assert 0 in found[0]
    assert counted == [1]
    assert len(book) - 1 in matches(mesh, sensor, book[::-1], maps)[0]


def test_a_map_of_nothing_is_matched_by_chance(mesh, sensor, book):
    nothing = np.zeros((2, 160, 120), np.float32)
    first, second = (matches(mesh, sensor, book, nothing, seed) for seed in (1, 2))
    assert set(first[0]) != set(second[0])
    assert set(first[0]) != set(range(TOP))


def test_a_book_of_few_poses_matches_with_all_of_them(mesh, sensor, book):
    maps = PenetrationRenderer(mesh, sensor.for_maps).render(book[:1])
    assert sorted(matches(mesh, sensor, book[:3], maps)[0]) == [0, 1, 2]

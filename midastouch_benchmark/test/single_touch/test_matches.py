import numpy as np
import pytest

from midastouch_benchmark.single_touch.matches import (
    TOP,
    PoseErrors,
    SingleTouchErrors,
    best_matches,
    exhaustive_matches,
    mean_summary,
    single_touch_errors,
)
from midastouch_common import se3
from midastouch_perception.rendering.contact_poses import ContactSampling, sample_contact_poses
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_model import SensorModel


def pose(x: float, yaw: float = 0.0) -> np.ndarray:
    """At x [m], turned by yaw [rad] about z."""
    return se3.exp(np.array([0, 0, 0, 0, 0, yaw])) + np.array([[0, 0, 0, x], [0] * 4, [0] * 4, [0] * 4])


def unit(codes: np.ndarray) -> np.ndarray:
    return codes / np.linalg.norm(codes, axis=1, keepdims=True)


def random_codes(n: int, rng: np.random.Generator) -> np.ndarray:
    return unit(rng.standard_normal((n, 48))).astype(np.float32)


def test_the_summary_by_hand():
    """Two queries; alpha makes 1 rad worth 10 mm."""
    six = PoseErrors(np.array([0.002, 0.006]), np.array([0.01, 0.03]), np.array([0.06, 0.1]))
    geodesic = PoseErrors(np.array([0.001, 0.003]), np.array([0.01, 0.03]), np.array([0.03, 0.05]))
    summary = SingleTouchErrors(six, geodesic, np.array([0.001, 0.001])).summary()
    assert summary == pytest.approx(
        {
            "normalised_top25_error": 0.2,  # 4 mm / 20 mm
            "median": 0.2,
            "random_error": 0.02,
            "geodesic_normalised_top25_error": 0.1,
            "geodesic_median": 0.1,
            "nearest_entry": 0.05,
            "single_random_error": 0.08,
            "normalised_by_single_random": 0.05,
            "geodesic_normalised_by_single_random": 0.05,
        }
    )


def test_the_nearest_counts_by_position_and_alpha_times_rotation():
    book = np.stack([pose(0.010), pose(0.0, 0.3), pose(0.004, 0.3), pose(0.001)])
    matches = np.array([[0, 2, 1], [2, 0, 2]])
    errors = single_touch_errors(book, np.stack([pose(0), pose(0)]), matches, np.random.default_rng(0))
    assert errors.six_vector.best == pytest.approx([0.003, 0.005])
    assert errors.geodesic.best == pytest.approx([0.003, 0.005])
    assert errors.nearest == pytest.approx([0.001, 0.001])


def test_only_the_log_map_jumps_at_half_a_turn():
    book, query = pose(0, np.pi - 0.01)[None], pose(0, -np.pi + 0.01)[None]
    errors = single_touch_errors(book, query, np.zeros((1, 1), int), np.random.default_rng(0))
    assert errors.six_vector.best == pytest.approx([0.01 * (2 * np.pi - 0.02)])
    assert errors.geodesic.best == pytest.approx([0.01 * 0.02])


def test_the_random_error_is_the_expected_smallest_of_as_many():
    """Entries evenly over a line and queries at its end: n draws from (0, 1) have the smallest at 1 / (n + 1)."""
    book = np.stack([pose(x) for x in (np.arange(1000) + 0.5) / 1000])
    n = 4000
    errors = single_touch_errors(
        book, np.repeat(pose(0)[None], n, axis=0), np.zeros((n, TOP), int), np.random.default_rng(0)
    ).six_vector
    assert errors.random.mean() == pytest.approx(1 / (TOP + 1), rel=0.06)
    assert errors.single_random.mean() == pytest.approx(0.5, rel=0.04)


@pytest.mark.parametrize("queries", [1, 256, 600])
def test_the_best_matches_are_those_of_a_full_sort(queries):
    rng = np.random.default_rng(0)
    book, codes = random_codes(500, rng), random_codes(queries, rng)
    expected = np.argsort(-(codes @ book.T), axis=1)[:, :TOP]
    np.testing.assert_array_equal(np.sort(best_matches(book, codes), axis=1), np.sort(expected, axis=1))


def test_a_book_smaller_than_25_is_searched_whole():
    codes = random_codes(3, np.random.default_rng(0))
    assert np.sort(best_matches(codes, codes[:1])[0]).tolist() == [0, 1, 2]


def test_perfect_codes_score_what_the_nearest_entries_would(draw_contacts, codebook):
    rng = np.random.default_rng(0)
    queries, codes = draw_contacts(200, rng)
    summary = single_touch_errors(codebook.poses, queries, best_matches(codebook.codes, codes), rng).summary()
    assert summary["nearest_entry"] <= summary["normalised_top25_error"] < 1.3 * summary["nearest_entry"]
    assert summary["normalised_by_single_random"] < 0.5 * summary["normalised_top25_error"]


def test_codes_that_say_nothing_score_one(draw_contacts, codebook):
    rng = np.random.default_rng(0)
    queries, _ = draw_contacts(2000, rng)
    matches = best_matches(random_codes(len(codebook.poses), rng), random_codes(2000, rng))
    summary = single_touch_errors(codebook.poses, queries, matches, rng).summary()
    assert summary["normalised_top25_error"] == pytest.approx(1, abs=0.04)
    assert summary["geodesic_normalised_top25_error"] == pytest.approx(1, abs=0.04)
    assert 0.2 < summary["normalised_by_single_random"] < 0.5


def test_the_mean_over_objects_and_the_authors_median_of_medians():
    objects = [{"median": value, "normalised_top25_error": 2 * value} for value in (0.1, 0.2, 0.9)]
    assert mean_summary(objects) == pytest.approx(
        {"median": 0.4, "normalised_top25_error": 0.8, "median_of_medians": 0.2}
    )


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

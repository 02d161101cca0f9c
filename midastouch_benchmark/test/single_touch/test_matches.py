import numpy as np
import pytest

from midastouch_benchmark.single_touch.matches import (
    TOP,
    PoseErrors,
    SingleTouchErrors,
    best_matches,
    mean_summary,
    single_touch_errors,
)
from midastouch_common import se3


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


def test_the_nearest_of_the_matches_counts_by_position_and_alpha_times_rotation():
    book = np.stack([pose(0.010), pose(0.0, 0.3), pose(0.004, 0.3), pose(0.001)])
    matches = np.array([[0, 2, 1], [2, 0, 2]])
    errors = single_touch_errors(book, np.stack([pose(0), pose(0)]), matches, np.random.default_rng(0))
    assert errors.six_vector.best == pytest.approx([0.003, 0.005])
    assert errors.geodesic.best == pytest.approx([0.003, 0.005])
    assert errors.nearest == pytest.approx([0.001, 0.001])


def test_the_log_map_jumps_at_half_a_turn_and_the_geodesic_angle_does_not():
    book, query = pose(0, np.pi - 0.01)[None], pose(0, -np.pi + 0.01)[None]
    errors = single_touch_errors(book, query, np.zeros((1, 1), int), np.random.default_rng(0))
    assert errors.six_vector.best == pytest.approx([0.01 * (2 * np.pi - 0.02)])
    assert errors.geodesic.best == pytest.approx([0.01 * 0.02])


def test_the_random_error_is_the_expected_smallest_of_as_many_random_entries():
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


def test_a_query_in_the_book_has_no_error(codebook):
    matches = best_matches(codebook.codes, codebook.codes[:5])
    errors = single_touch_errors(codebook.poses, codebook.poses[:5], matches, np.random.default_rng(0))
    assert errors.six_vector.best == pytest.approx(np.zeros(5), abs=1e-9)
    assert errors.geodesic.best == pytest.approx(np.zeros(5), abs=1e-9)


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

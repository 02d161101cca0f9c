import numpy as np
import pytest

from midastouch_bringup.evaluation.single_touch import single_touch_errors


def test_codes_that_tell_the_pose_find_the_nearest_entries(draw_contacts, codebook):
    rng = np.random.default_rng(0)
    queries, codes = draw_contacts(60, rng)
    summary = single_touch_errors(codebook.poses, codebook.codes, queries, codes, rng).summary()
    assert summary["normalised_top25_error"] < 0.35
    assert summary["geodesic_normalised_top25_error"] < 0.35
    assert 0.02 < summary["random_error"] < 0.08  # metres, on an object of 100 mm


def test_codes_that_tell_nothing_are_as_good_as_the_best_of_25_random_touches(draw_contacts, codebook):
    rng = np.random.default_rng(0)
    queries, _ = draw_contacts(200, rng)
    noise = rng.standard_normal((200, 48)).astype(np.float32)
    noisy_book = rng.standard_normal(codebook.codes.shape).astype(np.float32)
    errors = single_touch_errors(codebook.poses, noisy_book, queries, noise, rng)
    assert errors.summary()["normalised_top25_error"] > 0.3


def test_a_query_in_the_book_has_no_error(codebook):
    rng = np.random.default_rng(0)
    errors = single_touch_errors(codebook.poses, codebook.codes, codebook.poses[:5], codebook.codes[:5], rng)
    assert errors.best == pytest.approx(np.zeros(5), abs=1e-9)
    assert errors.geodesic_best == pytest.approx(np.zeros(5), abs=1e-9)


def test_a_book_smaller_than_25_is_searched_whole(codebook):
    rng = np.random.default_rng(0)
    errors = single_touch_errors(codebook.poses[:3], codebook.codes[:3], codebook.poses[3:4], codebook.codes[3:4], rng)
    assert np.isfinite(errors.best).all()

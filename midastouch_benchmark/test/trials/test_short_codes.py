import numpy as np
import pytest

from midastouch_benchmark.trials.short_codes import ShortCodes
from midastouch_benchmark.trials.trial import TrialFrame
from midastouch_filter.core.touch import Measurement
from midastouch_perception.codebook import Codebook


@pytest.fixture
def codes() -> np.ndarray:
    """500 unit codes of 12 numbers of which only 3 directions, hidden by a turn, hold anything."""
    rng = np.random.default_rng(0)
    flat = rng.standard_normal((500, 3)) @ np.linalg.qr(rng.standard_normal((12, 12)))[0][:3]
    return flat / np.linalg.norm(flat, axis=1, keepdims=True)


def test_cosines_stay_where_nothing_is_lost(codes):
    short = ShortCodes(codes, 3).shorten(codes)
    assert short.shape == (500, 3)
    np.testing.assert_allclose(short @ short.T, codes @ codes.T, atol=1e-5)


def test_what_is_lost_is_the_least(codes):
    rng = np.random.default_rng(1)
    noisy = codes + 1e-3 * rng.standard_normal(codes.shape)
    kept = ShortCodes(noisy, 3).shorten(noisy)
    np.testing.assert_allclose(kept @ kept.T, codes @ codes.T, atol=0.02)
    two = ShortCodes(noisy, 2).shorten(noisy)
    assert np.linalg.norm(two, axis=1) == pytest.approx(1, abs=1e-5)
    assert np.abs(two @ two.T - codes @ codes.T).max() > 0.5


def test_book_and_touch_are_cut_alike(codes):
    short = ShortCodes(codes, 3)
    book = short.codebook(Codebook(np.repeat(np.eye(4)[None], 500, axis=0), codes, {"tcn": "t"}))
    frame = TrialFrame(4, Measurement(True, codes[7].astype(np.float32), 1e-4, "t"), {}, np.eye(4), np.eye(4))
    cut = short.frame(frame)
    np.testing.assert_allclose(book.codes[7], cut.felt.code, atol=1e-6)
    assert (book.meta, cut.index, cut.felt.network_id) == ({"tcn": "t"}, 4, "t")


def test_a_frame_without_contact_stays_as_it_is(codes):
    frame = TrialFrame(0, Measurement(False), {}, np.eye(4), np.eye(4))
    assert ShortCodes(codes, 3).frame(frame).felt is frame.felt

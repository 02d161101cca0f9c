"""Damaged frames are refused, with the fix; frames at rest and of a simulator without noise are not."""

import numpy as np
import pytest

from midastouch_perception.tdn.frame_guard import FrameGuard

REPEATS = 100


def gel(rng: np.random.Generator, noise: float = 2.0, touched: int = 0) -> np.ndarray:
    """An image (320, 240, 3) of gel with a soft contact whose middle is so many rows down; 0 for none."""
    y, x = np.mgrid[0:320, 0:240]
    bump = np.exp(-((x - 120) ** 2 + (y - touched) ** 2) / 800) * (touched > 0)
    image = np.stack([110 + 40 * bump * (x - 120) / 20, 100 + 40 * bump * (y - touched) / 20, 90 - 30 * bump], axis=-1)
    return np.clip(np.rint(image + rng.normal(0, noise, image.shape)), 0, 255).astype(np.uint8)


def test_a_torn_frame_is_refused_and_the_next_is_not():
    rng, guard = np.random.default_rng(0), FrameGuard()
    assert [guard.refusal(gel(rng, touched=row)) for row in (120, 126)] == [None, None]
    torn = gel(rng, touched=132)
    torn[130:] = gel(rng, touched=150)[130:]
    refused = guard.refusal(torn)
    assert refused.kind == "torn_images"
    assert "USB port" in refused.reason
    assert guard.refusal(gel(rng, touched=156)) is None


def test_a_camera_that_repeats_an_image_is_refused_until_it_goes_on():
    rng, guard = np.random.default_rng(0), FrameGuard()
    assert guard.refusal(gel(rng)) is None
    still = gel(rng)
    refused = [guard.refusal(still.copy()) for _ in range(REPEATS)]
    assert refused[0] is refused[30] is None, "a camera may repeat some images"
    assert refused[-1].kind == "frozen_images"
    assert "plug it in again" in refused[-1].reason
    assert guard.refusal(gel(rng)) is None


@pytest.mark.parametrize("row", [0, 130])
def test_a_simulator_without_noise_may_rest(row):
    rng, guard = np.random.default_rng(0), FrameGuard()
    assert guard.refusal(gel(rng, 0.0)) is None
    assert {guard.refusal(gel(rng, 0.0, row)) for _ in range(REPEATS)} == {None}

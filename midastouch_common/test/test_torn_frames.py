"""Frames of two halves are told from whole ones, whatever moves in them."""

import cv2
import numpy as np
import pytest

from midastouch_common.torn_frames import TornFrames, single_seam

HEIGHT, WIDTH = 320, 240


class Stream:
    """A round contact that slides over noisy gel."""

    def __init__(self, seed: int = 0, noise: float = 1.5):
        self._rng, self._noise = np.random.default_rng(seed), noise
        y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
        self._y, self._x = y, x
        self._gel = np.stack([90 + 0.1 * x, 120 - 0.1 * x, 80 + 0.1 * y], axis=-1)

    def frame(self, step: int, light: float = 1.0) -> np.ndarray:
        """The contact after so many steps."""
        right, down = (self._x - 60 - 8 * step) / 45, (self._y - 100 - 7 * step) / 45
        bump = np.exp(-4 * (right**2 + down**2))
        image = light * self._gel + 200 * np.stack([bump * right, bump * down, -bump * right], axis=-1)
        return np.clip(np.rint(image + self._rng.normal(0, self._noise, image.shape)), 0, 255).astype(np.uint8)


def torn(above: np.ndarray, below: np.ndarray, line: int, axis: int) -> np.ndarray:
    """The lines before one of the first, the others of the second."""
    out = above.copy()
    out[(slice(None),) * axis + (slice(line, None),)] = below[(slice(None),) * axis + (slice(line, None),)]
    return out


@pytest.mark.parametrize("axis", [0, 1], ids=["rows", "columns"])
def test_every_torn_frame_is_found_and_no_other(axis):
    """All seams cross the contact; a driver may have turned the rows into columns."""
    for seed in range(6):
        stream, frames = Stream(seed), TornFrames()
        whole = [stream.frame(step) for step in range(12)]
        assert not any(frames.torn(each) for each in whole[:6])
        line = (60 + 8 * 6, 100 + 7 * 6)[axis == 0] + 4 * (seed - 3)
        assert frames.torn(torn(whole[6], whole[7], line, axis)), seed
        assert not any(frames.torn(each) for each in whole[7:])


def test_light_that_jumps_is_no_seam_but_half_of_a_jump_is():
    stream, frames = Stream(), TornFrames()
    dark, bright = stream.frame(0), stream.frame(0, light=1.1)
    assert [frames.torn(each) for each in (dark, bright, dark)] == [False] * 3
    assert frames.torn(torn(bright, dark, 211, 0))


def test_a_frame_that_comes_twice_is_judged_alike():
    stream, frames = Stream(), TornFrames()
    first, second, third = (stream.frame(step) for step in range(3))
    halves = torn(second, third, 120, 0)
    found = [frames.torn(each) for each in (first, first, halves, halves.copy(), third)]
    assert found == [False, False, True, True, False]


def test_an_image_that_stays_is_no_torn_frame():
    """A simulator without noise at rest, after an edge that looked like a seam."""
    stream, frames = Stream(), TornFrames()
    halves = torn(stream.frame(1), stream.frame(2), 120, 0)
    found = [frames.torn(each) for each in (stream.frame(0), *[halves] * 10)]
    assert found[1]
    assert not any(found[5:])


def test_torn_frames_in_a_row_are_all_found():
    stream, frames = Stream(), TornFrames()
    whole = [stream.frame(step) for step in range(8)]
    assert not frames.torn(whole[0])
    lines = 110, 125, 140
    assert [frames.torn(torn(whole[k], whole[k + 1], line, 0)) for k, line in enumerate(lines, 1)] == [True] * 3
    assert not frames.torn(whole[5])


def test_a_straight_edge_that_comes_into_view_is_no_seam():
    """Blurred by one pixel, as the sharpest optics do, along a row or a column."""
    for axis in (0, 1):
        stream, frames = Stream(), TornFrames()
        assert not frames.torn(stream.frame(0))
        for line in range(100, 108):
            edge = stream.frame(0).astype(np.float32)
            edge[(slice(None),) * axis + (slice(line, line + 40),)] += 40
            assert not frames.torn(np.rint(cv2.GaussianBlur(edge, (0, 0), 1.0)).astype(np.uint8)), (axis, line)


def test_a_drawn_rectangle_is_no_seam():
    """Images of tests and of simple simulators have such edges."""
    stream, frames = Stream(), TornFrames()
    for noise in (stream.frame(0), np.full((HEIGHT, WIDTH, 3), 100, np.uint8)):
        for row in (60, 60, 100):
            drawn = noise.copy()
            drawn[row : row + 40, 100:140, 0] += np.arange(10, 50, dtype=np.uint8)[:, None]
            assert not frames.torn(noise)
            assert not frames.torn(drawn)


@pytest.mark.parametrize("quality", [60, 75, 90])
def test_blocks_of_a_codec_are_no_seams(quality):
    """Seen through JPEG; torn before."""
    found = 0
    for seed in range(3):
        stream, frames = Stream(seed), TornFrames()

        def coded(image):
            return cv2.imdecode(cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])[1], cv2.IMREAD_COLOR)

        whole = [coded(stream.frame(step)) for step in range(8)]
        assert not any(frames.torn(each) for each in whole)
        found += frames.torn(torn(whole[6], stream.frame(10), 157, 0))
    assert found == 3


def test_a_frame_of_another_size_begins_again():
    frames = TornFrames()
    assert not frames.torn(Stream().frame(0))
    assert not frames.torn(Stream().frame(1)[:-7, :-9])
    assert not frames.torn(Stream(1).frame(0)[:-7, :-9])


def test_the_first_frames_and_single_colours_are_whole():
    frames = TornFrames()
    for level in (0, 255, 100):
        assert not frames.torn(np.full((HEIGHT, WIDTH, 3), level, np.uint8))


def test_where_opposite_sides_of_a_rolled_image_meet_there_is_a_seam():
    for step in range(3):
        image = Stream().frame(step)
        assert single_seam(image) is None
        assert single_seam(np.roll(image, 80, axis=1)) == (1, 80)
        assert single_seam(np.roll(image, -20, axis=1)) == (1, 220)
        assert single_seam(np.roll(image, 100, axis=0)) == (0, 100)

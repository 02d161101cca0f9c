"""A background from images: the first ones, or those that `capture_background` takes and keeps for each sensor."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from perception_fakes import BACKGROUND, touched
from std_srvs.srv import Trigger
from tdn_rig import Feed, start

pytestmark = pytest.mark.dds
DIMMED = BACKGROUND - 20
SERIAL = "D20001"


def capture(graph, feed: Feed, *frames: np.ndarray) -> Trigger.Response:
    """Call the service while images come, one at a time, again and again."""
    answer = graph.request(Trigger, "capture_background", Trigger.Request())
    again = itertools.cycle(frames)
    while not answer.done():
        feed.touches(next(again))
    return answer.result()


def test_background_is_estimated_from_the_first_images(graph, depth):
    start(graph, depth, background_frames=4)
    feed = Feed(graph)
    assert [feed.touches(pixels) for pixels in [BACKGROUND] * 4 + [touched(60)]] == [False] * 4 + [True]


def test_only_a_still_and_free_gel_is_captured(graph, depth, background):
    start(graph, depth, background=background, background_frames=5)
    feed = Feed(graph)
    for frames, said in (([touched(20 * i) for i in range(12)], "not still"), ([touched(60)], "lift the finger")):
        refused = capture(graph, feed, *frames)
        assert not refused.success
        assert said in refused.message
    assert capture(graph, feed, DIMMED).success
    assert feed.touches(BACKGROUND), "what was captured is now the background"


def test_capture_without_images_gives_up(graph, depth, background):
    start(graph, depth, background=background, capture_timeout=0.2)
    response = graph.call(Trigger, "capture_background", Trigger.Request())
    assert not response.success
    assert "0 of 32 images came within 0.2 s; no node publishes it" in response.message


def test_it_is_used_again_by_the_next_node_of_that_sensor(graph, depth, tmp_path):
    start(graph, depth, background_frames=5, serial=SERIAL, background_folder=str(tmp_path))
    answer = capture(graph, Feed(graph), DIMMED)
    assert (answer.success, answer.message) == (True, f"kept in {tmp_path}/{SERIAL}.png")
    for serial in (SERIAL, "D20002"):  # the other one's first image is its background
        graph.remove_all()
        start(graph, depth, serial=serial, background_folder=str(tmp_path))
        assert Feed(graph).touches(BACKGROUND) == (serial == SERIAL)


def test_what_cannot_be_kept_is_used_all_the_same(graph, depth, tmp_path):
    (tmp_path / "file").touch()
    start(graph, depth, background_frames=5, serial=SERIAL, background_folder=str(tmp_path / "file"))
    feed = Feed(graph)
    answer = capture(graph, feed, DIMMED)
    assert answer.success
    assert "in use, but" in answer.message
    assert feed.touches(BACKGROUND)

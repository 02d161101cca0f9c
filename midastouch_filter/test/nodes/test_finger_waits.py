"""How long a frame waits for what a further finger measured: arithmetic of stamps, without DDS."""

from __future__ import annotations

import types

import numpy as np
import pytest
from filter_fakes import code_msg

from midastouch_common.transforms.queue import Wait
from midastouch_filter.nodes.finger_topics import FingerTopics

MS = 1_000_000
PARAMETERS = {
    "fingers": "/right:right_gel",
    "base_frame_id": "base_link",
    "sensor_frame_id": "digit_gel_frame",
    "gripper_frame_id": "",
    "queue_depth": 1,
    "reliable": False,
    "input_timeout": 2.0,
}


class World:
    """One further finger, whose transform is known up to a stamp [ns], and a clock that the test moves."""

    def __init__(self):
        self.placed, self.now, callbacks = 0, 0.0, []
        node = types.SimpleNamespace(create_subscription=lambda kind, topic, callback, qos: callbacks.append(callback))

        def lookup(base: str, frame: str, stamp: int) -> np.ndarray | Wait:
            return np.eye(4) if stamp <= self.placed else Wait("not yet")

        self.bad: list[str] = []
        self.fingers = FingerTopics(
            node, PARAMETERS, False, lookup, lambda: self.now, lambda: None, lambda kind, _: self.bad.append(kind)
        )
        (self._on_code,) = callbacks

    def measure(self, stamp: int) -> None:
        self._on_code(code_msg(stamp))

    def awaited(self, stamp: int, waited: float = 0.0) -> bool:
        return self.fingers.awaited(stamp, waited)


@pytest.fixture
def world() -> World:
    return World()


def test_a_pose_that_never_comes_holds_up_one_frame_only(world):
    world.measure(100 * MS)
    assert world.awaited(100 * MS)
    assert not world.awaited(100 * MS, waited=0.3)
    for stamp in (133 * MS, 166 * MS):
        world.measure(stamp)
        assert not world.awaited(stamp)


def test_a_pose_that_came_in_the_end_is_waited_for_again(world):
    world.measure(100 * MS)
    world.awaited(100 * MS, waited=0.3)
    world.measure(133 * MS)
    world.placed = 110 * MS
    assert world.awaited(133 * MS)
    world.placed = 140 * MS
    assert not world.awaited(133 * MS)


def test_time_that_runs_back_forgets_what_was_waited_for_in_vain(world):
    world.measure(100 * MS)
    world.awaited(100 * MS, waited=0.3)
    world.fingers.clear()
    world.measure(33 * MS)
    assert world.awaited(33 * MS)


def test_silence_counts_from_when_time_ran_back(world):
    """Simulated time: a finger that dies while a bag runs is still missed when the bag has begun again."""
    world.now = 300.0
    world.measure(300_000 * MS)
    world.now = 0.0
    world.fingers.clear()
    world.fingers.take(33 * MS, np.eye(4), None)
    world.now = 2.5
    assert world.fingers.qualify("as told") == "as told; without /right"
    assert world.bad == ["silent_fingers"]

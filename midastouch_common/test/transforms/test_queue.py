from __future__ import annotations

import numpy as np
import pytest

from midastouch_common.transforms import queue
from midastouch_common.transforms.queue import TransformQueue, Wait
from midastouch_common.transforms.rigid import TransformError


class World:
    """Transforms known up to a stamp, and a clock that the test moves."""

    def __init__(self, timeout: float = 1.0):
        self.now, self.known, self.forgotten = 0.0, 0, 0
        self.held: set[str] = set()
        self.waits: dict[str, float] = {}
        self.queue = TransformQueue(self.lookup, self.hold, lambda: self.now, lambda: timeout, lambda: self.now)

    def hold(self, stamp: int, payload: str, waited: float) -> bool:
        self.waits[payload] = waited
        return payload in self.held

    def lookup(self, stamp: int):
        if stamp < self.forgotten:
            raise TransformError("before the history")
        return np.eye(4) * stamp if stamp <= self.known else Wait(f"newest is {self.known}")

    def unreported(self) -> tuple[int, str] | None:
        self.popped()
        waiting = self.queue.unreported()
        return waiting and (waiting.stamp, waiting.reason)

    def popped(self) -> list:
        out = []
        while (ready := self.queue.pop()) is not None:
            out.append(ready)
        return out


def test_items_wait_for_their_transform_and_leave_in_order():
    world = World()
    for stamp in (1, 2, 3):
        world.queue.push(stamp, f"item {stamp}")
    assert world.popped() == []
    world.known = 2
    ready = world.popped()
    assert [(r.stamp, r.payload) for r in ready] == [(1, "item 1"), (2, "item 2")]
    np.testing.assert_array_equal(ready[1].transform, np.eye(4) * 2)
    assert len(world.queue) == 1


def test_each_item_has_its_own_time_out():
    world = World(timeout=1.0)
    world.queue.push(1, "early")
    world.now = 0.6
    world.queue.push(2, "late")
    world.now = 1.1
    (given_up,) = world.popped()
    assert (given_up.stamp, given_up.transform) == (1, None)
    assert "newest is 0" in given_up.reason
    assert "1.1 s" in given_up.reason
    world.known = 2
    assert world.popped()[0].transform is not None


def test_no_hope_is_given_up_at_once():
    world = World()
    world.forgotten = 5
    world.queue.push(4, "too old")
    (given_up,) = world.popped()
    assert given_up.transform is None
    assert given_up.reason == "before the history"


def test_a_clock_that_stands_still_does_not_fill_the_memory(monkeypatch):
    monkeypatch.setattr(queue, "MOST_WAITING", 3)
    world = World()
    for stamp in range(1, 6):
        world.queue.push(stamp, f"item {stamp}")
    given_up = world.popped()
    assert [(r.stamp, r.transform) for r in given_up] == [(1, None), (2, None)]
    assert len(world.queue) == 3


def test_clear_forgets_what_waits():
    world = World()
    world.queue.push(1, "x")
    world.now = 0.9
    assert world.unreported() == (1, "no transform yet: newest is 0")
    assert world.queue.clear() == [1]
    world.known = 1
    assert world.popped() == []
    assert world.unreported() is None
    world.known = 0
    world.queue.push(1, "the same again")
    world.now = 1.5
    assert world.unreported() == (1, "no transform yet: newest is 0")


def test_a_long_wait_is_reported_once_per_item():
    world = World(timeout=10.0)
    world.queue.push(1, "item 1")
    world.now = 0.01
    assert world.unreported() is None, "live, most transforms come within milliseconds"
    world.now = 0.06
    assert world.unreported() == (1, "no transform yet: newest is 0")
    assert world.unreported() is None
    world.queue.push(2, "item 2")
    world.queue.push(3, "item 3")
    assert world.unreported() == (3, "no transform yet: newest is 0"), "at once: the first has waited for long"
    assert world.unreported() is None
    world.known = 2
    assert len(world.popped()) == 2
    assert world.unreported() is None, "of this one it was said"
    world.known = 3
    world.popped()
    assert world.unreported() is None
    world.held.add("item 4")
    world.queue.push(4, "item 4")
    world.now = 1.0
    stamp, reason = world.unreported()
    assert stamp == 4
    assert "still to come" in reason


def test_what_is_held_neither_leaves_nor_times_out():
    world = World(timeout=1.0)
    world.known, world.now = 2, 0.0
    world.held.add("first")
    world.queue.push(1, "first")
    world.queue.push(2, "second")
    world.now = 5.0
    assert world.popped() == [], "and the second keeps its place behind it"
    world.held.clear()
    assert [r.payload for r in world.popped()] == ["first", "second"]


def test_the_wait_counts_from_when_an_item_was_put_in():
    """Behind one that is held, the second has waited too when its turn comes."""
    world = World()
    world.known = 2
    world.held.add("first")
    world.queue.push(1, "first")
    world.now = 0.1
    world.queue.push(2, "second")
    world.now = 0.3
    world.popped()
    world.held.clear()
    world.popped()
    assert world.waits == {"first": 0.3, "second": pytest.approx(0.2)}

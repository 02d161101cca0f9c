"""Stop and wait, with a filter that a test plays."""

import queue
import random
import threading

import pytest
from background import in_thread

from midastouch_tools.replay.flow_control import FlowControl
from midastouch_tools.replay.playback import Playback


class World:
    """A flow control with what it was told."""

    def __init__(self, patience: int = 3):
        self.playback, self.there, self.lost = Playback(rate=0.0), True, []
        self.flow = FlowControl(self.playback, patience, lambda: self.there, lambda *told: self.lost.append(told))

    def waiting(self):
        """Wait in a thread; returns what says whether it goes on, and what joins it."""
        return in_thread(self.flow.wait)

    def send(self, *stamps):
        """Send frames that the filter has at once, but cannot answer."""
        for stamp in stamps:
            self.flow.sent(stamp)
            self.flow.on_status(stamp, waits=True)


def test_the_next_image_waits_for_the_answer_to_this_one_only():
    world = World()
    world.flow.sent(7)
    join = world.waiting()
    world.flow.on_status(6, waits=False)
    world.flow.on_status(8, waits=False)
    assert join(0.2) == "still waiting"
    world.flow.on_status(7, waits=False)
    assert join() is True
    assert world.lost == []


def test_an_answer_counts_once():
    """A looped bag has the same stamps again: the first round's answer is none for the second."""
    world = World()
    world.flow.sent(7)
    world.flow.on_status(7, waits=False)
    assert world.flow.wait()
    world.flow.forget()
    world.flow.sent(7)
    assert world.waiting()(0.2) == "still waiting"


def test_a_frame_waiting_in_the_filter_lets_the_next_one_go():
    world = World()
    world.send(1, 2, 3)
    assert world.flow.wait()
    assert world.flow.waiting == 3
    world.flow.on_status(2, waits=False)
    assert world.flow.waiting == 1, "answers come in order: 1 will get none any more"
    world.send(4)
    world.flow.sent(5)
    world.flow.on_status(5, waits=False)
    assert world.flow.waiting == 0
    assert world.flow.lost == 0


def test_a_silent_filter_is_waited_for_and_a_busy_one_not_long():
    world = World(patience=3)
    world.flow.sent(1)
    join = world.waiting()
    for _ in range(2):
        world.flow.on_report()
    assert join(0.2) == "still waiting", "it may be busy with this very frame"
    world.flow.on_status(0, waits=True)  # which begins the patience anew
    for _ in range(2):
        world.flow.on_report()
    assert join(0.2) == "still waiting"
    world.flow.on_report()
    assert join() is True
    assert world.flow.lost == 1
    ((stamp, why),) = world.lost
    assert stamp == 1
    assert "though the filter is at work" in why
    world.flow.on_status(1, waits=False)
    assert world.flow.lost == 0, "it was only late"


def test_a_filter_that_is_gone_is_not_waited_for():
    world = World()
    world.flow.sent(1)
    join = world.waiting()
    world.there = False
    assert join() is True
    assert world.lost == [(1, "and the filter is gone")]


def test_a_seek_or_stop_ends_the_waits_and_loses_nothing():
    for interrupt in (lambda world: world.playback.seek(1.0), lambda world: world.playback.stop()):
        world = World()
        world.flow.sent(1)
        join = world.waiting()
        interrupt(world)
        assert join() is False
        world.flow.finish(lambda: None)
        assert world.flow.lost == 0


@pytest.mark.parametrize("seed", range(10))
def test_at_most_one_frame_is_under_way_whatever_the_filter_does(seed):
    """A filter that answers at once, late, or first says that it waits; each time in order."""
    rng = random.Random(seed)
    world = World()
    wire, held, answered, most = queue.SimpleQueue(), [], [], 0

    def filter_side():
        while (stamp := wire.get()) is not None:
            answer(rng.randint(0, len(held)))
            held.append(stamp)
            if rng.random() < 0.7:
                world.flow.on_status(stamp, waits=True)
            else:
                answer(len(held))
        answer(len(held))

    def answer(count):
        for _ in range(count):
            answered.append(held.pop(0))
            world.flow.on_status(answered[-1], waits=False)

    thread = threading.Thread(target=filter_side, daemon=True)
    thread.start()
    for stamp in range(100):
        assert world.flow.wait()
        most = max(most, wire.qsize())
        world.flow.sent(stamp)
        wire.put(stamp)
    wire.put(None)
    world.flow.finish(lambda: None)
    thread.join(60)
    assert most == 0
    assert answered == [*range(100)]
    assert (world.flow.waiting, world.flow.lost) == (0, 0)


def test_after_the_end_time_goes_on_until_nothing_waits():
    world = World()
    world.send(1, 2)
    ticks = []

    def pass_time():
        ticks.append(None)
        if len(ticks) in (5, 9):
            world.flow.on_status(1 + (len(ticks) == 9), waits=False)

    world.flow.finish(pass_time)
    assert (len(ticks), world.flow.waiting) == (9, 0)


def test_after_the_end_a_halted_clock_is_not_awaited_for_ever():
    world = World(patience=3)
    world.send(1, 2)
    world.flow.finish(world.flow.on_report)
    assert (world.flow.waiting, world.flow.lost) == (2, 0)

"""Pace, pause, steps and seeks, on a clock of our own."""

import pytest
from background import in_thread

from midastouch_tools.replay.playback import Playback

MS = 1_000_000


class FakeTime:
    """A clock that moves only while something waits on it."""

    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


def playback(monkeypatch, **settings):
    """A `Playback` whose waits take no real time, and its clock."""
    clock = FakeTime()
    player = Playback(now=clock, **settings)

    def wait(timeout=None):
        assert timeout is not None, "would wait for ever"
        clock.now += timeout

    monkeypatch.setattr(player.changed, "wait", wait)
    return player, clock


@pytest.mark.parametrize(("rate", "expected"), [(1.0, 0.5), (2.0, 0.25), (0.5, 1.0)])
def test_rate_scales_recorded_time(monkeypatch, rate, expected):
    player, clock = playback(monkeypatch, rate=rate)
    for stamp in range(1000 * MS, 1501 * MS, 100 * MS):
        assert player.wait_until_due(stamp)
    assert clock.now - 100.0 == pytest.approx(expected)


def test_ticks_tell_recorded_time_and_never_overtake(monkeypatch):
    player, _ = playback(monkeypatch, rate=2.0)
    ticks = []
    player.wait_until_due(1000 * MS, ticks.append)
    player.wait_until_due(1100 * MS, ticks.append, tick_s=0.02)
    assert ticks == pytest.approx([1040 * MS, 1080 * MS, 1100 * MS], abs=10)
    assert max(ticks) <= 1100 * MS


def test_it_says_how_long_it_waits(monkeypatch):
    player, _ = playback(monkeypatch, rate=2.0)
    player.wait_until_due(0)
    waits = []
    player.wait_until_due(40_000 * MS, lambda _: waits.append(player.remaining), tick_s=5.0)
    assert waits == pytest.approx([20.0, 15.0, 10.0, 5.0])
    assert player.remaining == pytest.approx(0.0, abs=1e-6)


def test_a_slow_consumer_is_caught_up_with(monkeypatch):
    player, clock = playback(monkeypatch, rate=1.0)
    player.wait_until_due(0)
    clock.now += 0.35
    for stamp in (100, 200, 300):
        player.wait_until_due(stamp * MS)
    assert clock.now == pytest.approx(100.35)
    player.wait_until_due(400 * MS)
    assert clock.now == pytest.approx(100.4)


def test_rewind_starts_the_pace_again(monkeypatch):
    player, clock = playback(monkeypatch, rate=1.0)
    player.wait_until_due(5000 * MS)
    player.rewind()
    player.wait_until_due(1000 * MS)
    player.wait_until_due(1100 * MS)
    assert clock.now == pytest.approx(100.1)


def test_a_new_rate_counts_from_where_it_is_set(monkeypatch):
    player, clock = playback(monkeypatch, rate=1.0)
    player.wait_until_due(0)
    player.wait_until_due(1000 * MS)
    player.set_rate(4.0)
    for stamp in (1000, 1500, 2000):
        player.wait_until_due(stamp * MS)
    assert clock.now == pytest.approx(100.0 + 1.0 + 0.25)


def test_pause_holds_and_resume_releases():
    player = Playback(rate=0.0, paused=True)
    join = in_thread(player.wait_until_due, 0)
    assert join(0.05) == "still waiting"
    player.resume()
    assert join() is True
    player.pause()
    join = in_thread(player.wait_until_due, 0)
    assert join(0.05) == "still waiting"
    player.stop()
    assert join() is False


def test_the_time_in_pause_is_not_caught_up(monkeypatch):
    player, clock = playback(monkeypatch, rate=1.0)
    player.wait_until_due(0)
    player.pause()
    clock.now += 60.0
    monkeypatch.setattr(player.changed, "wait", lambda timeout=None: player.resume())
    player.wait_until_due(100 * MS)
    assert clock.now == pytest.approx(160.0)


def test_a_wait_ends_when_what_it_waits_for_is_notified():
    player, happened = Playback(rate=0.0), []
    assert not player.wait_for(lambda: bool(happened), timeout_s=0.01)
    join = in_thread(player.wait_for, lambda: bool(happened), 1000.0)
    happened.append(True)
    with player.changed:
        player.changed.notify_all()
    assert join() is True
    player.seek(0.0)
    assert not player.wait_for(lambda: bool(happened), timeout_s=0.01)


@pytest.mark.parametrize(
    "interrupt", [lambda player: player.stop(), lambda player: player.seek(2.5)], ids=["stop", "seek"]
)
def test_a_stop_or_a_seek_ends_every_wait(interrupt):
    player = Playback(rate=1.0)
    assert player.wait_until_due(0)
    joins = [in_thread(player.wait_until_due, 10**15), in_thread(player.wait_for, lambda: False, 1000.0)]
    interrupt(player)
    assert [join() for join in joins] == [False, False]
    assert player.interrupted


def test_a_seek_is_taken_once_and_is_no_stop():
    player = Playback(rate=1.0)
    player.seek(2.5)
    assert not player.stopped
    assert (player.take_seek(), player.take_seek()) == (2.5, None)
    player.rewind()
    assert player.wait_until_due(10**15)


def test_waiting_for_the_end_of_a_pause():
    player = Playback(rate=0.0)
    player.wait_while_paused()
    for release in (player.resume, lambda: player.seek(1.0), player.stop):
        player.pause()
        join = in_thread(player.wait_while_paused)
        assert join(0.05) == "still waiting"
        release()
        assert join() is None
        player.take_seek()

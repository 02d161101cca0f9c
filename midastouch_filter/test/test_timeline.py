"""Jumps of time, single wrong stamps and second sources; stamps in ms, the payload of a code is its stamp."""

from __future__ import annotations

import pytest

from midastouch_filter.timeline import Timeline

MS = 1_000_000


class Told:
    """A timeline that is told stamps: `taken`, with None where time ran back, and `odd`, both in ms."""

    def __init__(self):
        self.seconds, self.transforms = 0.0, None
        self.taken, self.odd, self.late, self.held = [], [], [], False
        self._line = Timeline(lambda: self.transforms and self.transforms * MS, lambda: self.seconds)

    def tell(self, *stamps):
        for stamp in stamps:
            self.seconds += 0.03
            judged = self.take(self._line.judge(stamp * MS, stamp))
            self.late += [stamp] if judged.late else []

    def take(self, judged):
        self.odd += [stamp // MS for stamp in judged.odd]
        self.taken += [None] if judged.ran_back else []
        self.taken += [payload for _, payload in judged.taken]
        self.held = judged.held
        return judged

    def ask_again(self):
        return self.take(self._line.ask_again())

    def give_up(self, seconds):
        return self.take(self._line.give_up(seconds))


@pytest.fixture
def told():
    return Told()


@pytest.mark.parametrize("wrong", [0, 4000, 5600, 90_000])
def test_a_single_wrong_stamp_is_dropped(told, wrong):
    told.tell(5000, 5030, wrong, 5060, 5090)
    assert [stamp for stamp in told.taken if stamp != wrong] == [5000, 5030, 5060, 5090]
    assert told.odd == [wrong]
    assert told.late == []


def test_one_that_is_wrong_now_and_then_never_jumps(told):
    told.tell(*(stamp for good in range(5000, 8000, 30) for stamp in (good, 0)))
    assert told.taken == list(range(5000, 8000, 30))


def test_two_wrong_ones_of_the_same_stamp_are_no_second_witness(told):
    told.tell(5000, 0, 0, 5030)
    assert told.taken == [5000, 5030]
    assert told.odd == [0, 0]


def test_a_second_code_tells_of_the_same_jump(told):
    told.tell(5000, 5030, 1000)
    assert told.held
    told.tell(1030, 1060)
    assert told.taken == [5000, 5030, None, 1000, 1030, 1060]
    assert told.odd == []


def test_a_loop_that_is_reported_once_per_round(told):
    told.tell(*3 * [*range(1000, 6000, 500)])
    assert told.taken.count(None) == 2
    assert len(told.taken) == 2 + 30
    assert told.odd == told.late == []


def test_transforms_tell_of_the_same_jump_at_once(told):
    told.transforms = 5000
    told.tell(5000, 1000)
    assert told.held
    told.ask_again()
    assert told.held
    told.transforms = 990
    told.ask_again()
    assert told.taken == [5000, None, 1000]
    told.tell(6000)
    told.transforms = 1040
    told.tell(1040)
    assert told.taken[3:] == [6000, 1040], "the one ahead was wrong; time did not run back"


@pytest.mark.parametrize("stamps", [[1000, 1030, 9000, 9030], [*range(1000, 20_000, 2000)]], ids=["a pause", "slow"])
def test_neither_a_pause_nor_a_slow_camera_is_a_jump(told, stamps):
    told.tell(*stamps)
    assert told.taken == stamps
    assert told.odd == []


def test_a_wrong_stamp_that_nobody_follows_is_given_up(told):
    told.tell(5000, 0)
    told.give_up(1.0)
    assert told.odd == []
    told.seconds += 1.0
    told.give_up(1.0)
    assert told.odd == [0]


@pytest.mark.parametrize("pattern", ["ab", "aab", "abb", "aabb"])
@pytest.mark.parametrize("behind", [False, True])
def test_of_two_sources_one_is_followed(told, pattern, behind):
    """A bag is followed beside a live camera, or the other way round: no more than one restart."""
    clocks = {"a": iter(range(500_000, 600_000, 30)), "b": iter(range(100_000, 200_000, 30))}
    if behind:
        clocks = {"a": clocks["b"], "b": clocks["a"]}
    told.tell(*(next(clocks[source]) for source in 50 * pattern))
    assert told.taken.count(None) <= 1
    followed = [stamp for stamp in told.taken[10:] if stamp is not None]
    assert len(followed) >= 30
    assert max(followed) - min(followed) < 10_000, "of one source"
    assert len(told.odd) >= 40


def test_a_former_time_is_followed_again_after_a_silence(told):
    """A replay is sent back, then to where it had been."""
    told.tell(9000, 9030, 1000, 1030)
    told.seconds += 0.6
    told.tell(9060, 9090)
    assert told.taken == [9000, 9030, None, 1000, 1030, 9060, 9090]
    assert told.odd == []

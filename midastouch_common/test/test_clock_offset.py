from collections.abc import Callable

from hypothesis import given, settings
from hypothesis import strategies as st

from midastouch_common.clock_offset import PAIRS, ClockOffset
from midastouch_common.message_arrays import SECOND

offsets = st.integers(-(10**18), 2 * 10**18)
delays = st.lists(st.integers(0, 20_000_000), min_size=2 * PAIRS, max_size=60)


class Clocks:
    """Two clocks at a known distance; every reading takes one of ``delays``, in turn."""

    def __init__(self, offset: Callable[[int], int], delays: list[int]) -> None:
        self.now = 5 * SECOND
        self._offset = offset
        self.delays = delays
        self._reads = 0

    def monotonic(self) -> int:
        self.now += self.delays[self._reads % len(self.delays)]
        self._reads += 1
        return self.now

    def wall(self) -> int:
        now = self.monotonic()
        return now + self._offset(now)

    def true_offset(self) -> int:
        return self._offset(self.now)

    def estimator(self) -> ClockOffset:
        return ClockOffset(monotonic_ns=self.monotonic, wall_ns=self.wall)


@given(offsets, delays, st.lists(st.integers(0, SECOND), max_size=30))
def test_constant_offset_is_known_within_half_the_widest_bracket(offset, delays, pauses) -> None:
    clocks = Clocks(lambda _: offset, delays)
    estimate = clocks.estimator()
    for pause in pauses:
        clocks.now += pause
        estimate.update()
    assert abs(estimate.offset_ns - offset) <= max(delays) + 1


@given(offsets, st.integers(1, 50_000))
def test_one_good_pair_of_five_suffices(offset, tight) -> None:
    # Four brackets of 20 ms and lopsided, one tight: the error is that of the tight one.
    clocks = Clocks(lambda _: offset, [0, 0, 20_000_000] * (PAIRS - 1) + [0, tight, tight])
    assert abs(clocks.estimator().offset_ns - offset) <= tight + 1


@given(offsets, st.integers(6_000_000, 10**15), st.sampled_from([-1, 1]))
def test_a_step_is_followed_at_once_and_counted(offset, size, sign) -> None:
    at = 10 * SECOND
    clocks = Clocks(lambda now: offset + sign * size * (now >= at), [1000])
    estimate = clocks.estimator()
    estimate.update()
    assert estimate.steps == 0
    clocks.now = at
    estimate.update()
    assert abs(estimate.offset_ns - clocks.true_offset()) <= 1000
    assert estimate.steps == 1
    assert abs(estimate.last_step_ns - sign * size) <= 2000


@settings(max_examples=20, deadline=None)
@given(offsets, st.integers(-500, 500), st.lists(st.integers(500, 60_000), min_size=3, max_size=40))
def test_slew_is_followed_and_time_never_runs_backward(offset, ppm, delays) -> None:
    clocks = Clocks(lambda now: offset + now * ppm // 1_000_000, delays)
    estimate = clocks.estimator()
    previous = None
    for _ in range(1200):
        clocks.now += SECOND // 60
        estimate.update()
        wall = estimate.to_wall_ns(clocks.now)
        assert previous is None or wall > previous
        previous = wall
        assert abs(estimate.offset_ns - clocks.true_offset()) <= 1_100_000
    assert estimate.steps == 0


def test_one_badly_measured_moment_hardly_moves_the_estimate() -> None:
    clocks = Clocks(lambda _: 0, [1000])
    estimate = clocks.estimator()
    clocks.delays = [0, 0, 8_000_000]  # The process is preempted after each reading of the wall clock.
    clocks.now += SECOND // 60
    estimate.update()
    assert abs(estimate.offset_ns) < 200_000


def test_real_clocks() -> None:
    import time

    estimate = ClockOffset()
    estimate.update()
    before = time.time_ns()
    converted = estimate.to_wall_ns(time.monotonic_ns())
    after = time.time_ns()
    assert before - 5_000_000 <= converted <= after + 5_000_000

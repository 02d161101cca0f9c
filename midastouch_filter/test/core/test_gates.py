import pytest

from midastouch_filter.core.gates import GATES, Gates, Stopwatch


def test_what_is_skipped_is_counted_by_name_from_the_start():
    gates = Gates()
    assert set(gates.counts) == set(GATES)
    assert [gates.skips("at_rest", needless) for needless in (True, False, True)] == [True, False, True]
    assert gates.counts["at_rest"] == 2
    assert gates.counts["no_contact"] == 0


def test_an_open_gate_skips_nothing_and_counts_nothing():
    gates = Gates(["no_contact"])
    assert not gates.skips("no_contact", True)
    assert gates.counts["no_contact"] == 0
    assert gates.skips("at_rest", True)


def test_a_refusal_is_counted_and_said():
    gates = Gates()
    gates.refuse("bad_code", "code is zero")
    gates.refuse("bad_code", "code is not finite")
    assert gates.counts["bad_code"] == 2
    assert gates.note == "code is not finite"


def test_stages_add_up_until_the_watch_is_restarted():
    ticks = iter([0.0, 1.0, 5.0, 7.0, 8.0, 8.5])
    watch = Stopwatch(lambda: next(ticks))
    for _ in range(2):
        with watch.stage("align"):
            pass
    assert watch.ms == {"align": 3000.0}
    watch.restart()
    with watch.stage("modes"):
        pass
    assert watch.ms == {"modes": pytest.approx(500.0)}

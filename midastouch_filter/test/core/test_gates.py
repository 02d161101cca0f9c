import pytest

from midastouch_filter.core.gates import Stopwatch


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

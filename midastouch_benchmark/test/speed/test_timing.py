import pytest

from midastouch_benchmark.speed.timing import CallTimer, time_calls


def test_percentiles_and_mean_cpu():
    stopwatch = CallTimer()
    stopwatch.wall_ms, stopwatch.cpu_ms = [float(i) for i in range(101)], [1.0, 3.0]
    assert stopwatch.summary() == {"p50": 50.0, "p95": 95.0, "cpu": 2.0}


def test_stopwatch_measures_work_in_milliseconds():
    stopwatch = CallTimer()
    with stopwatch:
        sum(range(200_000))
    assert 0.1 < stopwatch.wall_ms[0] < 5000
    assert stopwatch.cpu_ms[0] > 0.1


def test_a_failed_call_is_not_counted():
    stopwatch = CallTimer()
    with pytest.raises(ZeroDivisionError), stopwatch:
        1 / 0  # noqa: B018
    assert stopwatch.wall_ms == []


def test_warm_up_is_run_but_not_timed():
    calls = []
    assert len(time_calls(lambda: calls.append(1), repeats=5, warm_up=3).wall_ms) == 5
    assert len(calls) == 8


def test_first_measurements_can_be_dropped():
    stopwatch = time_calls(lambda: None, repeats=5, warm_up=0)
    kept = stopwatch.wall_ms[2:]
    stopwatch.drop(2)
    assert stopwatch.wall_ms == kept
    assert len(stopwatch.cpu_ms) == 3


def test_some_measurements_can_be_chosen():
    stopwatch = time_calls(lambda: None, repeats=3, warm_up=0)
    chosen = stopwatch.where([True, False, True])
    assert chosen.wall_ms == stopwatch.wall_ms[::2]
    assert chosen.cpu_ms == stopwatch.cpu_ms[::2]
    assert len(stopwatch.wall_ms) == 3

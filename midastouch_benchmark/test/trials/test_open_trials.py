"""What a log lacks is run, and nothing else."""

import numpy as np
import pytest

from midastouch_benchmark.trials.open_trials import Workforce, run_open
from midastouch_benchmark.trials.trial_log import TrialLog
from midastouch_bringup.cluster import open_cluster

UNITS = [(("a", 2), {"a1": 1, "a2": 2}), (("b", 3), {"b1": 1})]


@pytest.fixture
def log(tmp_path):
    return TrialLog(tmp_path / "log.jsonl")


class Run:
    """Remembers what it was asked for."""

    def __init__(self):
        self.asked = []

    def __call__(self, name, factor, trials):
        self.asked.append((name, dict(trials)))
        return {key: {"found": factor * what} for key, what in trials.items()}


def complete(log, run, **options):
    with open_cluster() as cluster:
        return run_open(run, UNITS, log, Workforce(cluster, **options))


def test_only_what_the_log_lacks_is_run_and_all_is_returned_in_order(log):
    log.add("a1", {"found": -1})
    run, told = Run(), []
    trials, missing = complete(log, run, start_progress=lambda total: told.append(total) or told.append)
    assert run.asked == [("a", {"a2": 2}), ("b", {"b1": 1})]
    assert ([each["found"] for each in trials], missing, told) == ([-1, 4, 3], 0, [2, 1, 1])


def test_what_is_done_is_not_run_again(log):
    first, _ = complete(log, Run())
    run = Run()
    assert complete(log, run) == (first, 0)
    assert run.asked == []


def test_after_the_deadline_nothing_is_started_and_the_rest_is_counted(log):
    log.add("a1", {"found": 2})
    assert complete(log, Run(), deadline=-np.inf) == ([{"found": 2}], 2)


def test_an_interrupted_unit_keeps_what_earlier_ones_found(log):
    def run(name, factor, trials):
        if name == "b":
            raise KeyboardInterrupt
        return Run()(name, factor, trials)

    with pytest.raises(KeyboardInterrupt):
        complete(log, run)
    assert (log.get("a2"), log.get("b1")) == ({"found": 4}, None)

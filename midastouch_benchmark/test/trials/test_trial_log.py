"""What a log lacks is run, and nothing else."""

import numpy as np
import pytest

from midastouch_benchmark.trials.trial_log import TrialLog, key_of, run_open, source_digest
from midastouch_tools.jobs import Workers


def test_trials_are_found_again(tmp_path):
    log = TrialLog(tmp_path / "sub" / "trials.jsonl")
    assert log.get("a") is None
    log.add("a", {"error": np.float64(1.5), "lost": float("nan")})
    assert log.get("a") == {"error": 1.5, "lost": None}
    assert TrialLog(tmp_path / "sub" / "trials.jsonl").get("a") == {"error": 1.5, "lost": None}


def test_a_line_that_was_cut_off_costs_that_trial_only(tmp_path):
    path = tmp_path / "trials.jsonl"
    log = TrialLog(path)
    log.add("a", {"n": 1})
    log.add("b", {"n": 2})
    path.write_text(path.read_text()[:-8])
    log = TrialLog(path)
    assert log.get("b") is None
    log.add("c", {"n": 3})
    log = TrialLog(path)
    assert (log.get("a"), log.get("c")) == ({"n": 1}, {"n": 3})


def test_a_key_depends_on_content_not_on_order():
    assert key_of({"a": 1, "b": (2, 3)}) == key_of({"b": [2, 3], "a": 1})
    assert key_of({"a": 1}) != key_of({"a": 2})


def test_changed_code_has_another_digest(tmp_path):
    (tmp_path / "a.py").write_text("x = 1\n")
    first = source_digest(tmp_path)
    assert source_digest(tmp_path) == first
    (tmp_path / "a.py").write_text("x = 2\n")
    assert source_digest(tmp_path) != first
    second = source_digest(tmp_path)
    (tmp_path / "room").mkdir()
    (tmp_path / "room" / "b.py").write_text("x = 1\n")
    assert source_digest(tmp_path) != second
    one = tmp_path / "one.txt"
    one.write_text("y = 1\n")
    both = source_digest(tmp_path, one)
    assert both != source_digest(tmp_path)
    one.write_text("y = 2\n")
    assert source_digest(tmp_path, one) != both


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
    return run_open(run, UNITS, log, Workers(), **options)


def test_only_what_the_log_lacks_is_run(log, bars):
    log.add("a1", {"found": -1})
    run = Run()
    trials, missing = complete(log, run)
    assert run.asked == [("a", {"a2": 2}), ("b", {"b1": 1})]
    assert ([each["found"] for each in trials], missing) == ([-1, 4, 3], 0)
    assert [(bar.total, bar.n) for bar in bars] == [(2, 2)]


def test_after_the_deadline_the_rest_is_counted(log):
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

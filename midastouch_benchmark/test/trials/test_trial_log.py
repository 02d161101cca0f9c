import numpy as np

from midastouch_benchmark.trials.trial_log import TrialLog, key_of, source_digest


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
    one = tmp_path / "one.txt"
    one.write_text("y = 1\n")
    both = source_digest(tmp_path, one)
    assert both != source_digest(tmp_path)
    one.write_text("y = 2\n")
    assert source_digest(tmp_path, one) != both

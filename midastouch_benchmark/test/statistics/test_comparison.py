import pytest

from midastouch_benchmark.statistics.comparison import compare_variants, pareto_front, rows_by_init


@pytest.fixture
def rows(trials) -> dict[str, dict]:
    return {row["variant"]: row for row in compare_variants(trials)}


def test_variants_are_compared_on_the_trials_that_all_have_run(rows):
    assert {row["trials"] for row in rows.values()} == {2}
    assert rows["default"]["e_trans_mm"] == 3
    assert (rows["paper"]["e_trans_mm"], rows["paper"]["cpu_ms_filter"], rows["paper"]["right"]) == (12, 97, 0)
    assert rows["5k"]["right"] == 1
    assert rows["default"]["wrong_converged"] == pytest.approx(0.2)


@pytest.fixture
def many(trials) -> list[dict]:
    """Of the default and the paper's filter, 60 slides of two trials each, 10 and 8 mm apart."""
    pairs = [trials[k] | {"slide": slide} for slide in range(60) for k in (0, 1, 3, 4)]
    return [pair | {"frames_converged_right": 8} if pair["variant"] == "paper" else pair for pair in pairs]


def test_a_difference_is_taken_trial_by_trial_with_its_interval(many):
    uneven = [t | {"final": t["final"] | {"e_trans_mm": 12 + (t["slide"] % 3 - 1)}} if t["variant"] == "paper" else t
              for t in many]  # fmt: skip
    _, row = compare_variants(uneven)
    assert row["difference_mm"] == 9
    assert row["difference_mm_interval"] == [pytest.approx(8.8, abs=0.06), pytest.approx(9.2, abs=0.06)]
    assert row["right_difference"] == -1
    assert row["right_difference_interval"] == [-1, -1]
    assert row["wrong_converged_difference"] == pytest.approx(-0.2)
    # of the filter's CPU time there are 90 ms more
    assert row["verdict"] == "worse: error, right, CPU time; better: converged wrong"


def test_what_is_the_same_shows_no_difference(many):
    twice = [t for t in many if t["variant"] == "default"]
    _, row = compare_variants([*twice, *(t | {"variant": "5k"} for t in twice)])
    assert row["verdict"] == "no difference shown"


def test_one_slide_does_not_tell_how_far_chance_goes(trials):
    rows = compare_variants([trials[0], trials[3]])
    assert (rows[1]["difference_mm"], rows[1]["difference_mm_interval"]) == (10, None)
    assert rows[1]["verdict"] == "too few (1)"


def test_inits_are_compared_apart_and_only_with_a_default(trials):
    uniform = [trial | {"init": "uniform"} for trial in trials[5:]]
    assert list(rows_by_init(compare_variants([*trials, *uniform]))) == ["paper"]
    uniform.append(trials[2] | {"init": "uniform"})
    rows = rows_by_init(compare_variants([*trials, *uniform]))
    assert [(row["variant"], row["trials"]) for row in rows["uniform"]] == [("5k", 1), ("default", 1)]


def test_the_front_holds_what_nothing_beats_in_both():
    rows = [{"cpu_ms_filter": ms, "e_trans_mm": e} for ms, e in ((10, 3), (4, 5), (20, 4), (4, 6), (30, 1))]
    front = [(row["cpu_ms_filter"], row["e_trans_mm"]) for row in pareto_front(rows, "e_trans_mm")]
    assert front == [(4, 5), (10, 3), (30, 1)]

"""What the tables of reports claim, and what they leave open."""

from midastouch_benchmark.trials.variants import VARIANTS


def test_trust_is_claimed_by_whole_intervals_only(monkeypatch):
    from midastouch_benchmark.tables import trust as tool

    monkeypatch.setattr(tool, "PROMISED_WRONG", 0.05)
    report = {"trials": 200, "converged_frames_wrong": {"share": 0.04, "interval": [0.03, 0.049]}}
    none = {"share": None, "interval": None}
    report |= {"right_if_converged_at_end": none, "right_if_converged_modulo_symmetry_at_end": none, "regions": {}}
    monkeypatch.setattr(tool, "reported", lambda: ["kidnap"])
    monkeypatch.setattr(tool, "benchmark_summary", lambda name: {"trust": report})

    def cells() -> list[str]:
        (row,) = (row for row in tool.converged()[1] if row[0] == tool.PROTOCOLS["kidnap"])
        return row[1:3]

    assert cells() == ["4.0 % (3.0%...4.9%)", "kept"]
    report["converged_frames_wrong"] = {"share": 0.04, "interval": [0.03, 0.06]}
    assert cells()[1] == "not shown"
    report["converged_frames_wrong"] = {"share": 0.08, "interval": [0.06, 0.1]}
    assert cells()[1] == "*not kept*"
    report["trials"] = 99
    assert cells() == ["too few (99)", "too few (99)"]
    monkeypatch.setattr(tool, "reported", list)
    assert cells()[0] == tool.UNMEASURED


def test_the_front_marks_the_default_and_presets_and_claims_nothing_below_100_trials(monkeypatch):
    from midastouch_benchmark.tables import accuracy as tool

    def compared(variant: str, cpu: float, error: float) -> dict:
        same = dict.fromkeys(("difference_mm", "wrong_converged", "e_rot_deg"), 0.0)
        one = {"variant": variant, "trials": 100, "cpu_ms_filter": cpu, "e_trans_mm": error, "verdict": "-"}
        return one | same | {"difference_mm_interval": None, "right": 0.9}

    rows = [compared("default", 6, 2), compared("fast", 3, 4), compared("20k", 4, 5)]
    about = {one["variant"]: VARIANTS[one["variant"]].describe() for one in rows}
    monkeypatch.setattr(tool, "reported", lambda: ["front"])
    monkeypatch.setattr(tool, "report", lambda name: {"comparison": rows, "variants": about})
    table = [(row[0].startswith("**"), row[1]) for row in tool.front()[1]]
    assert table == [(True, "yes"), (False, ""), (True, "yes")]
    rows[:] = [one | {"trials": 99} for one in rows]
    ((what, *cells, _),) = tool.front()[1]
    assert (what, set(cells)) == ("3 variants", {"too few (99)"})
    monkeypatch.setattr(tool, "reported", list)
    assert tool.front()[1][0][0] == tool.UNMEASURED


def test_an_ablation_that_is_not_measured_yet_is_in_the_table(monkeypatch):
    from midastouch_benchmark.tables import accuracy as tool

    monkeypatch.setattr(tool, "reported", list)
    header, rows = tool.variants()
    by_report = {row[-1]: row for row in rows}
    assert by_report["`ablation_rest`"][:2] == ["at rest in contact for 20 s", tool.UNMEASURED]
    assert {len(row) for row in rows} == {len(header)}

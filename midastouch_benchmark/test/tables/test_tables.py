"""What the tables of reports claim, and what they leave open."""

import pytest

from midastouch_benchmark.tables import comparisons, reports, trust
from midastouch_benchmark.tables.table import UNMEASURED
from midastouch_benchmark.trials.variants import SETS, VARIANTS


@pytest.mark.parametrize(
    ("fraction", "interval", "verdict"),
    [(0.04, [0.03, 0.049], "kept"), (0.04, [0.03, 0.06], "not shown"), (0.08, [0.06, 0.1], "*not kept*")],
)
def test_trust_is_claimed_by_whole_intervals_only(fraction, interval, verdict):
    form = trust.verdict("a", 0.05, "kept", "*not kept*", "not shown")
    assert form({"a.share": fraction, "a.interval": interval}) == verdict
    assert form({"a.share": None, "a.interval": None}) == "-"


def test_the_promise_about_converged_stands_in_its_table():
    wrong = {"share": 0.5, "interval": [0.4, 0.6]}
    rows = [{"what": "kidnap", "trials": n, "trust": {"converged_frames_wrong": wrong}} for n in (200, 99)]
    table = trust.CONVERGED.of(rows).iloc[:, 1:3].to_numpy().tolist()
    assert table == [["50.0 % (40.0%...60.0%)", "*not kept*"], ["too few (99)"] * 2]


def test_the_front_marks_presets_and_claims_nothing_of_few():
    def compared(variant: str, cpu: float, error: float) -> dict:
        same = dict.fromkeys(("difference_mm", "wrong_converged", "e_rot_deg", "cpu_difference_ms"), 0.0)
        paired = ("difference_mm", "right_difference", "wrong_converged_difference", "cpu_difference_ms")
        one = {"variant": variant, "trials": 100, "cpu_ms_filter": cpu, "e_trans_mm": error, "right": 0.9}
        return one | same | dict.fromkeys(f"{name}_interval" for name in paired)

    rows = [compared("default", 6, 2), compared("fast", 3, 4), compared("5k", 4, 5)]
    about = {one["variant"]: VARIANTS[one["variant"]].describe() for one in rows}
    table = comparisons.front_table({"comparison": rows, "variants": about})
    marks = zip(table.iloc[:, 0].str.startswith("**"), table.iloc[:, 1], strict=True)
    assert list(marks) == [(True, "yes"), (False, ""), (True, "yes")]
    few = comparisons.front_table({"comparison": [one | {"trials": 99} for one in rows], "variants": about})
    ((what, *cells, _),) = few.to_numpy().tolist()
    assert (what, set(cells)) == ("3 variants", {"too few (99)"})


@pytest.mark.parametrize("table", [comparisons.variants, comparisons.front, comparisons.baselines, comparisons.grasps])
def test_what_is_not_measured_yet_is_in_the_table(table, monkeypatch):
    for module in (reports, comparisons):
        monkeypatch.setattr(module, "reported", list)
    assert UNMEASURED in table().to_numpy()[0].tolist()


def test_every_protocol_has_row_and_command_for_each_set():
    rows = reports.further()
    for objects, (words, _) in reports.FURTHER.items():
        own = {name: what for name, what in rows.items() if name.endswith(f"_{objects}") and name != "small_cad"}
        assert len(own) == len(reports.CONDITIONS) + 1  # plain and uniform, but not what has objects of its own
        for name, what in own.items():
            assert what.endswith(f"; {words}")
            assert f"--objects {objects} --protocol {name.removesuffix(f'_{objects}')}" in reports.COMMANDS[name]
    assert set(rows) <= set(reports.COMMANDS)
    assert len(set(rows.values())) == len(rows)


def test_every_report_that_is_kept_is_the_only_one_of_a_command():
    kept = [path.stem for path in (reports.ROOT / "reports").glob("*/*.json")]
    assert sorted(kept) == sorted(set(kept) & set(reports.COMMANDS))


def test_variants_that_commands_name_are_known():
    named = {
        variant
        for command in reports.COMMANDS.values()
        if "--variant" in command
        for variant in command.split("--variant ")[1].split(" --")[0].split()
    }
    assert named <= {*VARIANTS, *SETS}
    assert set(SETS["ablation"]) <= named

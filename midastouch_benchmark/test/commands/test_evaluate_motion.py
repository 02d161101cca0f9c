import json

import pytest

from midastouch_benchmark.tables.exploring import fault_table, motion_table
from midastouch_benchmark.trials.motion import FAULTS
from midastouch_tools import cli

pytest.importorskip("mujoco", reason="not installed: tools/requirements/mujoco.txt")


@pytest.mark.slow
def test_an_arm_touches_slides_and_stops(tmp_path):
    told = tmp_path / "motion.json"
    args = ["evaluate-motion", "--objects", "ball", "--trials", "2", "--out", str(tmp_path), "--json", str(told)]
    assert cli.main(args) == 0
    trials = json.loads(told.read_text())["trials"]
    assert len(trials) == 2
    for trial in trials:
        assert trial["touches"][0]["success"], trial["touches"][0]["message"]
        assert max(each["indented_mm"] for each in trial["touches"] + trial["faults"]) < 1.5
        assert trial["slide"]["success"], trial["slide"]["message"]
        assert {each["name"] for each in trial["faults"]} == set(FAULTS)
        for fault in trial["faults"]:
            assert fault["periods"] <= 2, fault


TOUCH = {"ended": True, "success": True, "depth_mm": 0.6, "path_mm": 9.0, "message": ""}
TOUCH |= {"indented_mm": 0.7, "deepest_mm": 0.7}
SLIDE = TOUCH | {"images": 100, "held": 90, "lost": False}
TRIAL = {"object": "mug", "touches": [TOUCH], "slide": SLIDE, "faults": [TOUCH | {"name": "lost", "periods": 1}]}


def test_what_fails_is_in_the_table():
    bad = {
        "touches": [TOUCH | {"depth_mm": 1.2, "indented_mm": 1.6, "deepest_mm": 8.0}],
        "slide": SLIDE | {"lost": True, "success": False},
        "faults": [TOUCH | {"deepest_mm": 1.7, "indented_mm": 0.4, "name": "lost", "periods": None}],
    }
    trials = [TRIAL | {"seed": seed} | (bad if seed == 0 else {}) for seed in range(100)]
    result = {"trials": trials, "config": {"depth_mm": 0.5}}
    touch, slide, halted, with_fault = motion_table(result).to_dict("records")
    assert touch["at the wanted depth"].startswith("99.0 %")
    assert (touch["gel pressed in by more than 1.5 mm"], touch["by"]) == ("1 of 100", "1.60 mm")
    assert with_fault["gel pressed in by more than 1.5 mm"] == "0 of 100"
    assert with_fault["more than 1.5 mm along its axis"] == "1 of 100"
    assert slide["at the wanted depth"].startswith("90.0 %")
    assert slide["contact lost where the surface goes on"].startswith("1.0 %")
    assert (halted["trials"], halted["ended with a reason"]) == ("1", "too few (1)")
    assert fault_table(result)["stopped in time"].tolist() == ["99 of 100"]


def test_nothing_is_claimed_of_few_trials():
    trials = [TRIAL | {"seed": 0, "faults": []}]
    table = motion_table({"trials": trials, "config": {"depth_mm": 0.5}})
    assert table["at the wanted depth"].tolist() == ["too few (1)"] * 2 + ["too few (0)"] * 2

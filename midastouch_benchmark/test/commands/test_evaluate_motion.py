import json

import pytest

from midastouch_benchmark.tables.exploring import fault_table, motion_table
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
        assert trial["touch"]["success"], trial["touch"]["message"]
        assert trial["touch"]["deepest_mm"] < 1.5
        assert trial["slide"]["success"], trial["slide"]["message"]
        assert trial["fault"]["periods"] <= 2, trial["fault"]
    assert [trial["fault"]["name"] for trial in trials] == ["released", "no image"]


TOUCH = {"ended": True, "success": True, "depth_mm": 0.6, "deepest_mm": 0.7, "path_mm": 9.0, "message": ""}
SLIDE = TOUCH | {"images": 100, "held": 90, "lost": False}


def test_what_fails_is_in_the_table():
    bad = {"touch": TOUCH | {"depth_mm": 1.2, "deepest_mm": 1.6}, "slide": SLIDE | {"lost": True, "success": False}}
    trials = [
        {"object": "mug", "seed": seed, "touch": TOUCH, "slide": SLIDE, "fault": {"name": "lost", "periods": 1}}
        | (bad | {"fault": {"name": "lost", "periods": None}} if seed == 0 else {})
        for seed in range(100)
    ]
    result = {"trials": trials, "config": {"depth_mm": 0.5}}
    touch, slide, halted = motion_table(result).to_dict("records")
    assert touch["at the wanted depth"].startswith("99.0 %")
    assert touch["deeper than 1.5 mm"] == "1 of 100"
    assert slide["at the wanted depth"].startswith("90.0 %")
    assert slide["contact lost where the surface goes on"].startswith("1.0 %")
    assert (halted["trials"], halted["ended with a reason"]) == ("1", "too few (1)")
    assert fault_table(result)["stopped in time"].tolist() == ["99 of 100"]


def test_nothing_is_claimed_of_few_trials():
    trials = [{"object": "mug", "seed": 0, "touch": TOUCH, "slide": SLIDE, "fault": None}]
    assert motion_table({"trials": trials, "config": {"depth_mm": 0.5}})["at the wanted depth"].tolist() == [
        "too few (1)",
        "too few (1)",
        "too few (0)",
    ]

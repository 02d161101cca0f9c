"""When an exploration counts as right."""

import dataclasses

import numpy as np
import pytest

from midastouch_common import se3
from midastouch_msgs.msg import ExplorerStatus
from midastouch_perception.symmetry.group import Symmetry
from midastouch_tools.bags.run_record import RecordedMode, RunRecord, Snapshot
from midastouch_tools.demo.result import in_a_sentence
from midastouch_tools.exploration_result import end_of, ending, exploration_result, result_rows, write_page, write_words

REASON = "the filter knows the pose"
ENDED = end_of(ExplorerStatus(state="known", reason=REASON, path_length=0.2, slides=3, lifts=1))


def frame(objects, off=0.0, state="converged", symmetry=None):
    pose = se3.exp([off, 0, 0, 0, 0, 0])
    mode = RecordedMode(1.0, pose, np.eye(6))
    truth, image = np.eye(4), np.zeros((2, 2, 3), np.uint8)
    return Snapshot(0, 0.0, truth, pose[None], [mode], pose, image, None, None, state, objects, symmetry or Symmetry())


def result(*args, **kwargs):
    return exploration_result(RunRecord([frame(*args, **kwargs)], {}), "mug", ENDED, 1.0, 2.0)


def test_object_and_place_must_be_right():
    found = result({"mug": 0.97, "bowl": 0.03})
    assert (found["object"], found["answer"], found["object_probability"], found["right"]) == ("mug", "mug", 0.97, True)


@pytest.mark.parametrize(
    "wrong",
    [
        {"objects": {"mug": 0.03, "bowl": 0.97}},
        {"objects": {"mug": 0.2, "unknown": 0.8}},
        {"objects": {"mug": 1.0}, "off": 0.02},
        {"objects": {"mug": 1.0}, "state": "ambiguous"},
    ],
    ids=["object", "unknown", "place", "not sure"],
)
def test_else_it_is_wrong(wrong):
    assert not result(**wrong)["right"]


def test_which_poses_are_alike_is_told(tmp_path):
    assert not result_rows_of(result({}))
    symmetry = Symmetry(np.stack([np.eye(4), np.diag([-1.0, -1.0, 1.0, 1.0])]))
    found = result({}, off=0.009, symmetry=symmetry)
    assert np.array(found["alike"])[:, 0] == pytest.approx([0.009, -0.009])
    (words,) = result_rows_of(found)
    assert words == "2 poses alike: at (9, 0, 0), (-9, 0, 0) mm"
    assert words in write_words(found, "no pictures", tmp_path).read_text()
    axis = Symmetry(free="axis", axis=np.array([0.0, 0.0, 1.0]), centre=np.array([0.002, 0.0, 0.0]))
    (words,) = result_rows_of(result({}, symmetry=axis))
    assert "any turn about the axis (0.00, 0.00, 1.00) through (2, 0, 0) mm" in words
    (words,) = result_rows_of(result({}, symmetry=Symmetry(free="all", centre=np.array([0.002, -1e-4, 0.0]))))
    assert words == "sphere: any turn about its centre, (2, 0, 0) mm"


def result_rows_of(found) -> list[str]:
    """What the table says of symmetry."""
    return [value for name, value in result_rows(found)[1] if "symmetry" in name]


def test_an_object_that_was_told_is_known():
    found = result({})
    assert (found["answer"], found["object_probability"], found["right"]) == ("mug", 1.0, True)


@pytest.mark.parametrize(
    ("frames", "found"),
    [
        ([("searching", 0.0), ("converged", 0.02), ("converged", 0.003), ("converged", 0.004)], 1.0),
        ([("ambiguous", 0.0), ("converged", 0.02)], None),
    ],
    ids=["found", "never right"],
)
def test_the_page_says_when_it_was_found_and_how_far_off_the_end_is_on_the_clock_of_its_axes(frames, found):
    snapshots = [dataclasses.replace(frame({}, off, state), time=0.5 * k) for k, (state, off) in enumerate(frames)]
    made = exploration_result(RunRecord(snapshots, {}), "mug", ENDED, 1.0, 60.0)
    assert made["found_s"] == found
    sentence = in_a_sentence("It slid", made)
    assert ("1.0 s" in sentence and "4.0 mm" in sentence) if found else "never" in sentence
    assert f"{snapshots[-1].time:.1f} s" in [row[1] for row in result_rows(made)[1]]


def test_an_end_without_an_answer_is_told_on_a_page(tmp_path):
    reason = "still uninitialised after 1.50 m"
    status = ExplorerStatus(state="gave_up", reason=reason, path_length=1.5, slides=9, lifts=1)
    result = ending(end_of(status), "mug", 60.0)
    assert not result["right"]
    page = write_words(result, "no frame with a status", tmp_path).read_text()
    for words in ("A finger explores: mug", reason, "1500 mm, 9 slides, 1 lift", "no frame with a status"):
        assert words in page


def test_a_run_without_recorded_touches_still_gets_a_page(tmp_path):
    page = write_page([frame({})], None, None, result({}), tmp_path).read_text()
    assert "There is nothing to draw" in page
    assert REASON in page

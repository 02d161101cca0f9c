"""What the scene says, and what it hands to Rerun, by a stand-in of it: the drawing itself needs the real one."""

import sys
from types import ModuleType

import numpy as np
import pytest

from midastouch_common import se3
from midastouch_perception.sensor_calibration.collector import REGIONS
from midastouch_tools.view.scene import Scene, guidance_text, region_box, status_text


class StandIn(ModuleType):
    """A module whose classes make (name, first argument, options)."""

    def __getattr__(self, name):
        return lambda *arguments, **options: (name, arguments[0] if arguments else None, options)


class Recording:
    """Keeps the newest that was logged, by its path."""

    def __init__(self):
        self.newest = {}

    def log(self, path, content, static=False):
        self.newest[path] = content

    def send_blueprint(self, blueprint):
        self.blueprint = blueprint

    def text(self, path):
        return self.newest[path][1]


@pytest.fixture
def recording(monkeypatch):
    rerun = StandIn("rerun")
    rerun.blueprint = StandIn("rerun.blueprint")
    monkeypatch.setitem(sys.modules, "rerun", rerun)
    return Recording()


def test_state_and_objects_stand_together_until_a_restart(recording):
    scene = Scene(recording)
    scene.status("searching", "two objects fit", {"mass/best": 0.5})
    scene.objects({"mug": 0.7, "bowl": 0.3})
    assert "searching" in recording.text("status")
    scene.status("ambiguous", "several poses fit", {})
    assert all(word in recording.text("status") for word in ("ambiguous", "70% mug", "30% bowl"))
    scene.mesh(np.eye(3), np.array([[0, 1, 2]]), np.eye(3))  # another object leads
    assert "70% mug" in recording.text("status")
    scene.restart()
    assert "mug" not in recording.text("status")


def test_there_are_a_legend_and_a_scale_in_millimetres(recording):
    scene = Scene(recording)
    assert "particles" in recording.text("legend")
    scene.mesh(np.diag([0.1, 0.04, 0.03]), np.array([[0, 1, 2]]), np.eye(3))
    _, (ends,), options = recording.newest["object/scale"]
    assert np.linalg.norm(ends[1] - ends[0]) == pytest.approx(0.02)
    assert options["labels"] == ["20 mm"]


def test_the_eye_looks_at_the_whole_opaque_object_and_poses_are_drawn_above_it(recording):
    scene = Scene(recording)
    scene.mesh(np.array([[0, 0, 0], [0.2, 0.04, 0.06]]), np.array([[0, 1, 1]]), np.zeros((2, 3)))
    _, across, _ = recording.blueprint
    eye = across[1][2]["eye_controls"][2]
    assert eye["look_target"] == pytest.approx([0.1, 0.02, 0.03])
    away = eye["position"] - eye["look_target"]
    assert 0.1 < np.linalg.norm(away) < 0.3
    assert abs(away[0]) < abs(away[1])  # the longest side lies across
    assert len(recording.newest["object/mesh"][2]["albedo_factor"]) == 3  # no transparency
    pose = se3.make(np.diag([1.0, -1.0, -1.0]), np.array([0.1, 0.02, 0.001]))  # pressed in by 1 mm from below
    scene.estimate(pose)
    assert recording.newest["object/gel"][2]["translation"] == pytest.approx([0.1, 0.02, -0.001])


def test_regions_cover_the_image():
    boxes = [region_box(region) for region in REGIONS]
    assert boxes[0] == ((0, 0), (80, pytest.approx(320 / 3)))
    assert boxes[REGIONS.index("middle right")][0] == (160, pytest.approx(320 / 3))
    assert sum(width * height for _, (width, height) in boxes) == pytest.approx(240 * 320)


def test_step_progress_and_what_was_thrown_away_are_told():
    values = {"taken": "2", "wanted": "5", "last_press": "not taken: two contacts", "thrown_away": "7"}
    values |= {"thrown_away_1": "cut off at the edge of the view", "thrown_away_2": "two contacts", "region": "centre"}
    text = guidance_text("2 of 5: press the ball at the centre", values)
    assert text.startswith("# 2 of 5: press the ball at the centre")
    assert "\u25cf\u25cf\u25cb\u25cb\u25cb" in text
    assert "Last press: not taken: two contacts" in text
    assert "Thrown away: 7" in text
    assert "- cut off at the edge of the view\n- two contacts" in text


def test_at_the_start_there_is_the_step_alone():
    text = guidance_text("0 of 5: press the ball at the top left", {"taken": "0", "wanted": "5", "last_press": ""})
    assert "Last" not in text
    assert "Thrown" not in text


def test_the_state_has_its_reason_and_a_bar_for_each_object():
    assert "normal" in status_text("searching", "no touch yet", {})
    text = status_text("searching", "two objects fit", {"mug": 0.62, "bowl": 0.3, "unknown": 0.08})
    assert text.startswith("# searching\n\ntwo objects fit")
    assert "\u25cf" * 6 + "\u25cb" * 4 + " 62% mug" in text
    assert text.index("mug") < text.index("bowl") < text.index("unknown")
    assert "\u25cf" not in status_text("lost", "nothing fits", {})

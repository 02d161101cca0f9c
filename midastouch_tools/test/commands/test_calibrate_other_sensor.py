"""Presses of a real DIGIT, turned: as a sensor whose lamps stand elsewhere would show them."""

import json
from pathlib import Path

import cv2
import pytest

from midastouch_perception import sensor_model
from midastouch_tools import cli

BALL = 6e-3


@pytest.fixture
def presses(shared, tmp_path):
    folder = tmp_path / "presses"
    folder.mkdir()
    for file in sorted((shared / "data/digit_real/sphere_presses_vocdex").glob("*.png")):
        cv2.imwrite(str(folder / file.name), cv2.rotate(cv2.imread(str(file)), cv2.ROTATE_180))
    return folder


@pytest.mark.slow
def test_a_sensor_with_other_lamps_is_calibrated_as_they_are(presses, tmp_path, capsys):
    digit = (Path(sensor_model.__file__).parent / "sensor_models" / "digit_real.yaml").read_text()
    mine = tmp_path / "mine.yaml"
    mine.write_text("\n".join(line for line in digit.splitlines() if not line.startswith("lamps")))
    command = ["calibrate", str(presses), "--ball-diameter", str(BALL), "--out", str(tmp_path / "kept.npz")]
    assert cli.main([*command, "--sensor", "digit_real"]) == 2
    assert "turned or mirrored" in capsys.readouterr().err
    assert not (tmp_path / "kept.npz").exists()
    assert cli.main([*command, "--sensor", str(mine)]) == 0

    judged = ["evaluate-presses", str(presses), "--ball-diameter", str(BALL), "--sensor", str(mine)]
    told = tmp_path / "told.json"
    assert cli.main([*judged, "--calibration", str(tmp_path / "kept.npz"), "--json", str(told)]) == 0
    summary = json.loads(told.read_text())["summary"]
    assert summary["iou"] > 0.85
    assert 2.4 < summary["felt_radius_mm"] < 3.6
    assert 0.6 < summary["peak_ratio"] < 1.4

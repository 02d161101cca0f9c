"""From a folder of unlabelled presses to a calibration that the node finds."""

import cv2
import numpy as np
import pytest

from midastouch_bringup import cli
from midastouch_perception.ball_calibration.ball import ball_centre, ball_penetration
from midastouch_perception.sensor_calibration import SensorCalibration
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.simulation.randomisation import RandomSensor

RADIUS = 3e-3


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Eight presses of a ball of 6 mm on a simulated DIGIT and one image without contact."""
    path, sensor, rng = tmp_path_factory.mktemp("presses"), SensorModel.load("digit_real"), np.random.default_rng(6)
    rows, columns = np.mgrid[-1:1:320j, -1:1:240j]
    lamps = np.stack([110 - 30 * columns, 110 + 30 * columns, 100 + 30 * rows], axis=-1).astype(np.uint8)
    digit = RandomSensor(sensor, lamps[None], rng)
    heights = [np.zeros((320, 240), np.float32)]
    for u, v in ((70, 70), (170, 80), (120, 130), (60, 190), (180, 190), (120, 240), (70, 260), (170, 260)):
        ball = ball_penetration(ball_centre(u, v, 1.5e-3, RADIUS, sensor), RADIUS, sensor)
        heights.append(np.maximum(ball, 0))
    images, _ = digit.images(np.stack(heights), np.zeros((len(heights), 320, 240, 3), np.float32), rng)
    for i, image in enumerate(images):
        name = f"{i}.png" if i else "background.png"
        cv2.imwrite(str(path / name), np.clip(image, 0, 255).astype(np.uint8)[:, :, ::-1])
    return path


def test_presses_become_a_calibration_under_the_serial_number(folder, tmp_path, capsys):
    arguments = ["calibrate", str(folder), "--ball-diameter", "0.006", "--serial", "D20123"]
    arguments += ["--background-folder", str(tmp_path), "--page", str(tmp_path / "page")]
    assert cli.main(arguments) == 0
    said = capsys.readouterr().out
    kept = SensorCalibration.load(tmp_path / "D20123.calibration.npz")
    assert (kept.serial, kept.ball_diameter, kept.presses) == ("D20123", 0.006, 8)
    assert "calibration from 8 presses" in said
    page = (tmp_path / "page" / "index.html").read_text()
    assert "Calibration of D20123" in page
    assert (tmp_path / "page" / "presses.png").stat().st_size > 20000


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (["--ball-diameter", "0.0024"], "diameter"),
        (["--ball-diameter", "0.02"], "diameter"),
        (["--sensor", "no_such"], "no_such"),
    ],
)
def test_what_does_not_fit_is_refused_and_nothing_kept(folder, tmp_path, capsys, change, said):
    arguments = ["calibrate", str(folder), "--ball-diameter", "0.006", "--out", str(tmp_path / "a.npz"), *change]
    assert cli.main(arguments) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "a.npz").exists()


def test_presses_that_are_not_used_are_named(folder, tmp_path, capsys):
    more = tmp_path / "more"
    more.mkdir()
    for path in folder.iterdir():
        (more / path.name).write_bytes(path.read_bytes())
    (more / "lifted.png").write_bytes((folder / "background.png").read_bytes())
    assert cli.main(["calibrate", str(more), "--ball-diameter", "0.006", "--out", str(tmp_path / "a.npz")]) == 0
    assert "lifted.png: not used: nothing touches the gel" in capsys.readouterr().out


def test_live_needs_the_no_contact_image_of_that_sensor(tmp_path, capsys):
    arguments = ["calibrate", "live", "--ball-diameter", "0.006", "--background-folder", str(tmp_path)]
    assert cli.main([*arguments, "--serial", "D20123"]) == 2
    assert "capture_background" in capsys.readouterr().err
    assert cli.main([*arguments, "--out", str(tmp_path / "a.npz")]) == 2
    assert "--serial" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_somewhere_to_keep_it_is_needed(folder, capsys):
    assert cli.main(["calibrate", str(folder), "--ball-diameter", "0.006"]) == 2
    assert "--serial" in capsys.readouterr().err

"""From presses in a folder, or of a running sensor, to a calibration that the node finds."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from midastouch_perception.sensor_calibration.calibration import SensorCalibration
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn.background_store import BackgroundStore
from midastouch_simulation.camera import no_contact_image
from midastouch_simulation.simulated_digit import PressedSensor
from midastouch_tools import cli

RADIUS = 3e-3


@pytest.fixture(scope="module")
def digit():
    """A simulated DIGIT on which a ball of 6 mm is pressed."""
    sensor, rng = SensorModel.load("digit_real"), np.random.default_rng(3)
    return PressedSensor(sensor, no_contact_image(sensor, rng)[None], RADIUS, rng)


def write(path: Path, image: np.ndarray) -> None:
    cv2.imwrite(str(path), image[:, :, ::-1])


@pytest.fixture(scope="module")
def folder(tmp_path_factory, digit):
    """Five presses, one image of the ball lifted, and the no-contact image."""
    path = tmp_path_factory.mktemp("presses")
    lifted = {"lifted.png": digit.background, "background.png": digit.background}
    for name, image in {**digit.presses(5), **lifted}.items():
        write(path / name, image)
    return path


def test_presses_become_a_calibration_under_the_serial_number(folder, tmp_path, capsys):
    arguments = ["calibrate", str(folder), "--ball-diameter", "0.006", "--serial", "D20123"]
    arguments += ["--background-folder", str(tmp_path), "--page", str(tmp_path / "page")]
    assert cli.main(arguments) == 0
    said = capsys.readouterr().out
    kept = SensorCalibration.load(tmp_path / "D20123.calibration.npz")
    assert (kept.serial, kept.ball_diameter, kept.presses) == ("D20123", 0.006, 5)
    assert "lifted.png: not used: nothing touches the gel" in said
    assert "calibration from 5 presses" in said
    page = (tmp_path / "page" / "index.html").read_text()
    assert "Calibration of D20123" in page
    assert (tmp_path / "page" / "presses.png").stat().st_size > 20000


@pytest.mark.parametrize(
    ("change", "said"), [(["--ball-diameter", "0.002"], "diameter"), (["--sensor", "no_such"], "no_such")]
)
def test_what_does_not_fit_is_refused_and_nothing_kept(folder, tmp_path, capsys, change, said):
    arguments = ["calibrate", str(folder), "--ball-diameter", "0.006", "--out", str(tmp_path / "a.npz"), *change]
    assert cli.main(arguments) == 2
    assert said in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("option", ["--page", "--optics"])
def test_unwritable_paths_are_refused_and_nothing_is_kept(folder, tmp_path, capsys, option):
    (tmp_path / "file").touch()
    arguments = ["calibrate", str(folder), "--ball-diameter", "0.006", "--serial", "D20123"]
    arguments += ["--background-folder", str(tmp_path), option, str(tmp_path / "file" / "a")]
    with pytest.raises(SystemExit, match="2"):
        cli.main(arguments)
    assert f"argument {option}: {tmp_path / 'file' / 'a'}: no" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_without_an_own_no_contact_image_the_sensor_s_is_taken(folder, digit, tmp_path, capsys):
    BackgroundStore(tmp_path, "D20123").save(digit.background)
    presses = tmp_path / "presses"
    presses.mkdir()
    for path in folder.glob("[0-9]*.png"):
        (presses / path.name).write_bytes(path.read_bytes())
    arguments = ["calibrate", str(presses), "--ball-diameter", "0.006", "--serial", "D20123"]
    assert cli.main([*arguments, "--background-folder", str(tmp_path)]) == 0
    assert "D20123.png: taken for the no-contact image" in capsys.readouterr().out


def test_a_scale_tdn_would_not_use_is_refused_for_a_serial(folder, tmp_path, capsys):
    arguments = ["calibrate", str(folder), "--ball-diameter", "0.006", "--serial", "D20123", "--px-per-mm", "19.5"]
    assert cli.main([*arguments, "--background-folder", str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert "focal 429.0" in said
    assert "--sensor" in said
    assert list(tmp_path.iterdir()) == []


def test_presses_of_no_whole_ball_are_refused_with_the_reason(digit, tmp_path, capsys):
    presses = tmp_path / "presses"
    presses.mkdir()
    for name in ("background", *range(5)):
        write(presses / f"{name}.png", digit.background)
    arguments = ["calibrate", str(presses), "--ball-diameter", "0.006", "--serial", "D20123"]
    assert cli.main([*arguments, "--background-folder", str(tmp_path / "kept")]) == 2
    said = capsys.readouterr().err
    assert "0 of 5 presses" in said
    assert "0.png and 4 more: " in said
    assert "nothing touches the gel" in said
    (presses / "4.png").unlink()
    assert cli.main([*arguments, "--background-folder", str(tmp_path / "kept")]) == 2
    assert f"{presses}: 4 images" in capsys.readouterr().err
    assert not (tmp_path / "kept").exists()


def test_a_diameter_that_is_doubted_has_to_be_said_to_be_right(folder, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("midastouch_perception.sensor_calibration.fit.diameter_doubt", lambda *_: "feels like 9 mm")
    arguments = ["calibrate", str(folder), "--ball-diameter", "0.006", "--out", str(tmp_path / "a.npz")]
    assert cli.main(arguments) == 2
    assert "feels like 9 mm; measure its diameter" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
    assert cli.main([*arguments, "--diameter-is-right"]) == 0
    assert "warning: feels like 9 mm" in capsys.readouterr().out


@pytest.mark.parametrize("source", [["live"], []])
def test_live_needs_the_no_contact_image_of_that_sensor(tmp_path, capsys, source):
    arguments = ["calibrate", *source, "--ball-diameter", "0.006", "--background-folder", str(tmp_path)]
    assert cli.main([*arguments, "--serial", "D20123"]) == 2
    assert "capture-background" in capsys.readouterr().err
    assert cli.main([*arguments, "--out", str(tmp_path / "a.npz")]) == 2
    assert "--serial" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_somewhere_to_keep_it_is_needed(folder, capsys):
    assert cli.main(["calibrate", str(folder), "--ball-diameter", "0.006"]) == 2
    assert "--serial" in capsys.readouterr().err


def test_a_ball_is_needed(folder, capsys):
    with pytest.raises(SystemExit):
        cli.main(["calibrate", str(folder), "--serial", "D20123"])
    assert "--ball-diameter" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.dds
def test_live_it_guides_until_there_is_a_calibration(graph, digit, tmp_path):
    from press_camera import Camera

    BackgroundStore(tmp_path, "D20123").save(digit.background)
    arguments = ["live", "--ball-diameter", "0.006", "--serial", "D20123", "--background-folder", str(tmp_path)]
    arguments += ["--save", str(tmp_path / "it's"), "--page", str(tmp_path / "page"), "--namespace", "left"]
    command = [sys.executable, "-m", "midastouch_tools.cli", "calibrate", *arguments]
    guide = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=dict(os.environ))
    camera = Camera(graph, "left/image_raw")
    graph.spin_until(lambda: camera.status is not None, "its first word")
    for image in [digit.image([(70, 80, 1.5e-3), (180, 260, 1.5e-3)]), *digit.presses(10).values()]:
        camera.press(image, digit.background)
    said, _ = guide.communicate(timeout=120)
    assert guide.returncode == 0, said
    assert "not taken: two contacts" in said
    assert "10 of 10" not in said
    assert said.splitlines()[-1].endswith("calibration from 10 presses of a ball of 6 mm")
    assert SensorCalibration.load(tmp_path / "D20123.calibration.npz").presses == 10
    assert len(list((tmp_path / "it's").iterdir())) == 11
    assert (tmp_path / "page" / "index.html").exists()


@pytest.mark.slow
@pytest.mark.dds
def test_live_ended_early_names_the_command_for_its_presses(digit, tmp_path):
    BackgroundStore(tmp_path, "D20123").save(digit.background)
    arguments = ["live", "--ball-diameter", "0.006", "--serial", "D20123", "--background-folder", str(tmp_path)]
    command = [sys.executable, "-m", "midastouch_tools.cli", "calibrate", *arguments, "--save", str(tmp_path / "new")]
    guide = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=dict(os.environ))
    assert any("press the ball" in line for line in guide.stdout)
    guide.send_signal(signal.SIGINT)
    said, _ = guide.communicate(timeout=120)
    assert guide.returncode == 1
    options = f"--ball-diameter 0.006 --serial D20123 --background-folder {tmp_path}"
    assert said.splitlines()[-1] == f"midastouch calibrate {tmp_path / 'new'} {options}"

"""From presses in a folder, or of a running sensor, to a calibration that the node finds."""

import re
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


def calibrate(*words) -> int:
    """Calibrate with a ball of 6 mm; the exit status."""
    return cli.main(["calibrate", *map(str, words), "--ball-diameter", "0.006"])


@pytest.fixture
def kept(tmp_path) -> list:
    """The options that keep a calibration for a serial number, in `tmp_path`."""
    return ["--serial", "D20123", "--background-folder", tmp_path]


def test_presses_become_a_calibration_under_the_serial_number(folder, kept, tmp_path, capsys):
    assert calibrate(folder, *kept, "--page", tmp_path / "page") == 0
    said = capsys.readouterr().out
    calibration = SensorCalibration.load(tmp_path / "D20123.calibration.npz")
    assert (calibration.serial, calibration.ball_diameter, calibration.presses) == ("D20123", 0.006, 5)
    assert "lifted.png: not used: nothing touches the gel" in said
    assert "calibration from 5 presses" in said
    page = (tmp_path / "page" / "index.html").read_text()
    assert "Calibration of D20123" in page
    assert (tmp_path / "page" / "presses.png").stat().st_size > 20000


def test_what_does_not_fit_is_refused_and_nothing_kept(folder, kept, tmp_path, capsys):
    out = ["--out", tmp_path / "a.npz"]
    for words, fix in (
        ([folder, *out, "--sensor", "no_such"], "no_such"),
        ([folder], "--serial"),
        (["none"], "none: no such folder"),
        ([folder, *kept, "--px-per-mm", "19.5"], "focal 429.0.*--sensor"),  # tdn would not use it
        (["live", *kept], "capture-background"),
        (kept, "capture-background"),
        (["live", *out], "--serial"),
        (out, "--serial"),
    ):
        assert calibrate(*words) == 2
        assert re.search(fix, capsys.readouterr().err)
    assert cli.main(["calibrate", str(folder), "--ball-diameter", "0.002", *map(str, out)]) == 2
    assert "diameter" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_without_an_own_no_contact_image_the_sensor_s_is_taken(folder, kept, digit, tmp_path, capsys):
    BackgroundStore(tmp_path, "D20123").save(digit.background)
    presses = tmp_path / "presses"
    presses.mkdir()
    for path in folder.glob("[0-9]*.png"):
        (presses / path.name).write_bytes(path.read_bytes())
    assert calibrate(presses, *kept) == 0
    assert "D20123.png: taken for the no-contact image" in capsys.readouterr().out


def test_presses_of_no_whole_ball_are_refused_with_the_reason(digit, kept, tmp_path, capsys):
    presses = tmp_path / "presses"
    presses.mkdir()
    for name in ("background", *range(5)):
        write(presses / f"{name}.png", digit.background)
    assert calibrate(presses, *kept) == 2
    said = capsys.readouterr().err
    assert "0 of 5 presses" in said
    assert "0.png and 4 more: " in said
    assert "nothing touches the gel" in said
    (presses / "4.png").unlink()
    assert calibrate(presses, *kept) == 2
    assert f"{presses}: 4 images" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == [presses]


def test_a_diameter_that_is_doubted_has_to_be_said_to_be_right(folder, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("midastouch_perception.sensor_calibration.fit.diameter_doubt", lambda *_: "feels like 9 mm")
    words = folder, "--out", tmp_path / "a.npz"
    assert calibrate(*words) == 2
    assert "feels like 9 mm; measure its diameter" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
    assert calibrate(*words, "--diameter-is-right") == 0
    assert "warning: feels like 9 mm" in capsys.readouterr().out


def started(*words) -> subprocess.Popen:
    """The guide through the presses of a running sensor, as a process."""
    command = [sys.executable, "-m", "midastouch_tools.cli", "calibrate", "live", "--ball-diameter", "0.006"]
    return subprocess.Popen([*command, *map(str, words)], stdout=subprocess.PIPE, text=True)


@pytest.mark.slow
@pytest.mark.dds
def test_live_it_guides_until_there_is_a_calibration(graph, digit, kept, tmp_path):
    from press_camera import Camera

    BackgroundStore(tmp_path, "D20123").save(digit.background)
    guide = started(*kept, "--save", tmp_path / "it's", "--page", tmp_path / "page", "--namespace", "left")
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
def test_live_ended_early_names_the_command_for_its_presses(digit, kept, tmp_path):
    BackgroundStore(tmp_path, "D20123").save(digit.background)
    guide = started(*kept, "--save", tmp_path / "new")
    assert any("press the ball" in line for line in guide.stdout)
    guide.send_signal(signal.SIGINT)
    said, _ = guide.communicate(timeout=120)
    assert guide.returncode == 1
    options = f"--ball-diameter 0.006 --serial D20123 --background-folder {tmp_path}"
    assert said.splitlines()[-1] == f"midastouch calibrate {tmp_path / 'new'} {options}"

"""Reports of `midastouch evaluate-perception`."""

import json

import cv2
import numpy as np
import pytest

from midastouch_benchmark.tables.perception import commanded_depth, soft_gel
from midastouch_perception.sensor_calibration.calibration import SensorCalibration, background_colours
from midastouch_perception.sensor_model import SensorModel
from midastouch_simulation.camera import no_contact_image
from midastouch_simulation.simulated_digit import PressedSensor
from midastouch_tools import cli

RADIUS = 3e-3


@pytest.fixture(scope="module")
def digit():
    """A simulated DIGIT on which a ball of 6 mm is pressed."""
    sensor, rng = SensorModel.load("digit_real"), np.random.default_rng(1)
    return PressedSensor(sensor, no_contact_image(sensor, rng)[None], RADIUS, rng)


@pytest.fixture(scope="module")
def presses(digit):
    return digit.presses(6)


def write(folder, images, background):
    folder.mkdir()
    for name, image in {**images, "background.png": background}.items():
        cv2.imwrite(str(folder / name), image[:, :, ::-1])
    return str(folder)


def evaluate(folder, tmp_path, *more):
    """Exit code and JSON."""
    out = tmp_path / "out.json"
    code = cli.main(["evaluate-perception", "presses", folder, "--ball-diameter", "0.006", "--json", str(out), *more])
    return code, json.loads(out.read_text()) if out.is_file() else None


def test_images_that_show_no_press_are_named_and_left_out(digit, presses, tmp_path, capsys):
    spoiled = {
        "black.png": (np.zeros_like(digit.background), "black"),
        "bright.png": (np.full_like(digit.background, 255), "saturated"),
        "free.png": (digit.background, "nothing touches the gel"),
        "other.png": (np.roll(digit.background, 60, axis=1), "differs everywhere"),
        "turned.png": (np.ascontiguousarray(presses["01.png"][::-1, ::-1]), "upside down"),
    }
    again = {"again.png": next(iter(presses.values()))}
    folder = write(tmp_path / "presses", presses | again | {n: i for n, (i, _) in spoiled.items()}, digit.background)
    code, result = evaluate(folder, tmp_path)
    said = capsys.readouterr().out
    assert code == 0
    problems = {each["image"]: each["problem"] for each in result["unusable"]}
    assert len(problems) == 6
    for name, (_, problem) in spoiled.items():
        assert problem in problems[name]
        assert any(line.startswith(f"{name}: ") for line in said.splitlines())
    assert sum("the same image as" in problem for problem in problems.values()) == 1
    assert result["summary"]["presses"] == 6


@pytest.mark.parametrize(("level", "problem"), [(0, "black"), (255, "saturated")])
def test_presses_without_a_sensor_are_refused(digit, presses, tmp_path, capsys, level, problem):
    spoiled = {f"{i}.png": np.full_like(digit.background, abs(level - i)) for i in range(3)}
    assert evaluate(write(tmp_path / "a", spoiled, digit.background), tmp_path)[0] == 2
    assert f"0.png: {problem}" in capsys.readouterr().err
    assert evaluate(write(tmp_path / "b", presses, spoiled["0.png"]), tmp_path)[0] == 2
    error = capsys.readouterr().err
    assert "background.png" in error
    assert problem in error


def test_without_labels_the_images_tell_the_depth(digit, presses, tmp_path, capsys):
    cut = {"cut.png": digit.image([(8, 160, 1.6e-3)])}
    code, result = evaluate(write(tmp_path / "presses", presses | cut, digit.background), tmp_path)
    said = capsys.readouterr().out
    assert code == 0
    assert (result["summary"]["truth"], result["summary"]["labelled"]) == ("images", False)
    assert result["depth_problem"] == ""
    assert [each["image"] for each in result["unfitted"]] == ["cut.png"]
    assert any(line.startswith("cut.png: ") and "edge" in line for line in said.splitlines())
    judged = {row["image"]: row["ideal_peak_mm"] is not None for row in result["presses"]}
    assert judged == {**dict.fromkeys(presses, True), "cut.png": False}
    assert "images" in next(line for line in said.splitlines() if line.startswith("outline")).split()


def test_where_images_tell_no_ball_depth_is_not_judged(digit, presses, tmp_path, capsys):
    few = dict(list(presses.items())[:3])
    code, result = evaluate(write(tmp_path / "presses", few, digit.background), tmp_path)
    said = capsys.readouterr().out
    assert code == 0
    assert result["summary"]["truth"] == "felt outline"
    assert "3 images; calibration needs 5" in result["depth_problem"]
    assert any("no circles.csv" in line and "3 images" in line for line in said.splitlines())
    assert next(line for line in said.splitlines() if line.startswith("RMSE inside")).split()[-1] == "-"


def test_a_calibration_of_another_gel_is_refused(digit, presses, tmp_path, capsys):
    sensor, file = SensorModel.load("digit_real"), tmp_path / "other.npz"
    other = no_contact_image(sensor, np.random.default_rng(8))[:, ::-1]
    made = {"serial": "", "ball_diameter": 6e-3, "sensor": sensor.name, "presses": 5}
    made |= {"pixel_size": sensor.pixel_size, "coefficients": np.zeros((12, 6, 2)), "date": "2026-11-23"}
    SensorCalibration(**made, background=background_colours(other)).save(file)
    folder = write(tmp_path / "presses", presses, digit.background)
    assert evaluate(folder, tmp_path, "--calibration", str(file))[0] == 2
    assert "other.npz: " in capsys.readouterr().err


@pytest.fixture(scope="module")
def gel(tmp_path_factory):
    told = tmp_path_factory.mktemp("gel") / "gel.json"
    few = ["--objects", "eyebolt", "--touches", "3", "--presses", "3"]
    assert cli.main(["evaluate-perception", "gel", *few, "--json", str(told)]) == 0
    return json.loads(told.read_text())


@pytest.mark.slow
def test_every_gel_sees_the_same_touches_and_presses(gel):
    kinds = {(row["sensor"], row["calibrated"], row["thickness_mm"]) for row in gel["touches"]}
    assert len(kinds) == 2 * 2 * 4
    assert soft_gel(gel)["gel"].tolist() == 2 * ["as fitted", "elastic, 1.5 mm", "elastic, 3 mm", "elastic, 6 mm"]
    assert commanded_depth(gel)["presses"].tolist() == 16 * ["6"]
    assert len(gel["touches"]) == 3 * len(kinds)
    for press in ("ball", "flat face"):
        commanded = [row["commanded_mm"] for row in gel["presses"] if row["press"] == press]
        assert len(commanded) == 3 * len(kinds)
        assert len(set(commanded)) == 3
        assert all(0.1 < each < 1.05 for each in commanded)


@pytest.mark.slow
def test_thicker_gel_gives_way_further_beside_a_touch(gel):
    """So the outline is smaller, and a pose that ends at it lies further out."""

    def mean(thickness_mm: float, key: str) -> float:
        values = [row[key] for row in gel["touches"] if row["thickness_mm"] == thickness_mm and key in row]
        return sum(values) / len(values)

    assert mean(6.0, "area") < mean(1.5, "area")
    assert mean(6.0, "normal_mm") > mean(1.5, "normal_mm") + 0.1


@pytest.mark.slow
def test_tables_of_checks_show_what_the_json_holds(shared, tmp_path, capsys):
    told = tmp_path / "checks.json"
    backgrounds = str(shared / "data/digit_backgrounds")
    assert cli.main(["evaluate-perception", "checks", backgrounds, "--sensors", "1", "--json", str(told)]) == 0
    printed, result = capsys.readouterr().out, json.loads(told.read_text())
    assert set(result["fit_check"]) <= {line.split("  ")[0] for line in printed.splitlines()}
    assert len(result["ball_diameter"]["given"]) > 2
    assert "refused unless said to be right" in printed


def test_the_former_commands_still_work():
    parser = cli.build_parser()
    required = {"tdn": ["a"], "presses": ["a", "--ball-diameter", "0.006"], "gel": [], "checks": ["a"]}
    for report, given in required.items():
        former = vars(parser.parse_args([f"evaluate-{report}", *given]))
        assert former == vars(parser.parse_args(["evaluate-perception", report, *given]))

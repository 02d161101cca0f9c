"""The guide through the presses of a running sensor: over DDS, and what it keeps."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from press_camera import Camera
from process_rig import processes
from std_srvs.srv import Trigger

from midastouch_common.errors import InputError
from midastouch_perception.nodes.calibrate import CalibrateNode
from midastouch_perception.nodes.tdn import TdnNode
from midastouch_perception.sensor_calibration.calibration import SensorCalibration
from midastouch_perception.tdn.background_store import BackgroundStore

pytestmark = pytest.mark.dds
SERIAL, DIAMETER = "D20123", 6e-3


@pytest.fixture(scope="module")
def digit(another_digit):
    return another_digit(10)


@pytest.fixture(scope="module")
def presses(digit):
    return list(digit.presses(5).values())


@pytest.fixture
def folder(tmp_path, digit):
    """With the sensor's no-contact image in it."""
    BackgroundStore(tmp_path, SERIAL).save(digit.background)
    return tmp_path


def parameters(folder, **more) -> dict:
    """The node's, for that sensor."""
    known = {"serial": SERIAL, "ball_diameter": DIAMETER, "presses": 5, "background_folder": str(folder)}
    return {**known, **more}


@pytest.mark.slow
def test_a_process_guides_the_presses_and_tdn_uses_the_result(graph, folder, digit, presses, tmp_path):
    guide = {"calibrate": ["-m", "midastouch_perception.nodes.calibrate"]}
    with processes(guide, {"calibrate": parameters(folder)}, tmp_path):
        camera = Camera(graph)
        graph.spin_until(lambda: camera.status is not None, "its first word")
        assert camera.status.hardware_id == SERIAL
        camera.hold(digit.background, lambda: camera.status.message == "0 of 5: press the ball at the top left")
        assert camera.values["region"] == "top left"
        two = digit.image([(60, 70, 1.4e-3), (180, 250, 1.4e-3)])
        camera.press(two, digit.background)
        assert camera.values["thrown_away_1"] == "two contacts"
        assert camera.values["taken"] == "0"
        for image in presses:
            camera.press(image, digit.background)
        graph.spin_until(lambda: "tdn uses it at its next start" in camera.status.message, "the calibration")
    kept = SensorCalibration.load(folder / f"{SERIAL}.calibration.npz")
    assert (kept.serial, kept.presses) == (SERIAL, 5)

    graph.add(TdnNode, {"sensor_model": "digit_real", "serial": SERIAL, "background_folder": str(folder)})
    health = graph.health()
    graph.spin_until(lambda: "calibration" in health.values, "tdn's word")
    assert health.values["calibration"].startswith("5 presses of a ball of 6 mm")


@pytest.fixture
def live(graph, folder):
    """The node here, and a camera."""
    node = graph.add(CalibrateNode, parameters(folder, presses=10))
    camera = Camera(graph)
    graph.spin_until(lambda: camera.status is not None)
    return node, camera


@pytest.mark.usefixtures("brisk_health")
def test_too_few_presses_are_refused_and_nothing_is_kept(graph, live, folder, digit, presses):
    node, camera = live
    camera.press(presses[0], digit.background)
    answer = graph.call(Trigger, "calibrate/calibrate", Trigger.Request())
    assert not answer.success
    assert "5 to 40" in answer.message
    assert not node.failure  # there are more presses to come
    assert camera.status.message.startswith("1 of 10: press the ball")
    assert [path.name for path in folder.iterdir()] == [f"{SERIAL}.png"]
    answer = graph.call(Trigger, "calibrate/restart", Trigger.Request())
    assert answer.success
    assert answer.message == "0 of 10: press the ball at the top left"
    assert node.images == {}
    graph.spin_until(lambda: camera.status.level == DiagnosticStatus.OK, "the new beginning")


@pytest.mark.usefixtures("brisk_health")
def test_rolled_images_are_no_presses(live, digit, presses):
    node, camera = live
    camera.hold(np.roll(presses[0], 80, axis=1), lambda: "misplaced_images" in camera.values)
    assert "are rolled by 80 px right" in camera.status.message
    camera.press(presses[0], digit.background)
    assert len(node.images) == 1


@pytest.mark.usefixtures("brisk_health")
def test_images_that_stay_away_are_asked_for_until_they_come(graph, folder, digit, monkeypatch):
    monkeypatch.setattr("midastouch_perception.nodes.calibrate.SILENT_S", 0.2)
    said = []
    graph.add(CalibrateNode, parameters(folder), say=said.append)
    camera = Camera(graph)
    missed = "no images on /image_raw: "
    graph.spin_until(lambda: camera.status and camera.status.message.startswith(missed), "that they are missed")
    assert camera.status.level == DiagnosticStatus.WARN
    assert said[-1].startswith(missed)
    camera.hold(digit.background, lambda: camera.status.level == DiagnosticStatus.OK)
    camera.hold(np.zeros((10, 10, 3), np.uint8), lambda: "bad_images" in camera.values)
    graph.spin_until(lambda: camera.status.message.endswith(" publishes it, but sends none"), "that the cable is out")


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"ball_diameter": 0.0}, "ball's diameter in metres"),
        ({"ball_diameter": 0.02}, "smaller ball"),
        ({"serial": ""}, "serial number"),
        ({"serial": "D1"}, "capture-background"),
        ({"sensor_model": "no_such"}, "no_such"),
        ({"px_per_mm": 19.5}, "sensor model of your own"),
        ({"out": "/dev/null/mine.npz"}, "no file can be written there"),
    ],
)
def test_what_it_cannot_start_with_is_named(graph, folder, wrong, said):
    with pytest.raises(InputError, match=said):
        graph.add(CalibrateNode, parameters(folder, **wrong))
    BackgroundStore(folder, SERIAL).save(np.full((320, 240, 3), 255, np.uint8))
    with pytest.raises(InputError, match=r"saturated.*capture_background"):
        graph.add(CalibrateNode, parameters(folder))


def test_presses_are_written_when_taken_beside_earlier_ones(graph, folder, digit, presses):
    kept = folder / "presses"
    kept.mkdir()
    (kept / "press_09.png").write_bytes(b"of another gel")
    node = graph.add(CalibrateNode, parameters(folder, presses_folder=str(kept)))
    camera = Camera(graph)
    graph.spin_until(lambda: camera.status is not None)
    camera.press(presses[0], digit.background)
    assert [path.name for path in kept.iterdir()] == ["press_09.png"]
    assert node.presses_folder == folder / "presses_2"
    assert sorted(path.name for path in node.presses_folder.iterdir()) == ["background.png", "press_00.png"]

    newer = np.clip(digit.background.astype(int) + 9, 0, 255).astype(np.uint8)
    BackgroundStore(folder, SERIAL).save(newer)
    assert graph.call(Trigger, "calibrate/restart", Trigger.Request()).success
    kept = cv2.cvtColor(cv2.imread(str(node.presses_folder / "background.png")), cv2.COLOR_BGR2RGB)
    np.testing.assert_array_equal(kept, newer)

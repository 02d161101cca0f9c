"""The page on other sensors, against the code: its examples are read, its commands exist."""

from pathlib import Path

import pytest
import yaml
from documents import DOCUMENTS, blocks

from digit_driver.camera_model import CameraModel
from digit_driver.nodes.parameters import PARAMETERS
from midastouch_perception.sensor_model import SensorModel

PAGE = DOCUMENTS["docs/other_sensors.md"]


@pytest.fixture
def examples(tmp_path) -> dict[str, Path]:
    """The YAML files of the page by the name in their first line."""
    found = {}
    for block in blocks(PAGE, "yaml"):
        path = tmp_path / block.splitlines()[0].removeprefix("# ")
        path.write_text(block)
        found[path.name] = path
    return found


def test_both_examples_are_what_they_say(examples):
    camera = CameraModel.load(examples["my_touch_camera.yaml"])
    assert (camera.label, camera.mode("").output) == ("MyTouch", (240, 320))
    sensor = SensorModel.load(examples["my_touch.yaml"])
    assert (sensor.width, sensor.height) == camera.mode("").output
    _, _, width, height = camera.mode("").crop
    assert width / height == pytest.approx(320 / 240), "square pixels"


def test_the_parameters_of_the_overlay_exist(examples):
    overlay = yaml.safe_load(examples["mini.yaml"].read_text())
    assert overlay["digit_driver"]["ros__parameters"].keys() <= {parameter.name for parameter in PARAMETERS}

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from midastouch_common.errors import InputError
from midastouch_perception.tdn.background_store import BackgroundStore, default_folder


@pytest.fixture
def image() -> np.ndarray:
    return np.random.default_rng(0).integers(0, 255, (320, 240, 3), dtype=np.uint8)


def test_each_sensor_gets_its_own_image_back_bit_by_bit(tmp_path, image):
    BackgroundStore(tmp_path / "new", "D20001").save(image)
    BackgroundStore(tmp_path / "new", "D20002").save(image[::-1])
    np.testing.assert_array_equal(BackgroundStore(tmp_path / "new", "D20001").load(320, 240), image)
    np.testing.assert_array_equal(BackgroundStore(tmp_path / "new", "D20002").load(320, 240), image[::-1])
    assert BackgroundStore(tmp_path / "new", "D20003").load(320, 240) is None
    assert sorted(p.name for p in (tmp_path / "new").iterdir()) == ["D20001.png", "D20002.png"]


def test_the_last_one_counts(tmp_path, image):
    store = BackgroundStore(tmp_path, "D20001")
    store.save(image)
    store.save(255 - image)
    np.testing.assert_array_equal(store.load(320, 240), 255 - image)


@pytest.mark.parametrize("serial", ["", "..", "../D1", "a/b", "/D1", ".hidden", "D1\n", "D" * 65])
def test_serials_that_would_leave_the_folder_are_refused(tmp_path, serial):
    with pytest.raises(InputError, match="not a serial number"):
        BackgroundStore(tmp_path, serial)


def test_a_damaged_or_foreign_file_is_named(tmp_path, image):
    store = BackgroundStore(tmp_path, "D20001")
    store.save(image)
    with pytest.raises(InputError, match=r"240 x 320 pixels, the sensor model has 480 x 640"):
        store.load(640, 480)
    store.path.write_bytes(b"no image")
    with pytest.raises(InputError, match=r"D20001\.png"):
        store.load(320, 240)


def test_what_cannot_be_written_leaves_the_last_one(tmp_path, image):
    blocked = tmp_path / "file"
    blocked.write_text("in the way")
    with pytest.raises(InputError, match="was not kept"):
        BackgroundStore(blocked, "D20001").save(image)
    assert blocked.read_text() == "in the way"


def test_the_folder_is_where_ros_remembers(monkeypatch, tmp_path):
    monkeypatch.setenv("ROS_HOME", str(tmp_path))
    assert default_folder() == tmp_path / "midastouch" / "backgrounds"
    monkeypatch.delenv("ROS_HOME")
    assert default_folder() == Path("~/.ros/midastouch/backgrounds").expanduser()

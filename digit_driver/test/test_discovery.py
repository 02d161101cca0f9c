import subprocess
import sys
from pathlib import Path

import pytest
from fake_kernel import FakeDigit

from digit_driver.camera_model import CameraModel
from digit_driver.discovery import find_cameras, select_camera
from digit_driver.frames import DeviceError
from midastouch_common.errors import InputError

DIGIT = CameraModel.load("digit")


def test_no_video_devices_at_all(tmp_path: Path) -> None:
    assert find_cameras(DIGIT, tmp_path / "class/video4linux") == []


def test_finds_digits_with_serial_firmware_and_all_nodes(kernel, find) -> None:
    kernel.plug(FakeDigit("D20002", "1-2", number=9))
    kernel.plug(FakeDigit("D20001", "2-1.3", number=0, revision="0150"))
    kernel.plug(FakeDigit("W1", "1-9", number=4, vendor="046d"))
    first, second = find(DIGIT)
    assert (first.serial, first.firmware, first.usb_path) == ("D20001", 150, "2-1.3")
    assert second.serial == "D20002"
    # By number, not by name: 9 comes before 10.
    assert [str(node) for node in second.nodes] == ["/dev/video9", "/dev/video10"]


def test_unreadable_firmware_and_missing_serial_are_not_fatal(kernel, find) -> None:
    kernel.plug(FakeDigit("", revision="02a0"))
    (digit,) = find(DIGIT)
    assert (digit.serial, digit.firmware) == ("", None)


def test_dangling_entry_is_ignored(kernel, find) -> None:
    (kernel.sysfs / "video7").symlink_to(kernel.root / "nowhere")
    assert find(DIGIT) == []


def test_several_without_serial_are_refused_and_listed(kernel, find) -> None:
    kernel.plug(FakeDigit("D20001", "1-1", number=0))
    kernel.plug(FakeDigit("D20002", "1-2", number=2))
    with pytest.raises(InputError, match=r"2 DIGITs.*D20001.*D20002.*Set `serial`"):
        select_camera(DIGIT, find(DIGIT), "")
    assert select_camera(DIGIT, find(DIGIT), "D20002").usb_path == "1-2"


def test_absent_one_may_come_later_and_those_present_are_listed(kernel, find) -> None:
    with pytest.raises(DeviceError, match="no DIGIT found"):
        select_camera(DIGIT, find(DIGIT), "")
    kernel.plug(FakeDigit("D20001"))
    with pytest.raises(DeviceError, match=r"no DIGIT D9.*D20001"):
        select_camera(DIGIT, find(DIGIT), "D9")


def test_two_with_one_serial_need_a_device_node(kernel, find) -> None:
    kernel.plug(FakeDigit("D1", "1-1", number=0))
    kernel.plug(FakeDigit("D1", "1-2", number=2))
    with pytest.raises(InputError, match="video_device"):
        select_camera(DIGIT, find(DIGIT), "D1")


def test_a_camera_may_be_told_by_its_product_name(kernel, find) -> None:
    kernel.plug(FakeDigit("D20001", "1-1", number=0))
    kernel.plug(FakeDigit("28GHEJZ8", "1-2", number=2, vendor="1234", product="GelSight Mini R0B 28GH-EJZ8"))
    kernel.plug(FakeDigit("W1", "1-3", number=4, vendor="1234", product="Integrated Webcam"))
    mini = CameraModel.load("gelsight_mini")
    assert [camera.serial for camera in find(mini)] == ["28GHEJZ8"]
    assert [camera.serial for camera in find(DIGIT)] == ["D20001"]
    with pytest.raises(DeviceError, match=r"no GelSight Mini X found on USB \(name 'GelSight Mini \.\.\.'\)"):
        select_camera(mini, find(mini), "X")


def test_a_model_that_is_none_is_one_line_and_exit_code_2() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "digit_driver.discovery", "bogus"], capture_output=True, text=True, timeout=60
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert "bogus is not known" in done.stderr
    assert "Traceback" not in done.stderr

"""Discovery of the plugged-in sensors of one camera model in sysfs, without udev and without opening a device.

``python -m digit_driver.discovery [MODEL]`` lists them.
"""

from __future__ import annotations

import argparse
import re
import sys
from dataclasses import dataclass
from pathlib import Path

from midastouch_common.errors import InputError

from .camera_model import CameraModel
from .frames import DeviceError

SYSFS_VIDEO = Path("/sys/class/video4linux")
DEV = Path("/dev")


@dataclass(frozen=True)
class UsbCamera:
    """One plugged-in sensor.

    Attributes:
        serial: its serial number, e.g. ``D20123``; empty if the firmware gives none.
        firmware: revision (``bcdDevice`` read as a decimal number, e.g. 212), None if unreadable.
        nodes: its ``/dev/video*`` nodes in numerical order. UVC cameras own several, of which only one gives
            images; which one is known after asking the driver (``VIDIOC_QUERYCAP``).
        usb_path: the bus address, e.g. ``1-4.2``; distinguishes sensors without a serial.
    """

    serial: str
    firmware: int | None
    nodes: tuple[Path, ...]
    usb_path: str

    def __str__(self) -> str:
        nodes = ", ".join(str(node) for node in self.nodes)
        return f"{self.serial or '(no serial)'} at USB {self.usb_path}: {nodes}"


def find_cameras(model: CameraModel, sysfs: Path = SYSFS_VIDEO, dev: Path = DEV) -> list[UsbCamera]:
    """Return all sensors of a model that are present, sorted by serial and bus address."""
    nodes_of: dict[Path, list[Path]] = {}
    for entry in sysfs.glob("video*"):
        usb = _usb_device(entry)
        if usb is not None and _is_of(usb, model):
            nodes_of.setdefault(usb, []).append(dev / entry.name)
    cameras = [_describe(usb, nodes) for usb, nodes in nodes_of.items()]
    return sorted(cameras, key=lambda camera: (camera.serial, camera.usb_path))


def select_camera(model: CameraModel, cameras: list[UsbCamera], serial: str) -> UsbCamera:
    """Select one of the sensors that are plugged in.

    Parameters
    ----------
    model
        Kind of sensor, for messages.
    cameras
        Result of `find_cameras`.
    serial
        Serial number; empty for the only sensor that is present.

    Raises
    ------
    DeviceError
        It is not plugged in (it may be later).
    InputError
        Several sensors match, so the user must choose one.
    """
    matching = [camera for camera in cameras if not serial or camera.serial == serial]
    if len(matching) == 1:
        return matching[0]
    listing = "; ".join(str(camera) for camera in cameras)
    if not matching:
        wanted = f"{model.label} {serial}" if serial else model.label
        present = f" Present: {listing}." if cameras else ""
        raise DeviceError(f"no {wanted} found on USB ({model.usb}).{present} Check the cable; `lsusb` must list it.")
    if serial:
        raise InputError(
            f"serial: {len(matching)} {model.label}s carry the serial {serial} ({listing}). "
            "Set `video_device` to the one to use, e.g. a path below /dev/v4l/by-path."
        )
    raise InputError(f"serial: {len(matching)} {model.label}s are plugged in ({listing}). Set `serial` to one of them.")


def find_by_node(node: Path, cameras: list[UsbCamera]) -> UsbCamera | None:
    """Return the sensor that owns a device node (links are followed); None if none of them does."""
    resolved = node.resolve()
    return next((camera for camera in cameras if resolved in [path.resolve() for path in camera.nodes]), None)


def _usb_device(entry: Path) -> Path | None:
    """Return the USB device above a video4linux entry: the nearest ancestor that has a vendor id."""
    try:
        start = (entry / "device").resolve(strict=True)
    except OSError:
        return None
    return next((path for path in (start, *start.parents) if (path / "idVendor").is_file()), None)


def _attribute(directory: Path, name: str) -> str:
    # A device may vanish between listing and reading it; then it has no attributes.
    try:
        return (directory / name).read_text(encoding="ascii", errors="replace").strip()
    except OSError:
        return ""


def _is_of(usb: Path, model: CameraModel) -> bool:
    usb_id = _attribute(usb, "idVendor").lower(), _attribute(usb, "idProduct").lower()
    return usb_id in model.usb_ids or bool(model.product and _attribute(usb, "product").startswith(model.product))


def _describe(usb: Path, nodes: list[Path]) -> UsbCamera:
    revision = _attribute(usb, "bcdDevice")
    return UsbCamera(
        serial=_attribute(usb, "serial"),
        firmware=int(revision) if revision.isdecimal() else None,
        nodes=tuple(sorted(nodes, key=_number)),
        usb_path=usb.name,
    )


def _number(node: Path) -> int:
    digits = re.search(r"\d+$", node.name)
    return int(digits.group()) if digits else -1


def main() -> int:
    """Print one line per sensor of the model that the argument names (default digit); exit code 1 without any, 2 for
    an argument that names no model."""
    parser = argparse.ArgumentParser("python -m digit_driver.discovery", description="list the sensors on USB")
    parser.add_argument("camera_model", nargs="?", default="digit", help="shipped model or YAML file (default digit)")
    try:
        model = CameraModel.load(parser.parse_args().camera_model)
    except InputError as error:
        print(error, file=sys.stderr)
        return 2
    cameras = find_cameras(model)
    for camera in cameras:
        print(f"{camera} (firmware {camera.firmware})")
    if not cameras:
        print(f"no {model.label} found on USB ({model.usb})")
    return 0 if cameras else 1


if __name__ == "__main__":
    raise SystemExit(main())

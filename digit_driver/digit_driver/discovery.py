"""Finds the DIGITs plugged into this machine by reading sysfs, without udev and without opening them.

``python -m digit_driver.discovery`` lists them.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from .errors import DeviceError, InputError

DIGIT_USB_ID = ("2833", "0209")
SYSFS_VIDEO = Path("/sys/class/video4linux")
DEV = Path("/dev")


@dataclass(frozen=True)
class UsbDigit:
    """One plugged-in sensor.

    Attributes:
        serial: its serial number, e.g. ``D20123``; empty if the firmware gives none.
        firmware: revision (``bcdDevice`` read as a decimal number, e.g. 212), None if unreadable.
        nodes: its ``/dev/video*`` nodes in numerical order. UVC cameras own several, of which only one gives
            images; which one is known after asking the driver (``VIDIOC_QUERYCAP``).
        usb_path: the bus address, e.g. ``1-4.2``; tells sensors without a serial apart.
    """

    serial: str
    firmware: int | None
    nodes: tuple[Path, ...]
    usb_path: str

    def __str__(self) -> str:
        nodes = ", ".join(str(node) for node in self.nodes)
        return f"{self.serial or '(no serial)'} at USB {self.usb_path}: {nodes}"


def find_digits(sysfs: Path = SYSFS_VIDEO, dev: Path = DEV) -> list[UsbDigit]:
    """All DIGITs present, sorted by serial and bus address."""
    nodes_of: dict[Path, list[Path]] = {}
    for entry in sysfs.glob("video*"):
        usb = _usb_device(entry)
        if usb is not None and _usb_id(usb) == DIGIT_USB_ID:
            nodes_of.setdefault(usb, []).append(dev / entry.name)
    digits = [_describe(usb, nodes) for usb, nodes in nodes_of.items()]
    return sorted(digits, key=lambda digit: (digit.serial, digit.usb_path))


def select_digit(digits: list[UsbDigit], serial: str) -> UsbDigit:
    """The one sensor meant by ``serial``; an empty serial means the only one present.

    Raises:
        DeviceError: it is not plugged in (it may be later).
        InputError: several sensors answer to the request, so the user must say which.
    """
    matching = [digit for digit in digits if not serial or digit.serial == serial]
    if len(matching) == 1:
        return matching[0]
    listing = "; ".join(str(digit) for digit in digits)
    if not matching:
        wanted = f"DIGIT {serial}" if serial else "DIGIT"
        present = f" Present: {listing}." if digits else ""
        raise DeviceError(
            f"no {wanted} found on USB (id {':'.join(DIGIT_USB_ID)}).{present} Check the cable; "
            f"`lsusb -d {':'.join(DIGIT_USB_ID)}` must list it."
        )
    if serial:
        raise InputError(
            f"serial: {len(matching)} DIGITs carry the serial {serial} ({listing}). "
            "Set `video_device` to the one to use, e.g. a path below /dev/v4l/by-path."
        )
    raise InputError(f"serial: {len(matching)} DIGITs are plugged in ({listing}). Set `serial` to the one to use.")


def find_by_node(node: Path, digits: list[UsbDigit]) -> UsbDigit | None:
    """The sensor that owns the given device node (links are followed), None if it is not a known DIGIT."""
    resolved = node.resolve()
    return next((digit for digit in digits if resolved in [path.resolve() for path in digit.nodes]), None)


def _usb_device(entry: Path) -> Path | None:
    """The USB device above a video4linux entry: the nearest ancestor that has a vendor id."""
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


def _usb_id(usb: Path) -> tuple[str, str]:
    return _attribute(usb, "idVendor").lower(), _attribute(usb, "idProduct").lower()


def _describe(usb: Path, nodes: list[Path]) -> UsbDigit:
    revision = _attribute(usb, "bcdDevice")
    return UsbDigit(
        serial=_attribute(usb, "serial"),
        firmware=int(revision) if revision.isdecimal() else None,
        nodes=tuple(sorted(nodes, key=_number)),
        usb_path=usb.name,
    )


def _number(node: Path) -> int:
    digits = re.search(r"\d+$", node.name)
    return int(digits.group()) if digits else -1


def main() -> int:
    """Prints one line per sensor; exit code 1 when there is none."""
    digits = find_digits()
    for digit in digits:
        print(f"{digit} (firmware {digit.firmware})")
    if not digits:
        print(f"no DIGIT found on USB (id {':'.join(DIGIT_USB_ID)})")
    return 0 if digits else 1


if __name__ == "__main__":
    raise SystemExit(main())

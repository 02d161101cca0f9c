"""A tactile camera on Video4Linux2: found by serial, lit, and its images turned upright."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from midastouch_common.errors import InputError
from midastouch_common.torn_frames import TornFrames

from . import videodev2 as v4l2
from .camera_model import CameraMode, CameraModel, decode
from .discovery import UsbCamera, find_by_node, find_cameras, select_camera
from .frames import CorruptFrameError, DeviceError, Frame, SourceInfo
from .v4l2_stream import FilledBuffer, V4l2Stream

MAX_LED_LEVEL = 15
"""Largest brightness of an LED: a DIGIT's three have four bits each, packed into one control, its firmware's zoom."""
FIRST_FIRMWARE_WITH_RGB = 200
_OLDEST_CREDIBLE_STAMP_NS = 2_000_000_000


@dataclass(frozen=True)
class V4l2Settings:
    """Settings with which to open the sensor.

    Attributes:
        camera: the kind of sensor.
        serial: of the sensor; empty for the only one present.
        video_device: device node to use; empty for searching. If `serial` is another sensor's, that one is used.
        resolution: name of one of the camera's modes; empty for the first.
        fps: one of that mode's rates; 0 for the first.
        leds: brightness of red, green and blue, 0...15.
        use_buffer_timestamps: take the kernel's time of a frame; otherwise the time of fetching it.

    Raises:
        InputError: resolution and frame rate do not exist together.
    """

    camera: CameraModel = field(default_factory=lambda: CameraModel.load("digit"))
    serial: str = ""
    video_device: str = ""
    resolution: str = ""
    fps: int = 0
    leds: tuple[int, int, int] = (MAX_LED_LEVEL, MAX_LED_LEVEL, MAX_LED_LEVEL)
    use_buffer_timestamps: bool = True

    def __post_init__(self) -> None:
        rates = self.mode.fps
        if self.fps and self.fps not in rates:
            allowed = " or ".join(map(str, rates))
            at = f" at {self.resolution}" if self.resolution else ""
            raise InputError(f"fps: a {self.camera.label} gives {allowed} frames per second{at}, got {self.fps}")

    @property
    def mode(self) -> CameraMode:
        """Mode of that resolution."""
        return self.camera.mode(self.resolution)


class V4l2Camera:
    """The sensor itself. One thread opens, reads and closes it; any thread may call ``set_leds``.

    Parameters
    ----------
    settings
    system
        The kernel.
    find
        Lists the sensors of a model that are present. Every ``open`` calls it, since replugging renumbers the nodes.
    """

    def __init__(
        self,
        settings: V4l2Settings,
        system: v4l2.SystemCalls | None = None,
        find: Callable[[CameraModel], list[UsbCamera]] = find_cameras,
    ) -> None:
        self._settings, self._camera, self._mode = settings, settings.camera, settings.mode
        self._rate = settings.fps or self._mode.fps[0]
        self._system = system or v4l2.SystemCalls()
        self._find = find
        self._serial = settings.serial
        self._opened_serial = ""  # of the sensor that was open last
        self._leds = settings.leds
        self._firmware: int | None = None
        self._pixel_format = self._mode.pixel_format
        self._stream: V4l2Stream | None = None
        self._torn = TornFrames()
        # LEDs are set from other threads; the descriptor must not be closed (and reused) under them.
        self._lock = threading.Lock()

    def open(self) -> SourceInfo:
        """Acquire the sensor; afterwards ``read`` gives frames.

        Raises:
            InputError: it can never be opened with these settings.
            DeviceError: it cannot be opened now.
        """
        self.close()
        digit, nodes, warnings = self._locate()
        self._firmware = digit.firmware if digit else None
        stream = V4l2Stream(nodes, self._system)
        with self._lock:
            self._stream = stream
        self._clock_is_good = False  # whether the kernel's stamps have been credible
        self._torn = TornFrames()
        try:
            self._pixel_format = self._agree_on_format(stream)
            fps = stream.set_rate(self._rate)
            warnings += self._light_up()
            stream.start()
        except (DeviceError, InputError):
            self.close()
            raise
        if digit:
            self._serial = self._opened_serial = digit.serial
        if fps != self._rate:
            warnings.append(f"the camera runs at {fps:g} frames per second instead of {self._rate}")
        serial = digit.serial if digit else ""
        return SourceInfo(stream.name, serial, *self._mode.output, fps, tuple(warnings))

    def read(self, timeout: float) -> Frame | None:
        """Wait at most ``timeout`` seconds for the next frame and return it; None if none came.

        Raises:
            CorruptFrameError: a frame came, but damaged, torn, or too late.
            DeviceError: the sensor is gone; close it, and perhaps open it again.
        """
        stream = self._stream
        if stream is None:
            raise DeviceError("the sensor is not open")
        filled = stream.fetch(timeout)
        if filled is None:
            return None
        if filled.damaged:
            raise CorruptFrameError(f"frame {filled.sequence}: the camera reports a damaged transfer")
        mode = self._mode
        decoded = decode(filled.data, self._pixel_format, mode.width, mode.height, mode.reduction)
        image = self._camera.upright(decoded, mode)
        if self._torn.torn(image):
            raise CorruptFrameError(f"frame {filled.sequence}: torn, its parts are of two frames")
        return Frame(image, self._stamp(filled), filled.sequence)

    def close(self) -> None:
        """Release the sensor. May be called at any time and more than once."""
        with self._lock:
            stream, self._stream = self._stream, None
        if stream is not None:
            stream.close()

    def set_leds(self, rgb: tuple[int, int, int]) -> None:
        """Set the LEDs' brightness, 0...15 each, now and after every later ``open``; ignored by cameras without LEDs.

        Raises:
            DeviceError: the camera is there but refuses.
        """
        if not self._camera.leds:
            return
        with self._lock:
            self._leds = rgb
            # While it is unplugged this does nothing: ``open`` lights it when it is back.
            if self._stream is not None:
                # Old firmware has one brightness for all three.
                value = max(rgb) if self._has_old_firmware else rgb[0] << 8 | rgb[1] << 4 | rgb[2]
                self._stream.set_control(v4l2.CID_ZOOM_ABSOLUTE, value, "setting the LEDs")

    def _locate(self) -> tuple[UsbCamera | None, tuple[Path, ...], list[str]]:
        """Return the sensor if its USB device is known, the nodes to try, and warnings.

        A serial number outweighs a node, whose number depends on the order in which sensors are plugged in.
        """
        present = self._find(self._camera)
        if not self._settings.video_device:
            digit = select_camera(self._camera, present, self._serial)
            return digit, digit.nodes, []
        node, wanted = Path(self._settings.video_device), self._settings.serial
        owner = find_by_node(node, present)
        if wanted and (owner is None or owner.serial != wanted):
            known = self._opened_serial or any(camera.serial == wanted for camera in present)
            if owner is None and not known:
                return None, (node,), [f"video_device: it is not known whether {node} is the sensor {wanted}"]
            digit = select_camera(self._camera, present, wanted)
            now = f"the sensor {owner.serial or 'without serial number'}" if owner else "another device"
            return digit, digit.nodes, [f"video_device: {node} is {now}; took {digit}, as `serial` says"]
        # A udev link keeps naming the same sensor. A number goes to another sensor once ours is unplugged.
        if not self._opened_serial or node.is_symlink() or (owner and owner.serial == self._opened_serial):
            return owner, (node,), self._doubts_about(node, owner, len(present))
        digit = select_camera(self._camera, present, self._serial)
        return digit, digit.nodes, []

    def _doubts_about(self, node: Path, owner: UsbCamera | None, present: int) -> list[str]:
        if self._settings.serial or node.is_symlink() or present < 2:
            return []
        which = f"the sensor {owner.serial or 'at USB ' + owner.usb_path}" if owner else "an unknown device"
        return [
            f"video_device: {node} is {which} now, but {present} sensors are plugged in and their numbers change with "
            "the order; set `serial`, too"
        ]

    def _agree_on_format(self, stream: V4l2Stream) -> int:
        """Return the pixel format; raises InputError if the camera lacks the size and the formats of the model."""
        wanted = self._mode.width, self._mode.height
        width, height, pixel_format = stream.set_format(self._mode)
        if (width, height) != wanted:
            raise InputError(
                f"{stream.name} offers {width}x{height} instead of {wanted[0]}x{wanted[1]}: "
                f"is it a {self._camera.label}? Set `serial`, or `video_device` to the right node."
            )
        if pixel_format not in (v4l2.PIX_FMT_YUYV, v4l2.PIX_FMT_MJPEG):
            raise InputError(f"{stream.name} offers neither YUYV nor MJPEG images: is it a {self._camera.label}?")
        return pixel_format

    @property
    def _has_old_firmware(self) -> bool:
        return self._firmware is not None and self._firmware < FIRST_FIRMWARE_WITH_RGB

    def _light_up(self) -> list[str]:
        """Set the LEDs and return warnings: a sensor that refuses still gives images."""
        try:
            self.set_leds(self._leds)
        except DeviceError as error:
            return [str(error)]
        if self._camera.leds and self._has_old_firmware:
            return [f"firmware {self._firmware} cannot set the LEDs one by one (needs {FIRST_FIRMWARE_WITH_RGB})"]
        return []

    def _stamp(self, filled: FilledBuffer) -> int:
        """Return the monotonic time of the frame; the time of fetching it if the kernel's cannot be used.

        Raises:
            CorruptFrameError: it waited too long to be fetched, because this process was halted.
        """
        if not self._settings.use_buffer_timestamps or filled.stamp_ns is None:
            return filled.fetched_ns
        age = filled.fetched_ns - filled.stamp_ns
        if 0 <= age <= _OLDEST_CREDIBLE_STAMP_NS:
            self._clock_is_good = True
            return filled.stamp_ns
        if self._clock_is_good and age > 0:
            raise CorruptFrameError(f"frame {filled.sequence}: {age * 1e-9:.1f} s old when it was read")
        return filled.fetched_ns

"""A tactile camera on Video4Linux2: found by serial, streamed through the kernel's own interface.

The kernel is spoken to directly, because a capture library hides what a robot needs: which node gives images,
the acquisition time of a buffer, the flag of a damaged buffer, and a wait that ends when asked to.
"""

from __future__ import annotations

import contextlib
import ctypes
import errno
import mmap
import os
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from . import videodev2 as v4l2
from .camera_model import CameraMode, CameraModel
from .discovery import UsbCamera, find_by_node, find_cameras, select_camera
from .errors import CorruptFrameError, DeviceError, InputError
from .frame_source import Frame, FrameSource, MonotonicClock, SourceInfo
from .leds import MAX_LEVEL, packed
from .pixels import decode
from .system_calls import SystemCalls

FIRST_FIRMWARE_WITH_RGB = 200
_BUFFERS = 4
_OLDEST_CREDIBLE_STAMP_NS = 2_000_000_000


@dataclass(frozen=True)
class V4l2Settings:
    """How to open the sensor.

    Attributes:
        camera: the kind of sensor.
        serial: of the sensor; empty for the only one present.
        video_device: device node to use instead of searching by serial; empty for searching.
        resolution: name of one of the camera's modes; empty for the first.
        fps: one of that mode's rates; 0 for the first.
        leds: brightness of red, green and blue, 0...15.
        use_buffer_timestamps: take the kernel's time of a frame; else the time of fetching it.

    Raises:
        InputError: resolution and frame rate do not exist together.
    """

    camera: CameraModel = field(default_factory=lambda: CameraModel.load("digit"))
    serial: str = ""
    video_device: str = ""
    resolution: str = ""
    fps: int = 0
    leds: tuple[int, int, int] = (MAX_LEVEL, MAX_LEVEL, MAX_LEVEL)
    use_buffer_timestamps: bool = True

    def __post_init__(self) -> None:
        rates = self.mode.fps
        if self.fps and self.fps not in rates:
            allowed = " or ".join(map(str, rates))
            at = f" at {self.resolution}" if self.resolution else ""
            raise InputError(f"fps: a {self.camera.label} gives {allowed} frames per second{at}, got {self.fps}")

    @property
    def mode(self) -> CameraMode:
        """The mode that is meant."""
        return self.camera.mode(self.resolution)


class V4l2Camera(FrameSource):
    """The sensor itself.

    Args:
        settings: see there.
        system: the kernel.
        find: lists the sensors of a model present; asked anew at every ``open``: replugging renumbers the nodes.
        clock: the host's monotonic clock.
    """

    def __init__(
        self,
        settings: V4l2Settings,
        system: SystemCalls | None = None,
        find: Callable[[CameraModel], list[UsbCamera]] = find_cameras,
        clock: MonotonicClock | None = None,
    ) -> None:
        self._settings, self._camera, self._mode = settings, settings.camera, settings.mode
        self._rate = settings.fps or self._mode.fps[0]
        self._system = system or SystemCalls()
        self._find = find
        self._clock = clock or MonotonicClock()
        self._serial = settings.serial
        self._opened_serial = ""  # of the sensor that was open last
        self._leds = settings.leds
        self._firmware: int | None = None
        self._pixel_format = self._mode.pixel_format
        self._name = ""
        self._buffers: list[mmap.mmap] = []
        self._fd: int | None = None
        # LEDs are set from other threads; the descriptor must not be closed (and reused) under them.
        self._lock = threading.Lock()

    def open(self) -> SourceInfo:
        self.close()
        digit, nodes = self._locate()
        self._firmware = digit.firmware if digit else None
        fd, self._name = self._open_capture_node(nodes)
        with self._lock:
            self._fd = fd
        try:
            self._set_format()
            fps = self._set_rate()
            warnings = self._light_up()
            self._start_streaming()
        except (DeviceError, InputError):
            self.close()
            raise
        if digit:
            self._serial = self._opened_serial = digit.serial
        if fps != self._rate:
            warnings.append(f"the camera runs at {fps:g} frames per second instead of {self._rate}")
        serial = digit.serial if digit else ""
        return SourceInfo(self._name, serial, *self._mode.output, fps, True, tuple(warnings))

    def read(self, timeout: float) -> Frame | None:
        fd = self._fd
        if fd is None:
            raise DeviceError("the sensor is not open")
        buffer = self._buffer()
        try:
            if not self._system.wait_readable(fd, timeout):
                return None
            self._system.ioctl(fd, v4l2.VIDIOC_DQBUF, buffer)
        except BlockingIOError:
            return None
        except OSError as error:
            raise self._failure("fetching a frame", error) from error
        fetched_ns = self._clock.now_ns()
        # Copied before the buffer goes back: from then on the camera may overwrite it.
        data = self._buffers[buffer.index][: buffer.bytesused]
        damaged = bool(buffer.flags & v4l2.BUF_FLAG_ERROR)
        stamp_ns = self._stamp(buffer, fetched_ns)
        sequence = buffer.sequence
        self._ioctl(v4l2.VIDIOC_QBUF, buffer, "returning a buffer")
        if damaged:
            raise CorruptFrameError(f"frame {sequence}: the camera reports a damaged transfer")
        mode = self._mode
        image = decode(data, self._pixel_format, mode.width, mode.height, mode.reduction)
        return Frame(self._camera.upright(image, mode), stamp_ns, sequence)

    def close(self) -> None:
        with self._lock:
            fd, self._fd = self._fd, None
        if fd is None:
            return
        # An unplugged camera cannot be stopped, but its descriptor must be given back all the same.
        with contextlib.suppress(OSError):
            self._system.ioctl(fd, v4l2.VIDIOC_STREAMOFF, ctypes.c_int(v4l2.BUF_TYPE_VIDEO_CAPTURE))
        for buffer in self._buffers:
            buffer.close()
        self._buffers = []
        self._system.close(fd)

    def set_leds(self, rgb: tuple[int, int, int]) -> None:
        """See FrameSource. Raises DeviceError if the camera is there but refuses."""
        if not self._camera.leds:
            return
        with self._lock:
            self._leds = rgb
            if self._fd is None:
                return
            # Old firmware knows one brightness for all three.
            old = self._firmware is not None and self._firmware < FIRST_FIRMWARE_WITH_RGB
            control = v4l2.Control(v4l2.CID_ZOOM_ABSOLUTE, max(rgb) if old else packed(rgb))
            try:
                self._system.ioctl(self._fd, v4l2.VIDIOC_S_CTRL, control)
            except OSError as error:
                if error.errno != errno.ENODEV:  # If it was unplugged, ``open`` lights it when it is back.
                    raise self._failure("setting the LEDs", error) from error

    def _locate(self) -> tuple[UsbCamera | None, tuple[Path, ...]]:
        if self._settings.video_device:
            node = Path(self._settings.video_device)
            digit = find_by_node(node, self._find(self._camera))
            # A name of udev's (a link) says what is meant. A number goes to another sensor once ours is unplugged.
            if not self._opened_serial or node.is_symlink() or (digit and digit.serial == self._opened_serial):
                return digit, (node,)
        digit = select_camera(self._camera, self._find(self._camera), self._serial)
        return digit, digit.nodes

    def _open_capture_node(self, nodes: tuple[Path, ...]) -> tuple[int, str]:
        """Opens the first node that gives images; the others carry metadata."""
        refusals = []
        for node in nodes:
            try:
                fd = self._system.open(str(node))
            except OSError as error:
                refusals.append(f"{node}: {os.strerror(error.errno)}{_open_hint(error.errno)}")
                continue
            capability = v4l2.Capability()
            try:
                self._system.ioctl(fd, v4l2.VIDIOC_QUERYCAP, capability)
            except OSError as error:
                self._system.close(fd)
                refusals.append(f"{node}: not a V4L2 device ({os.strerror(error.errno)})")
                continue
            per_node = capability.capabilities & v4l2.CAP_DEVICE_CAPS
            caps = capability.device_caps if per_node else capability.capabilities
            if caps & v4l2.CAP_VIDEO_CAPTURE and caps & v4l2.CAP_STREAMING:
                return fd, str(node)
            self._system.close(fd)
            refusals.append(f"{node}: gives no images (metadata node)")
        raise DeviceError("cannot open the sensor: " + "; ".join(refusals))

    def _set_format(self) -> None:
        request = v4l2.Format(type=v4l2.BUF_TYPE_VIDEO_CAPTURE)
        pix = request.fmt.pix
        wanted = self._mode.width, self._mode.height
        pix.width, pix.height = wanted
        pix.pixelformat, pix.field = self._mode.pixel_format, v4l2.FIELD_NONE
        self._ioctl(v4l2.VIDIOC_S_FMT, request, "setting the format")
        if (pix.width, pix.height) != wanted:
            raise InputError(
                f"{self._name} offers {pix.width}x{pix.height} instead of {wanted[0]}x{wanted[1]}: "
                f"is it a {self._camera.label}? Set `serial`, or `video_device` to the right node."
            )
        if pix.pixelformat not in (v4l2.PIX_FMT_YUYV, v4l2.PIX_FMT_MJPEG):
            raise InputError(f"{self._name} offers neither YUYV nor MJPEG images: is it a {self._camera.label}?")
        self._pixel_format = pix.pixelformat

    def _set_rate(self) -> float:
        """Asks for the frame rate; returns the one the camera grants."""
        request = v4l2.StreamParm(type=v4l2.BUF_TYPE_VIDEO_CAPTURE)
        period = request.parm.capture.timeperframe
        period.numerator, period.denominator = 1, self._rate
        self._ioctl(v4l2.VIDIOC_S_PARM, request, "setting the frame rate")
        if not period.numerator or not period.denominator:
            return float(self._rate)
        return period.denominator / period.numerator

    def _light_up(self) -> list[str]:
        """Sets the LEDs; a sensor that refuses still gives images, so this only warns."""
        try:
            self.set_leds(self._leds)
        except DeviceError as error:
            return [str(error)]
        if self._camera.leds and self._firmware is not None and self._firmware < FIRST_FIRMWARE_WITH_RGB:
            return [f"firmware {self._firmware} cannot set the LEDs one by one (needs {FIRST_FIRMWARE_WITH_RGB})"]
        return []

    def _start_streaming(self) -> None:
        fd = self._fd
        request = v4l2.RequestBuffers(_BUFFERS, v4l2.BUF_TYPE_VIDEO_CAPTURE, v4l2.MEMORY_MMAP)
        self._ioctl(v4l2.VIDIOC_REQBUFS, request, "requesting buffers")
        for index in range(request.count):
            buffer = self._buffer(index)
            self._ioctl(v4l2.VIDIOC_QUERYBUF, buffer, "asking for a buffer")
            try:
                self._buffers.append(self._system.mmap(fd, buffer.length, buffer.m.offset))
            except OSError as error:
                raise self._failure("mapping a buffer", error) from error
            self._ioctl(v4l2.VIDIOC_QBUF, buffer, "queueing a buffer")
        self._ioctl(v4l2.VIDIOC_STREAMON, ctypes.c_int(v4l2.BUF_TYPE_VIDEO_CAPTURE), "starting the stream")

    def _stamp(self, buffer: v4l2.Buffer, fetched_ns: int) -> int:
        """Monotonic time of the frame; the time of fetching it where the kernel's is of no use."""
        kind = buffer.flags & v4l2.BUF_FLAG_TIMESTAMP_MASK
        if not self._settings.use_buffer_timestamps or kind != v4l2.BUF_FLAG_TIMESTAMP_MONOTONIC:
            return fetched_ns
        stamp_ns = buffer.timestamp.tv_sec * 1_000_000_000 + buffer.timestamp.tv_usec * 1_000
        credible = 0 <= fetched_ns - stamp_ns <= _OLDEST_CREDIBLE_STAMP_NS
        return stamp_ns if credible else fetched_ns

    def _buffer(self, index: int = 0) -> v4l2.Buffer:
        return v4l2.Buffer(index=index, type=v4l2.BUF_TYPE_VIDEO_CAPTURE, memory=v4l2.MEMORY_MMAP)

    def _ioctl(self, request: int, argument: ctypes.Structure | ctypes._SimpleCData, doing: str) -> None:
        try:
            self._system.ioctl(self._fd, request, argument)
        except OSError as error:
            raise self._failure(doing, error) from error

    def _failure(self, doing: str, error: OSError) -> DeviceError:
        reason = os.strerror(error.errno) + _stream_hint(error.errno)
        return DeviceError(f"{self._name}: {doing} failed: {reason}")


def _open_hint(code: int) -> str:
    if code in (errno.EACCES, errno.EPERM):
        return " (install the udev rule of this package, or join the group `video` and log in again)"
    return ""


def _stream_hint(code: int) -> str:
    hints = {
        errno.EBUSY: " (another program uses the sensor; `fuser -v /dev/video*` shows which)",
        errno.ENODEV: " (the sensor was unplugged)",
        errno.ENOSPC: " (too little USB bandwidth: use another root port, or a lower frame rate)",
    }
    return hints.get(code, "")

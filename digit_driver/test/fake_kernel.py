"""A machine with pretended cameras: its sysfs on disk, its system calls in memory.

The driver under test runs unchanged above this; what it is given are the kernel's own structures.
"""

from __future__ import annotations

import ctypes
import errno
import mmap
import os
import shutil
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from digit_driver import videodev2 as v4l2
from digit_driver.videodev2 import SystemCalls

CAP_META_CAPTURE = 0x00800000
FRAME_PERIOD_S = 0.002


@dataclass
class FakeDigit:
    """One camera and the faults it can show, switched by setting its attributes at any time."""

    serial: str = "D20001"
    usb_path: str = "1-4"
    number: int = 0
    revision: str = "0212"
    vendor: str = "2833"
    product: str = ""
    stalled: bool = False
    damaged: bool = False
    short: bool = False
    open_error: int = 0
    errors: dict[int, int] = field(default_factory=dict)
    size: tuple[int, int] | None = None
    pixel_format: int = v4l2.PIX_FMT_YUYV
    granted_fps: int | None = None
    stamp_flags: int = v4l2.BUF_FLAG_TIMESTAMP_MONOTONIC
    stamp_shift_ns: int = 0
    uneven_ns: int = 0  # by up to which stamps are too old, each by another amount
    skip_sequence: int = 0
    hanging: threading.Event | None = None
    picture: bytes | None = None
    metadata_first: bool = False

    led_values: list[int] = field(default_factory=list)
    opened: int = 0
    requested_fps: int = 0
    requested_format: tuple[int, int, int] = (0, 0, 0)
    sequence: int = -1
    last_stamp_ns: int = 0


@dataclass
class _Descriptor:
    camera: FakeDigit
    capture: bool
    buffers: list[mmap.mmap] = field(default_factory=list)
    queue: list[int] = field(default_factory=list)
    length: int = 0
    streaming: bool = False
    gone: bool = False


class FakeKernel(SystemCalls):
    """Cameras own two nodes each: images at ``number``, metadata at ``number + 1``."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.sysfs = root / "sys/class/video4linux"
        self.dev = Path("/dev")
        self.sysfs.mkdir(parents=True)
        self.cameras: list[FakeDigit] = []
        self.descriptors: dict[int, _Descriptor] = {}
        self._next_fd = 1000

    def plug(self, camera: FakeDigit, metadata_first: bool = False) -> FakeDigit:
        """Plugs a camera in; with ``metadata_first`` its lower node carries the metadata."""
        self.cameras.append(camera)
        camera.metadata_first = metadata_first
        usb = self.root / "sys/devices/pci0/usb1" / camera.usb_path
        interface = usb / f"{camera.usb_path}:1.0"
        for number in (camera.number, camera.number + 1):
            node = interface / "video4linux" / f"video{number}"
            node.mkdir(parents=True)
            (node / "device").symlink_to(interface)
            (self.sysfs / node.name).symlink_to(node)
        attributes = {"idVendor": camera.vendor, "idProduct": "0209", "bcdDevice": camera.revision}
        for name in ("serial", "product"):
            if getattr(camera, name):
                attributes[name] = getattr(camera, name)
        for name, value in attributes.items():
            (usb / name).write_text(value + "\n")
        return camera

    def unplug(self, camera: FakeDigit) -> None:
        """Pulls the cable: the nodes vanish, what was open returns errors."""
        self.cameras.remove(camera)
        for number in (camera.number, camera.number + 1):
            (self.sysfs / f"video{number}").unlink()
        shutil.rmtree(self.root / "sys/devices/pci0/usb1" / camera.usb_path)
        for descriptor in self.descriptors.values():
            descriptor.gone = descriptor.gone or descriptor.camera is camera

    def open(self, path: str) -> int:
        path = os.path.realpath(path)
        for camera in self.cameras:
            offset = int(path.removeprefix("/dev/video")) - camera.number
            if offset in (0, 1):
                if camera.open_error:
                    raise OSError(camera.open_error, path)
                camera.opened += 1
                self._next_fd += 1
                capture = (offset == 0) != camera.metadata_first
                self.descriptors[self._next_fd] = _Descriptor(camera, capture)
                return self._next_fd
        raise FileNotFoundError(errno.ENOENT, path)

    def close(self, fd: int) -> None:
        del self.descriptors[fd]

    def mmap(self, fd: int, length: int, offset: int) -> mmap.mmap:
        return self.descriptors[fd].buffers[offset // length]

    def wait_readable(self, fd: int, timeout: float) -> bool:
        descriptor = self.descriptors[fd]
        time.sleep(min(timeout, FRAME_PERIOD_S))
        return descriptor.gone or (descriptor.streaming and not descriptor.camera.stalled)

    def ioctl(self, fd: int, request: int, argument) -> None:
        descriptor = self.descriptors[fd]
        if descriptor.gone:
            raise OSError(errno.ENODEV, "gone")
        if request in descriptor.camera.errors:
            raise OSError(descriptor.camera.errors[request], "injected")
        _HANDLERS[request](descriptor, argument)


def _query_capabilities(descriptor: _Descriptor, capability: v4l2.Capability) -> None:
    own = v4l2.CAP_VIDEO_CAPTURE if descriptor.capture else CAP_META_CAPTURE
    capability.device_caps = own | v4l2.CAP_STREAMING
    # As real UVC drivers do: the device as a whole captures video, whichever node is asked.
    everything = v4l2.CAP_VIDEO_CAPTURE | CAP_META_CAPTURE | v4l2.CAP_STREAMING
    capability.capabilities = everything | v4l2.CAP_DEVICE_CAPS


def _set_format(descriptor: _Descriptor, request: v4l2.Format) -> None:
    camera, pix = descriptor.camera, request.fmt.pix
    camera.requested_format = pix.width, pix.height, pix.pixelformat
    if camera.size:
        pix.width, pix.height = camera.size
    pix.pixelformat = camera.pixel_format
    pix.sizeimage = descriptor.length = 2 * pix.width * pix.height


def _set_rate(descriptor: _Descriptor, request: v4l2.StreamParm) -> None:
    period = request.parm.capture.timeperframe
    descriptor.camera.requested_fps = period.denominator // period.numerator
    if descriptor.camera.granted_fps:
        period.numerator, period.denominator = 1, descriptor.camera.granted_fps


def _set_control(descriptor: _Descriptor, control: v4l2.Control) -> None:
    assert control.id == v4l2.CID_ZOOM_ABSOLUTE
    descriptor.camera.led_values.append(control.value)


def _request_buffers(descriptor: _Descriptor, request: v4l2.RequestBuffers) -> None:
    request.count = 3  # Fewer than asked for, as drivers may.
    descriptor.buffers = [mmap.mmap(-1, descriptor.length) for _ in range(request.count)]


def _query_buffer(descriptor: _Descriptor, buffer: v4l2.Buffer) -> None:
    buffer.length = descriptor.length
    buffer.m.offset = buffer.index * descriptor.length


def _queue_buffer(descriptor: _Descriptor, buffer: v4l2.Buffer) -> None:
    assert buffer.index not in descriptor.queue
    descriptor.queue.append(buffer.index)


def _dequeue_buffer(descriptor: _Descriptor, buffer: v4l2.Buffer) -> None:
    camera = descriptor.camera
    if camera.hanging is not None:
        camera.hanging.wait()
    if not descriptor.queue or camera.stalled:
        raise BlockingIOError(errno.EAGAIN, "nothing there")
    camera.sequence += 1 + camera.skip_sequence
    data = camera.picture or picture(camera.sequence)
    if camera.short:
        data = data[: len(data) // 2]
    index = descriptor.queue.pop(0)
    descriptor.buffers[index][: len(data)] = data
    camera.last_stamp_ns = time.monotonic_ns() // 1000 * 1000 - 3_000_000
    stamp_ns = camera.last_stamp_ns + camera.stamp_shift_ns - camera.sequence * 59 % 97 * camera.uneven_ns // 97
    seconds, rest = divmod(stamp_ns, 1_000_000_000)
    buffer.index, buffer.bytesused, buffer.sequence = index, len(data), camera.sequence
    buffer.timestamp.tv_sec, buffer.timestamp.tv_usec = seconds, rest // 1000
    buffer.flags = camera.stamp_flags | (v4l2.BUF_FLAG_ERROR if camera.damaged else 0)


def _start(descriptor: _Descriptor, _: ctypes.c_int) -> None:
    descriptor.streaming = True


def _stop(descriptor: _Descriptor, _: ctypes.c_int) -> None:
    descriptor.streaming = False


_HANDLERS = {
    v4l2.VIDIOC_QUERYCAP: _query_capabilities,
    v4l2.VIDIOC_S_FMT: _set_format,
    v4l2.VIDIOC_S_PARM: _set_rate,
    v4l2.VIDIOC_S_CTRL: _set_control,
    v4l2.VIDIOC_REQBUFS: _request_buffers,
    v4l2.VIDIOC_QUERYBUF: _query_buffer,
    v4l2.VIDIOC_QBUF: _queue_buffer,
    v4l2.VIDIOC_DQBUF: _dequeue_buffer,
    v4l2.VIDIOC_STREAMON: _start,
    v4l2.VIDIOC_STREAMOFF: _stop,
}


def yuyv(luma: np.ndarray) -> bytes:
    """YUYV bytes of a grey landscape image (H, W)."""
    out = np.full((*luma.shape, 2), 128, np.uint8)
    out[..., 0] = luma
    return out.tobytes()


def picture(sequence: int, width: int = 320, height: int = 240) -> bytes:
    """YUYV bytes: mid-grey that changes from frame to frame, the landscape image's top right quarter red."""
    luma = np.full((height, width), 100 + sequence % 50, np.uint8)
    red_difference = np.full((height, width), 128, np.uint8)
    blue_difference = red_difference.copy()
    red_difference[: height // 2, width // 2 :] = 220
    yuyv = np.empty((height, width, 2), np.uint8)
    yuyv[..., 0] = luma
    yuyv[:, 0::2, 1] = blue_difference[:, 0::2]
    yuyv[:, 1::2, 1] = red_difference[:, 1::2]
    return yuyv.tobytes()

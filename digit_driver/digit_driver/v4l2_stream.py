"""An open capture node of Video4Linux2: its format and rate, and the buffers that the camera fills in turn.

The driver calls the kernel directly, because capture libraries hide what a robot needs: the node with the images, the
acquisition time of a buffer, the flag of a damaged buffer, and a wait with a time limit.
"""

from __future__ import annotations

import contextlib
import ctypes
import errno
import mmap
import os
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from . import videodev2 as v4l2
from .camera_model import CameraMode
from .frames import DeviceError

_BUFFERS = 4
_NO_RIGHT = " (install the udev rule of this package, or join the group `video` and log in again)"
_OPEN_HINTS = {errno.EACCES: _NO_RIGHT, errno.EPERM: _NO_RIGHT}
_STREAM_HINTS = {
    errno.EBUSY: " (another program uses the sensor; `fuser -v /dev/video*` shows which)",
    errno.ENODEV: " (the sensor was unplugged)",
    errno.ENOSPC: " (too little USB bandwidth: use another root port, or a lower frame rate)",
}


@dataclass(frozen=True)
class FilledBuffer:
    """One frame as the camera has sent it.

    Attributes:
        data: the image in the pixel format.
        sequence: number given by the camera.
        damaged: whether the transfer damaged the frame.
        stamp_ns: the kernel's monotonic time of acquisition; None if the kernel stamps with another clock.
        fetched_ns: monotonic time at which the driver fetched it.
    """

    data: bytes
    sequence: int
    damaged: bool
    stamp_ns: int | None
    fetched_ns: int


class V4l2Stream:
    """The first of a camera's device nodes that gives images; the others carry metadata.

    Args:
        nodes: the camera's device nodes.
        system: the kernel.

    Attributes:
        name: the node that is open.

    Raises:
        DeviceError: none can be opened or gives images; the methods raise it with the call that failed and the reason.
    """

    def __init__(self, nodes: Sequence[Path], system: v4l2.SystemCalls) -> None:
        self._system = system
        self._buffers: list[mmap.mmap] = []
        refusals = []
        for node in nodes:
            try:
                fd = system.open(str(node))
            except OSError as error:
                refusals.append(f"{node}: {os.strerror(error.errno)}{_OPEN_HINTS.get(error.errno, '')}")
                continue
            refusal = _refusal(system, fd)
            if not refusal:
                self._fd, self.name = fd, str(node)
                return
            system.close(fd)
            refusals.append(f"{node}: {refusal}")
        raise DeviceError("cannot open the sensor: " + "; ".join(refusals))

    def set_format(self, mode: CameraMode) -> tuple[int, int, int]:
        """Request the size and pixel format of a mode; return the width, height and format that the camera grants."""
        request = v4l2.Format(type=v4l2.BUF_TYPE_VIDEO_CAPTURE)
        pix = request.fmt.pix
        pix.width, pix.height = mode.width, mode.height
        pix.pixelformat, pix.field = mode.pixel_format, v4l2.FIELD_NONE
        self._ioctl(v4l2.VIDIOC_S_FMT, request, "setting the format")
        return pix.width, pix.height, pix.pixelformat

    def set_rate(self, fps: int) -> float:
        """Request a number of frames per second; return the one that the camera grants."""
        request = v4l2.StreamParm(type=v4l2.BUF_TYPE_VIDEO_CAPTURE)
        period = request.parm.capture.timeperframe
        period.numerator, period.denominator = 1, fps
        self._ioctl(v4l2.VIDIOC_S_PARM, request, "setting the frame rate")
        if not period.numerator or not period.denominator:
            return float(fps)
        return period.denominator / period.numerator

    def set_control(self, control: int, value: int, doing: str) -> None:
        """Set a control of the camera; a no-op if it was unplugged."""
        try:
            self._system.ioctl(self._fd, v4l2.VIDIOC_S_CTRL, v4l2.Control(control, value))
        except OSError as error:
            if error.errno != errno.ENODEV:
                raise self._failure(doing, error) from error

    def start(self) -> None:
        """Map the buffers and let the camera fill them."""
        request = v4l2.RequestBuffers(_BUFFERS, v4l2.BUF_TYPE_VIDEO_CAPTURE, v4l2.MEMORY_MMAP)
        self._ioctl(v4l2.VIDIOC_REQBUFS, request, "requesting buffers")
        for index in range(request.count):
            buffer = _buffer(index)
            self._ioctl(v4l2.VIDIOC_QUERYBUF, buffer, "asking for a buffer")
            try:
                self._buffers.append(self._system.mmap(self._fd, buffer.length, buffer.m.offset))
            except OSError as error:
                raise self._failure("mapping a buffer", error) from error
            self._ioctl(v4l2.VIDIOC_QBUF, buffer, "queueing a buffer")
        self._ioctl(v4l2.VIDIOC_STREAMON, ctypes.c_int(v4l2.BUF_TYPE_VIDEO_CAPTURE), "starting the stream")

    def fetch(self, timeout: float) -> FilledBuffer | None:
        """Return the next frame; None after ``timeout`` seconds without one."""
        buffer = _buffer()
        try:
            if not self._system.wait_readable(self._fd, timeout):
                return None
            self._system.ioctl(self._fd, v4l2.VIDIOC_DQBUF, buffer)
        except BlockingIOError:
            return None
        except OSError as error:
            raise self._failure("fetching a frame", error) from error
        filled = FilledBuffer(
            fetched_ns=time.monotonic_ns(),
            # Copied before the buffer goes back: from then on the camera may overwrite it.
            data=self._buffers[buffer.index][: buffer.bytesused],
            sequence=buffer.sequence,
            damaged=bool(buffer.flags & v4l2.BUF_FLAG_ERROR),
            stamp_ns=_monotonic_ns(buffer),
        )
        self._ioctl(v4l2.VIDIOC_QBUF, buffer, "returning a buffer")
        return filled

    def close(self) -> None:
        """End the stream and release everything."""
        # An unplugged camera cannot be stopped, but its descriptor must still be released.
        with contextlib.suppress(OSError):
            self._system.ioctl(self._fd, v4l2.VIDIOC_STREAMOFF, ctypes.c_int(v4l2.BUF_TYPE_VIDEO_CAPTURE))
        for buffer in self._buffers:
            buffer.close()
        self._buffers = []
        self._system.close(self._fd)

    def _ioctl(self, request: int, argument: ctypes.Structure | ctypes._SimpleCData, doing: str) -> None:
        try:
            self._system.ioctl(self._fd, request, argument)
        except OSError as error:
            raise self._failure(doing, error) from error

    def _failure(self, doing: str, error: OSError) -> DeviceError:
        reason = os.strerror(error.errno) + _STREAM_HINTS.get(error.errno, "")
        return DeviceError(f"{self.name}: {doing} failed: {reason}")


def _refusal(system: v4l2.SystemCalls, fd: int) -> str:
    """Return why an open node cannot be streamed from; empty if it can."""
    capability = v4l2.Capability()
    try:
        system.ioctl(fd, v4l2.VIDIOC_QUERYCAP, capability)
    except OSError as error:
        return f"not a V4L2 device ({os.strerror(error.errno)})"
    per_node = capability.capabilities & v4l2.CAP_DEVICE_CAPS
    caps = capability.device_caps if per_node else capability.capabilities
    streams = caps & v4l2.CAP_VIDEO_CAPTURE and caps & v4l2.CAP_STREAMING
    return "" if streams else "gives no images (metadata node)"


def _buffer(index: int = 0) -> v4l2.Buffer:
    return v4l2.Buffer(index=index, type=v4l2.BUF_TYPE_VIDEO_CAPTURE, memory=v4l2.MEMORY_MMAP)


def _monotonic_ns(buffer: v4l2.Buffer) -> int | None:
    if buffer.flags & v4l2.BUF_FLAG_TIMESTAMP_MASK != v4l2.BUF_FLAG_TIMESTAMP_MONOTONIC:
        return None
    return buffer.timestamp.tv_sec * 1_000_000_000 + buffer.timestamp.tv_usec * 1_000

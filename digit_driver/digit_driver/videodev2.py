"""Part of the kernel's Video4Linux2 interface that capturing needs: ctypes structures and system calls.

Field order and numbers follow the kernel's documentation ("Video for Linux API", 64-bit systems); a test
compares every size and request number with the system's own header if there is a compiler.
"""

from __future__ import annotations

import ctypes as c
import fcntl
import mmap
import os
import select

BUF_TYPE_VIDEO_CAPTURE = 1
MEMORY_MMAP = 1
FIELD_NONE = 1
CAP_VIDEO_CAPTURE = 0x00000001
CAP_STREAMING = 0x04000000
CAP_DEVICE_CAPS = 0x80000000
BUF_FLAG_ERROR = 0x00000040
BUF_FLAG_TIMESTAMP_MASK = 0x0000E000
BUF_FLAG_TIMESTAMP_MONOTONIC = 0x00002000
CID_ZOOM_ABSOLUTE = 0x009A090D


def fourcc(code: str) -> int:
    """Return the pixel format number of a four-letter code."""
    return int.from_bytes(code.encode("ascii"), "little")


PIX_FMT_YUYV = fourcc("YUYV")
PIX_FMT_MJPEG = fourcc("MJPG")


class Capability(c.Structure):
    _fields_ = [
        ("driver", c.c_char * 16),
        ("card", c.c_char * 32),
        ("bus_info", c.c_char * 32),
        ("version", c.c_uint32),
        ("capabilities", c.c_uint32),
        ("device_caps", c.c_uint32),
        ("reserved", c.c_uint32 * 3),
    ]


class PixFormat(c.Structure):
    _fields_ = [
        *((name, c.c_uint32) for name in ("width", "height", "pixelformat", "field", "bytesperline", "sizeimage")),
        *((name, c.c_uint32) for name in ("colorspace", "priv", "flags", "ycbcr_enc", "quantization", "xfer_func")),
    ]


class _FormatUnion(c.Union):
    # The kernel's union also holds structures with pointers, hence its alignment.
    _fields_ = [("pix", PixFormat), ("raw_data", c.c_uint8 * 200), ("alignment", c.c_void_p)]


class Format(c.Structure):
    _fields_ = [("type", c.c_uint32), ("fmt", _FormatUnion)]


class Fract(c.Structure):
    _fields_ = [("numerator", c.c_uint32), ("denominator", c.c_uint32)]


class CaptureParm(c.Structure):
    _fields_ = [
        ("capability", c.c_uint32),
        ("capturemode", c.c_uint32),
        ("timeperframe", Fract),
        ("extendedmode", c.c_uint32),
        ("readbuffers", c.c_uint32),
        ("reserved", c.c_uint32 * 4),
    ]


class _ParmUnion(c.Union):
    _fields_ = [("capture", CaptureParm), ("raw_data", c.c_uint8 * 200)]


class StreamParm(c.Structure):
    _fields_ = [("type", c.c_uint32), ("parm", _ParmUnion)]


class RequestBuffers(c.Structure):
    _fields_ = [
        ("count", c.c_uint32),
        ("type", c.c_uint32),
        ("memory", c.c_uint32),
        ("capabilities", c.c_uint32),
        ("flags", c.c_uint8),
        ("reserved", c.c_uint8 * 3),
    ]


class Timeval(c.Structure):
    _fields_ = [("tv_sec", c.c_long), ("tv_usec", c.c_long)]


class Timecode(c.Structure):
    _fields_ = [
        ("type", c.c_uint32),
        ("flags", c.c_uint32),
        ("frames", c.c_uint8),
        ("seconds", c.c_uint8),
        ("minutes", c.c_uint8),
        ("hours", c.c_uint8),
        ("userbits", c.c_uint8 * 4),
    ]


class _BufferMemory(c.Union):
    _fields_ = [("offset", c.c_uint32), ("userptr", c.c_ulong), ("planes", c.c_void_p), ("fd", c.c_int32)]


class Buffer(c.Structure):
    _fields_ = [
        ("index", c.c_uint32),
        ("type", c.c_uint32),
        ("bytesused", c.c_uint32),
        ("flags", c.c_uint32),
        ("field", c.c_uint32),
        ("timestamp", Timeval),
        ("timecode", Timecode),
        ("sequence", c.c_uint32),
        ("memory", c.c_uint32),
        ("m", _BufferMemory),
        ("length", c.c_uint32),
        ("reserved2", c.c_uint32),
        ("request_fd", c.c_int32),
    ]


class Control(c.Structure):
    _fields_ = [("id", c.c_uint32), ("value", c.c_int32)]


_WRITE, _READ = 1, 2


def _request(direction: int, number: int, argument: type) -> int:
    return direction << 30 | c.sizeof(argument) << 16 | ord("V") << 8 | number


VIDIOC_QUERYCAP = _request(_READ, 0, Capability)
VIDIOC_S_FMT = _request(_READ | _WRITE, 5, Format)
VIDIOC_REQBUFS = _request(_READ | _WRITE, 8, RequestBuffers)
VIDIOC_QUERYBUF = _request(_READ | _WRITE, 9, Buffer)
VIDIOC_QBUF = _request(_READ | _WRITE, 15, Buffer)
VIDIOC_DQBUF = _request(_READ | _WRITE, 17, Buffer)
VIDIOC_STREAMON = _request(_WRITE, 18, c.c_int)
VIDIOC_STREAMOFF = _request(_WRITE, 19, c.c_int)
VIDIOC_S_PARM = _request(_READ | _WRITE, 22, StreamParm)
VIDIOC_S_CTRL = _request(_READ | _WRITE, 28, Control)


class SystemCalls:
    """System calls through which the driver uses a camera; tests replace them by a fake kernel.

    All methods raise OSError as the calls that they wrap do.
    """

    def open(self, path: str) -> int:
        """Open a device for reading and writing without ever blocking on it; return the descriptor."""
        return os.open(path, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)

    def close(self, fd: int) -> None:
        os.close(fd)

    def ioctl(self, fd: int, request: int, argument: c.Structure | c._SimpleCData) -> None:
        """Let the kernel read and fill ``argument`` in place."""
        fcntl.ioctl(fd, request, argument)

    def mmap(self, fd: int, length: int, offset: int) -> mmap.mmap:
        return mmap.mmap(fd, length, mmap.MAP_SHARED, mmap.PROT_READ | mmap.PROT_WRITE, offset=offset)

    def wait_readable(self, fd: int, timeout: float) -> bool:
        """Return True once a buffer (or an error) can be fetched, False after ``timeout`` seconds."""
        poller = select.poll()
        poller.register(fd, select.POLLIN | select.POLLPRI)
        return bool(poller.poll(max(0.0, timeout) * 1000.0))

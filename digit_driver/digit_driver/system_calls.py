"""The few system calls through which the driver touches a camera; here tests put a fake kernel."""

from __future__ import annotations

import ctypes
import fcntl
import mmap
import os
import select


class SystemCalls:
    """The real kernel. All methods raise OSError as the calls they wrap."""

    def open(self, path: str) -> int:
        """Opens a device for reading and writing without ever blocking on it; returns the descriptor."""
        return os.open(path, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)

    def close(self, fd: int) -> None:
        os.close(fd)

    def ioctl(self, fd: int, request: int, argument: ctypes.Structure | ctypes._SimpleCData) -> None:
        """The kernel reads and fills ``argument`` in place."""
        fcntl.ioctl(fd, request, argument)

    def mmap(self, fd: int, length: int, offset: int) -> mmap.mmap:
        return mmap.mmap(fd, length, mmap.MAP_SHARED, mmap.PROT_READ | mmap.PROT_WRITE, offset=offset)

    def wait_readable(self, fd: int, timeout: float) -> bool:
        """True when a buffer (or an error) is there to be fetched, False after ``timeout`` seconds."""
        poller = select.poll()
        poller.register(fd, select.POLLIN | select.POLLPRI)
        return bool(poller.poll(max(0.0, timeout) * 1000.0))

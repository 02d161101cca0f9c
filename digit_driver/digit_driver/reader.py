"""Reader of a camera in a thread of its own: it keeps the newest frame, and reopens the camera when it fails."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from midastouch_common.errors import InputError

from .frames import CorruptFrameError, DeviceError, Frame, FrameSlot, ReaderState, ReaderStatus, SourceInfo
from .v4l2_device import V4l2Camera

_POLL_S = 0.1  # period at which the thread checks whether it must stop
_STALL_FRAMES = 5


@dataclass(frozen=True)
class ReaderTiming:
    """Times of the reader, seconds.

    Attributes:
        wait_for_device: longest wait for a camera that is not there at the start; negative: for ever.
        reconnect: pause between attempts to open it.
        stall: time without a good frame (at least five frame periods) after which the camera is opened again.
    """

    wait_for_device: float = -1.0
    reconnect: float = 1.0
    stall: float = 1.0


class FrameReader:
    """Owner of a camera and of the thread that reads it.

    Parameters
    ----------
    camera
        Used by the thread alone, except for ``set_leds``.
    on_event
        Called in the thread after every frame and every change of state; must return quickly.
    timing
        By default that of `ReaderTiming`.
    """

    def __init__(self, camera: V4l2Camera, on_event: Callable[[], None], timing: ReaderTiming | None = None) -> None:
        self._camera = camera
        self._on_event = on_event
        self._timing = timing or ReaderTiming()
        self._slot = FrameSlot(ReaderState.STOPPED)
        self._alive_ns = 0
        self._stopping = threading.Event()
        self._settled = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Begin to read; a no-op if it already reads.

        Raises:
            DeviceError: a thread that was stopped earlier still hangs in the device driver.
        """
        if self._thread is not None and self._thread.is_alive():
            if self._stopping.is_set():
                raise DeviceError("the device driver hangs since the last stop; replug the sensor")
            return
        self._stopping.clear()
        self._settled.clear()
        self._slot = FrameSlot(ReaderState.CONNECTING)
        self._alive_ns = time.monotonic_ns()
        self._thread = threading.Thread(target=self._run, name="digit_reader", daemon=True)
        self._thread.start()

    def stop(self, timeout: float = 2.0) -> bool:
        """End reading and close the camera. Return False if the thread did not end within ``timeout`` seconds.

        Such a thread hangs in the kernel. It is left alone, closes the camera once its call returns, and does not
        keep the process from ending.
        """
        self._stopping.set()
        if self._thread is not None:
            self._thread.join(timeout)
            if self._thread.is_alive():
                return False
        self._slot.update(state=ReaderState.STOPPED)
        return True

    def wait_settled(self, timeout: float) -> bool:
        """Wait until the first attempt to open the camera has ended; return False if ``timeout`` seconds pass first."""
        return self._settled.wait(timeout)

    def take(self) -> Frame | None:
        """Return the newest frame that was not taken yet; None without one."""
        return self._slot.take()

    def status(self) -> ReaderStatus:
        """Return the counters at present."""
        running = self._thread is not None and self._thread.is_alive()
        silent_s = (time.monotonic_ns() - self._alive_ns) * 1e-9 if running else 0.0
        return replace(self._slot.status, silent_s=silent_s)

    def _run(self) -> None:
        try:
            self._connect_and_stream()
            # set here, too: the call of a hanging thread may return only after ``stop`` has left it alone
            self._slot.update(state=ReaderState.STOPPED)
        except (InputError, DeviceError) as error:
            self._settle(state=ReaderState.FAILED, last_error=str(error))
        except Exception as error:
            self._settle(state=ReaderState.FAILED, last_error=f"internal error: {error!r}")
            raise
        finally:
            self._camera.close()

    def _connect_and_stream(self) -> None:
        """Open the camera, read until that fails, close it, wait and begin again, until stopped.

        Raises:
            InputError: the camera can never be opened with these settings.
            DeviceError: the camera never appeared within the time given for it.
        """
        started_ns = time.monotonic_ns()
        opened_before = False
        while not self._stopping.is_set():
            self._sign_of_life()
            try:
                info = self._camera.open()
                again = self._slot.status.reconnects + opened_before
                self._settle(state=ReaderState.STREAMING, info=info, reconnects=again)
                opened_before = True
                self._stream(info)
            except (DeviceError, InputError) as error:
                # A camera that worked once may work again, whatever fails now: another may have got our number.
                if isinstance(error, InputError) and not opened_before:
                    raise
                self._camera.close()
                waited, limit = (time.monotonic_ns() - started_ns) * 1e-9, self._timing.wait_for_device
                if not opened_before and 0.0 <= limit <= waited:
                    raise
                state = ReaderState.DISCONNECTED if opened_before else ReaderState.CONNECTING
                self._settle(state=state, last_error=str(error))
                self._pause()

    def _stream(self, info: SourceInfo) -> None:
        """Read until stopped. Raises the errors of ``read`` and, if good frames cease, DeviceError."""
        stall = max(self._timing.stall, _STALL_FRAMES / info.fps)
        last_good_ns = time.monotonic_ns()
        previous: int | None = None
        corrupt_since = 0
        while not self._stopping.is_set():
            self._sign_of_life()
            try:
                frame = self._camera.read(_POLL_S)
            except CorruptFrameError as error:
                corrupt_since += 1
                self._slot.count_corrupt(str(error))
                frame = None
            if frame is not None:
                gap = 0 if previous is None else max(0, frame.sequence - previous - 1 - corrupt_since)
                previous, corrupt_since = frame.sequence, 0
                last_good_ns = time.monotonic_ns()
                self._slot.put(frame, gap)
                self._notify()
            elif (time.monotonic_ns() - last_good_ns) * 1e-9 > stall:
                raise DeviceError(f"{info.name}: no good frame for {stall:g} s")

    def _pause(self) -> None:
        """Sleep before the next attempt, but wake up often enough to show that the thread lives."""
        remaining = self._timing.reconnect
        while remaining > 0.0 and not self._stopping.wait(min(_POLL_S, remaining)):
            remaining -= _POLL_S
            self._sign_of_life()

    def _sign_of_life(self) -> None:
        self._alive_ns = time.monotonic_ns()

    def _settle(self, **changes: Any) -> None:
        self._slot.update(**changes)
        self._settled.set()
        self._notify()

    def _notify(self) -> None:
        if not self._stopping.is_set():
            self._on_event()

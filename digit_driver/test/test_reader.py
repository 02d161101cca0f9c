"""The reader thread over a fake kernel, with every fault a cable or a camera can show."""

import errno
import threading
import time
from collections.abc import Callable

import pytest
from fake_kernel import FakeDigit

from digit_driver import videodev2 as v4l2
from digit_driver.frames import DeviceError, ReaderState, ReaderStatus
from digit_driver.reader import FrameReader, ReaderTiming
from digit_driver.v4l2_device import V4l2Camera, V4l2Settings

FAST = ReaderTiming(reconnect=0.02, stall=0.1)
TIMEOUT_S = 120.0  # bounds a failing test only


class Watched:
    """A reader whose events wake the test."""

    def __init__(self, source, timing: ReaderTiming = FAST) -> None:
        self._changed = threading.Condition()
        self.reader = FrameReader(source, self._wake, timing)

    def _wake(self) -> None:
        with self._changed:
            self._changed.notify_all()

    def wait_for(self, predicate: Callable[[ReaderStatus], bool]) -> ReaderStatus:
        deadline = time.monotonic() + TIMEOUT_S
        with self._changed:
            while not predicate(status := self.reader.status()):
                # Corrupt frames are counted without an event, hence the short wait.
                assert time.monotonic() < deadline, status
                self._changed.wait(0.02)
        return status


@pytest.fixture
def watch(kernel, find):
    """Starts readers on the fake machine and stops them at the end."""
    watched = []

    def start(timing: ReaderTiming = FAST, **settings) -> Watched:
        watched.append(Watched(V4l2Camera(V4l2Settings(**settings), kernel, find), timing))
        watched[-1].reader.start()
        return watched[-1]

    yield start
    for item in watched:
        assert item.reader.stop(TIMEOUT_S)
    assert kernel.descriptors == {}, "descriptors left open"


@pytest.fixture
def running(kernel, watch):
    """Function(settings) -> a camera, the reader of it, and how many frames that has."""

    def start(timing: ReaderTiming = FAST, **settings) -> tuple[FakeDigit, Watched, int]:
        camera, watched = kernel.plug(FakeDigit()), watch(timing, **settings)
        return camera, watched, watched.wait_for(streaming(3)).frames

    return start


def streaming(frames: int) -> Callable[[ReaderStatus], bool]:
    return lambda status: status.state is ReaderState.STREAMING and status.frames >= frames


def test_keeps_the_newest_frame_and_counts_those_replaced(kernel, watch) -> None:
    kernel.plug(FakeDigit())
    watched = watch()
    watched.wait_for(streaming(20))
    frame = watched.reader.take()
    assert frame.sequence >= 19
    status = watched.reader.status()
    assert (status.lost, status.corrupt, status.reconnects, status.last_error) == (0, 0, 0, "")
    assert status.overwritten >= 19
    watched.reader.stop()
    watched.reader.take()
    assert watched.reader.take() is None


def test_device_may_come_late(kernel, watch) -> None:
    watched = watch()
    assert watched.reader.wait_settled(TIMEOUT_S)
    status = watched.wait_for(lambda status: status.last_error)
    assert status.state is ReaderState.CONNECTING
    assert "no DIGIT" in status.last_error
    kernel.plug(FakeDigit())
    assert watched.wait_for(streaming(3)).reconnects == 0


def test_the_wait_at_the_start_has_an_end(watch) -> None:
    watched = watch(ReaderTiming(wait_for_device=0.05, reconnect=0.02))
    status = watched.wait_for(lambda status: status.state is ReaderState.FAILED)
    assert "no DIGIT" in status.last_error


@pytest.mark.parametrize("given", [{}, {"video_device": "/dev/video0"}], ids=["the only one", "by its number"])
def test_a_replugged_sensor_is_known_again_by_its_serial(kernel, watch, given) -> None:
    camera = kernel.plug(FakeDigit("D5", number=0))
    watched = watch(**given)
    before = watched.wait_for(streaming(3)).frames
    kernel.unplug(camera)
    status = watched.wait_for(lambda status: status.state is ReaderState.DISCONNECTED)
    assert status.last_error
    # Someone else takes the number meanwhile; without a pinned serial the reader would take it.
    kernel.plug(FakeDigit("D6", "1-6", number=0))
    watched.wait_for(lambda status: "no DIGIT D5" in status.last_error)
    camera.number = 8
    kernel.plug(camera)
    status = watched.wait_for(streaming(before + 3))
    assert (status.info.name, status.info.serial, status.reconnects) == ("/dev/video8", "D5", 1)


def test_foreign_camera_on_our_device_node_is_waited_out(kernel, running) -> None:
    camera, watched, _ = running(video_device="/dev/video0")
    kernel.unplug(camera)
    foreign = kernel.plug(FakeDigit(size=(1280, 720)))
    watched.wait_for(lambda status: "1280x720" in status.last_error)
    kernel.unplug(foreign)
    kernel.plug(camera)
    assert watched.wait_for(lambda status: status.reconnects == 1).state is ReaderState.STREAMING


@pytest.mark.parametrize(
    ("name", "fault", "error"),
    [
        ("stalled", True, "no good frame"),
        ("damaged", True, "no good frame"),
        ("errors", {v4l2.VIDIOC_DQBUF: errno.EIO}, "fetching a frame failed"),
    ],
)
def test_a_stream_that_gives_no_frames_is_opened_anew(running, name, fault, error) -> None:
    camera, watched, before = running()
    sound = getattr(camera, name)
    setattr(camera, name, fault)
    watched.wait_for(lambda status: error in status.last_error)
    setattr(camera, name, sound)
    assert watched.wait_for(streaming(before + 3)).reconnects >= 1
    assert camera.opened >= 2


@pytest.mark.parametrize("fault", ["damaged", "short"])
def test_some_corrupt_frames_are_counted_and_not_called_lost(running, fault) -> None:
    camera, watched, before = running(ReaderTiming(reconnect=0.02, stall=TIMEOUT_S))
    setattr(camera, fault, True)
    watched.wait_for(lambda status: status.corrupt >= 5)  # more than there are buffers
    setattr(camera, fault, False)
    status = watched.wait_for(streaming(before + 5))
    assert (status.lost, status.reconnects) == (0, 0)


def test_gaps_in_the_numbering_are_lost_frames(running) -> None:
    camera, watched, _ = running()
    camera.skip_sequence = 2
    status = watched.wait_for(lambda status: status.lost >= 6)
    assert status.lost % 2 == 0


def test_stopping_never_waits_for_a_call_that_hangs(kernel, find) -> None:
    class Hang(threading.Event):
        def wait(self, timeout=None):
            begun.set()
            return super().wait(timeout)

    begun, release = threading.Event(), Hang()
    camera = kernel.plug(FakeDigit())
    watched = Watched(V4l2Camera(V4l2Settings(), kernel, find))
    reader = watched.reader
    reader.start()
    watched.wait_for(streaming(1))
    camera.hanging = release
    assert begun.wait(TIMEOUT_S)
    watched.wait_for(lambda status: status.silent_s > 0.2)
    assert not reader.stop(timeout=0.1)
    with pytest.raises(DeviceError, match="hangs"):
        reader.start()
    camera.hanging = None
    release.set()
    watched.wait_for(lambda status: status.state is ReaderState.STOPPED)
    assert reader.stop(TIMEOUT_S)
    assert kernel.descriptors == {}
    reader.start()
    watched.wait_for(streaming(1))
    assert reader.stop(TIMEOUT_S)


def test_stopping_ends_the_wait_for_a_device(watch) -> None:
    watched = watch(ReaderTiming(reconnect=10 * TIMEOUT_S))
    watched.wait_for(lambda status: status.last_error)
    assert watched.reader.stop(TIMEOUT_S)
    assert watched.reader.status().state is ReaderState.STOPPED


def test_start_twice_and_start_again(kernel, watch) -> None:
    camera = kernel.plug(FakeDigit())
    watched = watch(ReaderTiming(stall=TIMEOUT_S))
    watched.wait_for(streaming(1))
    watched.reader.start()
    assert camera.opened == 1
    assert watched.reader.stop(TIMEOUT_S)
    camera.stalled = True
    watched.reader.start()
    assert watched.wait_for(streaming(0)).frames == 0
    camera.stalled = False
    watched.wait_for(streaming(1))
    assert camera.opened == 2


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_an_unexpected_error_is_reported_and_closes_the_source(kernel, find) -> None:
    class Broken(V4l2Camera):
        def read(self, timeout):
            raise ZeroDivisionError("surprise")

    kernel.plug(FakeDigit())
    watched = Watched(Broken(V4l2Settings(), kernel, find))
    watched.reader.start()
    status = watched.wait_for(lambda status: status.state is ReaderState.FAILED)
    assert "surprise" in status.last_error
    assert watched.reader.stop(TIMEOUT_S)
    assert kernel.descriptors == {}

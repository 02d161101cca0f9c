"""A codebook that grows while the filter already runs on a coarse one.

Each level is the beginning of one whole codebook, whose poses come in the order of farthest points: it covers the
surface as evenly as the whole. Measurement model, start and search for rivals all take an entry for an equal share of
the surface, so the work does not begin at the most probable places.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from midastouch_common.mesh import ObjectMesh
    from midastouch_perception.codebook import Codebook
    from midastouch_perception.sensor_model import SensorModel
    from midastouch_perception.tcn import TactileCodeNet

    from .core.object_model import ObjectModel

LEVELS = (10_000, 20_000, 50_000)
"""Poses; the last is what `midastouch build-codebook` takes."""

_NICENESS = 10


def levels(
    mesh: ObjectMesh, tcn: TactileCodeNet, sensor: SensorModel, pause: Callable[[], None] = lambda: None
) -> Iterator[Codebook]:
    """The codebooks of `LEVELS`; `pause` is called now and then, and what it raises ends the work."""
    # the runtime of networks is needed for this alone
    from midastouch_perception.codebook_build import CodebookBuild

    build = CodebookBuild(mesh, tcn, sensor, LEVELS[-1])
    for size in LEVELS:
        yield build.run(until=size, pause=pause)


class _Stopped(Exception):
    """Nobody wants the codebook any more."""


class Growth:
    """Makes codebooks and what a filter needs of them, in a thread of low priority.

    Args: codebooks(pause): makes one after the other; prepare: as `ObjectModel.with_codebook`. Attributes: failure: why
    it grows no more, in words.
    """

    def __init__(
        self,
        codebooks: Callable[[Callable[[], None]], Iterator[Codebook]],
        prepare: Callable[[Codebook], ObjectModel],
    ):
        self._codebooks, self._prepare = codebooks, prepare
        self._stop = threading.Event()
        self._ready: ObjectModel | None = None  # the newest; an older one that nobody took is forgotten
        self._exchange = threading.Lock()
        self._thread = threading.Thread(target=self._run, name="codebook growth")
        self.failure = ""

    def start(self) -> None:
        """Begin; `close` must follow."""
        self._thread.start()

    @property
    def done(self) -> bool:
        """Whether nothing is to come any more."""
        return not self._thread.is_alive() and self._ready is None

    def take(self) -> ObjectModel | None:
        """The densest that is ready, once."""
        with self._exchange:
            ready, self._ready = self._ready, None
        return ready

    def close(self) -> None:
        """Stop, within a second."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        # of this thread alone, and of those that it starts
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), _NICENESS)
        try:
            for codebook in self._codebooks(self._pause):
                prepared = self._prepare(codebook)
                with self._exchange:
                    self._ready = prepared
                self._pause()
        except _Stopped:
            pass
        except Exception as error:  # said in the status; the filter goes on with what it has
            self.failure = f"{type(error).__name__}: {error}"

    def _pause(self) -> None:
        if self._stop.is_set():
            raise _Stopped

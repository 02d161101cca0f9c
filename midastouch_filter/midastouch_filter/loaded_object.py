"""An object to localise on: the filter on its mesh and codebook, read from files or built on the spot.

An object that comes without a codebook gets a coarse one in seconds. A dense one follows, while the filter already runs
on the coarse one.
"""

from __future__ import annotations

import dataclasses
import os
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from midastouch_common.mesh import ObjectMesh
from midastouch_perception.codebook import Codebook
from midastouch_perception.sensor_model import SensorModel

from .active_touch.suggestion import Advisor
from .core import workers
from .core.config import FilterConfig
from .core.object_model import ObjectModel
from .filter import ParticleFilter
from .paper_filter import PaperFilter, PaperObject

if TYPE_CHECKING:
    from midastouch_perception.tcn import AnyCodeNet

RunningFilter = ParticleFilter | PaperFilter

SIZE = 5_000
"""Poses of a coarse codebook, built in seconds: a tenth of those that `midastouch build-codebook` takes."""
DENSE = 50_000
"""Poses of a dense codebook, as many as `midastouch build-codebook` takes."""

_NICENESS = 10


class _Stopped(Exception):
    """`Growth.close` was called."""


class Growth:
    """Thread of low priority that makes a codebook and what a filter needs of it.

    Args: build(pause), which makes the codebook and calls `pause` at times; prepare, as `ObjectModel.with_codebook`.
    Attributes: failure, why there is no denser codebook, "" as long as nothing failed.
    """

    def __init__(
        self, build: Callable[[Callable[[], None]], Codebook], prepare: Callable[[Codebook], ObjectModel | PaperObject]
    ):
        self._build, self._prepare = build, prepare
        self._stop = threading.Event()
        self._ready: ObjectModel | PaperObject | None = None
        self._exchange = threading.Lock()
        self._thread = threading.Thread(target=self._run, name="codebook growth")
        self.failure = ""

    def start(self) -> None:
        """Start the thread; `close` must follow."""
        self._thread.start()

    @property
    def done(self) -> bool:
        """True once the thread has ended and its result was taken."""
        return not self._thread.is_alive() and self._ready is None

    def take(self) -> ObjectModel | PaperObject | None:
        """Return the result once, when it is ready; otherwise None."""
        with self._exchange:
            ready, self._ready = self._ready, None
        return ready

    def close(self) -> None:
        """Stop the thread, within a second."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        # on Linux this sets the niceness of this thread alone, and of those that it starts
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), _NICENESS)
        try:
            prepared = self._prepare(self._build(self._pause))
            with self._exchange:
                self._ready = prepared
        except _Stopped:
            pass
        except Exception as error:  # shown in the status; the filter keeps the codebook it has
            self.failure = f"{type(error).__name__}: {error}"

    def _pause(self) -> None:
        if self._stop.is_set():
            raise _Stopped


@dataclasses.dataclass(frozen=True)
class LoadedObject:
    """The filter on one object.

    Attributes
    ----------
    filter
    diagonal : of the object [m]
    name
    sensor
        Sensor of the codebook at map resolution, None if unknown.
    network_id
        Network of the codebook's codes, "" if unknown.
    advisor
        Suggests where to touch next; None if the filter cannot.
    growth
        Builds a denser codebook meanwhile; None if the codebook is complete.
    """

    filter: RunningFilter
    diagonal: float
    name: str
    sensor: SensorModel | None = None
    network_id: str = ""
    advisor: Advisor | None = None
    growth: Growth | None = None

    @property
    def density(self) -> str:
        """Density of the codebook, and the precision that it allows, as a phrase."""
        return self.filter.object.density

    @property
    def coarse(self) -> str:
        """Note that the codebook grows, or why it does not; empty for a complete one."""
        if self.growth is None or not (self.growth.failure or not self.growth.done):
            return ""
        return f"{self.density}; {f'no denser: {self.growth.failure}' if self.growth.failure else 'growing'}"

    def take_growth(self) -> None:
        """Switch the filter to a denser codebook, if one is ready."""
        if self.growth is not None and (prepared := self.growth.take()) is not None:
            self.filter.take(prepared)  # type: ignore[arg-type] # this filter has prepared it

    def close(self) -> None:
        """Stop building a denser codebook."""
        if self.growth is not None:
            self.growth.close()


def load_object(
    mesh_path: Path, codebook_path: Path, config: FilterConfig, seed: int, paper: bool = False
) -> LoadedObject:
    """Load mesh and codebook, and make a filter on them.

    Parameters
    ----------
    mesh_path, codebook_path
    config, seed
        As for `ParticleFilter`.
    paper
        With True, the paper's own filter.

    Raises
    ------
    InputError
        A file cannot be used, or they do not belong together.
    """
    mesh = ObjectMesh.load(mesh_path)
    return object_of(mesh, Codebook.load(codebook_path, mesh=mesh), config, seed, paper)


def object_of(
    mesh: ObjectMesh, codebook: Codebook, config: FilterConfig, seed: int, paper: bool = False
) -> LoadedObject:
    """Return the filter, or the paper's, on a mesh and its codebook; raises InputError on an unusable codebook."""
    running: RunningFilter
    if paper:
        running = PaperFilter(mesh, codebook, clock=time.perf_counter, threads=config.threads, limits=config)
        running.reset(seed)
    else:
        running = ParticleFilter(mesh, codebook, config, seed, clock=time.perf_counter)
    advisor = Advisor(running) if isinstance(running, ParticleFilter) else None
    workers.trim()
    sensor = SensorModel.of_codebook(codebook.meta).for_maps
    network_id = str(codebook.meta["tcn"])
    return LoadedObject(running, mesh.diagonal, mesh.name, sensor, network_id, advisor)


def build_object(
    mesh_path: Path, network: str, sensor_model: str, config: FilterConfig, seed: int, paper: bool = False
) -> LoadedObject:
    """Build a codebook of `SIZE` poses and make a filter on it, with the `growth` that builds one of `DENSE` poses.

    Parameters
    ----------
    mesh_path
    network, sensor_model
        Names or paths, as the nodes `tcn` and `tdn` take them.
    config, seed, paper
        As for `load_object`.

    Raises
    ------
    InputError
        Unknown name, missing file, mesh that cannot be used or has no reachable surface.
    """
    mesh, tcn, sensor, codebook = _built(mesh_path, network, sensor_model, config)
    loaded = object_of(mesh, codebook, config, seed, paper)
    growth = Growth(lambda pause: dense_codebook(mesh, tcn, sensor, pause), loaded.filter.object.with_codebook)
    return dataclasses.replace(loaded, growth=growth)


def coarse_codebook(
    mesh_path: Path, network: str, sensor_model: str, config: FilterConfig
) -> tuple[ObjectMesh, Codebook]:
    """Return a mesh and build its codebook of `SIZE` poses.

    Parameters
    ----------
    mesh_path, network, sensor_model, config
        As for `build_object`, also the errors.
    """
    mesh, _, _, codebook = _built(mesh_path, network, sensor_model, config)
    return mesh, codebook


def _built(
    mesh_path: Path, network: str, sensor_model: str, config: FilterConfig
) -> tuple[ObjectMesh, AnyCodeNet, SensorModel, Codebook]:
    # imported here, because nothing else needs the runtime of networks
    from midastouch_perception.codebook_build import CodebookBuild
    from midastouch_perception.tcn import load_tcn

    mesh, sensor = ObjectMesh.load(mesh_path), SensorModel.load(sensor_model)
    tcn, jobs = load_tcn(network, sensor), config.threads or len(os.sched_getaffinity(0))
    return mesh, tcn, sensor, CodebookBuild(mesh, tcn, sensor, SIZE).run(jobs)


def dense_codebook(
    mesh: ObjectMesh, tcn: AnyCodeNet, sensor: SensorModel, pause: Callable[[], None] = lambda: None
) -> Codebook:
    """Build the codebook of `DENSE` poses; `pause` is called now and then, and an exception from it ends the work."""
    # imported here, because nothing else needs the runtime of networks
    from midastouch_perception.codebook_build import CodebookBuild

    return CodebookBuild(mesh, tcn, sensor, DENSE).run(pause=pause, tried=pause)

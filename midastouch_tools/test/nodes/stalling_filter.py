"""The filter's node on a fake filter that is busy for long now and then: a program for tests of who waits for it."""

from __future__ import annotations

import dataclasses
import sys
import time
from pathlib import Path

sys.path.extend(str(Path(__file__).parents[3] / folder) for folder in ("tests", "midastouch_filter/test/nodes"))

from filter_fakes import DIAGONAL, MAP_SENSOR, FakeFilter

from midastouch_common.ros import spin
from midastouch_filter.loaded_object import LoadedObject
from midastouch_filter.nodes.particle_filter import ParticleFilterNode

STALL_S, BUSY_STEPS = 2.5, (1, 6)


class StallingFilter(FakeFilter):
    """Takes the codes of any network; some of its steps take long."""

    def step(self, odometry, measurement, others=None, elapsed=None):
        if len(self.measurements) in BUSY_STEPS:
            time.sleep(STALL_S)
        return super().step(odometry, dataclasses.replace(measurement, network_id="fake"), others, elapsed)


def load(mesh_path, codebook_path, config, seed, paper) -> LoadedObject:
    """An object, the second one after a long time."""
    if mesh_path.stem == "cup":
        time.sleep(STALL_S)
    return LoadedObject(StallingFilter(), DIAGONAL, mesh_path.stem, MAP_SENSOR)


if __name__ == "__main__":
    raise SystemExit(spin.run(lambda: [ParticleFilterNode(load=load)]))

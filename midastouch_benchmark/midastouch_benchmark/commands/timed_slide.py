"""What the commands that time the filter share: the slide they time it on, and how their results begin."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from typing import TYPE_CHECKING

from midastouch_bringup.commands import arguments
from midastouch_common.errors import InputError

if TYPE_CHECKING:
    from midastouch_bringup.datasets import Sequence
    from midastouch_common.mesh import ObjectMesh

    from ..trials.setup import Networks

_FEWEST = 10  # frames, of which the first ones are dropped


@dataclass(frozen=True)
class TimedSlide:
    """A simulated slide of --frames over a bundled object, and the networks that feel it."""

    mesh: ObjectMesh
    sequence: Sequence
    networks: Networks

    @classmethod
    def of(cls, args: argparse.Namespace) -> TimedSlide:
        """By --object, --frames and the networks' options. InputError for too few frames, or for what is not there."""
        from midastouch_bringup.datasets import load_sequence
        from midastouch_bringup.datasets.slide_simulation import cached_slide
        from midastouch_perception.simulation.slide import STEP

        from ..trials.setup import Networks

        if args.frames < _FEWEST:
            raise InputError(f"--frames {args.frames}: too few to time; give at least {_FEWEST}")
        networks = Networks.load(args.tdn, args.tcn, args.sensor)
        mesh = arguments.load_mesh(args.object)
        return cls(mesh, load_sequence(cached_slide(mesh, networks.sensor, STEP * args.frames)), networks)

    def result(self, **measured: object) -> dict:
        """What was measured on it, and on which machine, object and networks."""
        from midastouch_bringup.machine import machine_info

        machine = machine_info()
        about = {"machine": machine, "object": self.mesh.name, "networks": self.networks.describe()}
        return {"threads": machine["cores"]} | about | measured

"""Executable `all_in_one`: tdn, tcn and particle_filter (and the driver) in one process and one executor.

The nodes keep their names, parameters, topics and services; only the arrays between the stages are handed
over directly, so that clouds and codes do not have to pass through DDS.
"""

from __future__ import annotations

import argparse
import contextlib
from collections.abc import Callable, Iterator

from rclpy.node import Node
from rclpy.utilities import remove_ros_args
from std_msgs.msg import Header

from midastouch_common.message_arrays import stamp_ns
from midastouch_common.ros import spin
from midastouch_filter.core.touch import measurement_of
from midastouch_filter.loaded_object import LoadedObject, load_object
from midastouch_filter.nodes.particle_filter import ParticleFilterNode
from midastouch_perception.nodes.tcn import TcnNode
from midastouch_perception.nodes.tdn import TdnNode
from midastouch_perception.pipeline import DepthStage, TouchReading
from midastouch_perception.tcn import AnyCodeNet


def make_nodes(
    depth: DepthStage | None = None,
    tcn: AnyCodeNet | None = None,
    load: Callable[..., LoadedObject] = load_object,
    options: dict[str, dict] | None = None,
) -> list[Node]:
    """Make the three stages, wired to each other.

    depth, tcn, load: as in the nodes' constructors. options: further arguments of rclpy's node, by node name.
    """
    options = options or {}
    with contextlib.ExitStack() as made:  # if one cannot be made, the others are destroyed
        running = ParticleFilterNode(load=load, subscribe=False, **options.get("particle_filter", {}))
        made.callback(running.destroy_node)

        def on_touch(header: Header, touch: TouchReading) -> None:
            running.on_code(stamp_ns(header.stamp), measurement_of(touch))

        encoder = TcnNode(tcn=tcn, sink=on_touch, subscribe=False, **options.get("tcn", {}))
        made.callback(encoder.destroy_node)
        depth_node = TdnNode(depth=depth, sink=encoder.on_contact, **options.get("tdn", {}))
        made.pop_all()
    return [depth_node, encoder, running]


def make_driver() -> Node:
    """Make the sensor's driver."""
    from digit_driver.nodes.digit_driver import DigitDriver

    return DigitDriver()


def main(args: list[str] | None = None) -> int:
    """Entry point of the executable; exit code 1: the driver gave up."""
    parser = argparse.ArgumentParser(
        prog="all_in_one",
        description="tdn, tcn and particle_filter in one process; parameters by node name, as for the single "
        "nodes: --ros-args --params-file midastouch.yaml -p particle_filter:seed:=1",
    )
    parser.add_argument("--driver", action="store_true", help="run digit_driver in this process, too")
    chosen = parser.parse_args(remove_ros_args(args)[1:])

    def nodes() -> Iterator[Node]:
        if chosen.driver:
            yield make_driver()
        yield from make_nodes()

    return spin.run(nodes, args)


if __name__ == "__main__":
    raise SystemExit(main())

"""Executable `all_in_one`: tdn, tcn and particle_filter (and the driver) in one process and one executor.

The nodes keep their names, parameters, topics and services; only the arrays between the stages are handed
over directly, which saves a cloud and a code their way through DDS.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.utilities import remove_ros_args
from std_msgs.msg import Header

from midastouch_filter.filter import Measurement
from midastouch_filter.nodes.localiser import LoadedObject, load_object
from midastouch_filter.nodes.particle_filter import ParticleFilterNode
from midastouch_filter.touch import reduced_penetration
from midastouch_perception.errors import InputError
from midastouch_perception.nodes.stages import Code
from midastouch_perception.nodes.tcn import TcnNode
from midastouch_perception.nodes.tdn import TdnNode
from midastouch_perception.pipeline import DepthStage
from midastouch_perception.ros import spin
from midastouch_perception.ros.conversions import stamp_ns
from midastouch_perception.tcn import TactileCodeNet

_LOOK_S = 0.5


def make_nodes(
    depth: DepthStage | None = None,
    tcn: TactileCodeNet | None = None,
    load: Callable[..., LoadedObject] = load_object,
    options: dict[str, dict] | None = None,
) -> list[Node]:
    """The three stages, wired to each other.

    depth, tcn, load: as in the nodes' constructors. options: further arguments of rclpy's node by node name.
    """
    options = options or {}
    running = ParticleFilterNode(load=load, subscribe=False, **options.get("particle_filter", {}))

    def on_code(header: Header, code: Code) -> None:
        measurement = Measurement(False, network_id=code.network_id)
        if code.in_contact:
            relief = reduced_penetration(code.penetration)
            measurement = Measurement(True, code.values, code.area_m2, code.network_id, relief)
        running.on_code(stamp_ns(header.stamp), measurement)

    encoder = TcnNode(tcn=tcn, sink=on_code, subscribe=False, **options.get("tcn", {}))
    return [TdnNode(depth=depth, sink=encoder.on_depth, **options.get("tdn", {})), encoder, running]


def make_driver() -> Node:
    """The sensor's driver; its errors as those of the other nodes."""
    from digit_driver.errors import InputError as DriverInputError
    from digit_driver.nodes.digit_driver import DigitDriver

    try:
        driver = DigitDriver()
    except DriverInputError as error:
        raise InputError(str(error)) from error
    # in a process of its own a driver that gives up ends it; the others must not go on blind
    steady = Clock(clock_type=ClockType.STEADY_TIME)
    driver.create_timer(_LOOK_S, lambda: spin.stop() if driver.failure else None, clock=steady)
    return driver


def main(args: Sequence[str] | None = None) -> int:
    """Entry point of the executable; exit code 1: the driver gave up."""
    parser = argparse.ArgumentParser(
        prog="all_in_one",
        description="tdn, tcn and particle_filter in one process; parameters by node name, as for the single "
        "nodes: --ros-args --params-file midastouch.yaml -p particle_filter:seed:=1",
    )
    parser.add_argument("--driver", action="store_true", help="run digit_driver in this process, too")
    chosen = parser.parse_args(remove_ros_args(args)[1:])
    drivers: list[Node] = []

    def make() -> list[Node]:
        if chosen.driver:
            drivers.append(make_driver())
        return [*drivers, *make_nodes()]

    return spin.run(make, args) or int(any(driver.failure for driver in drivers))


if __name__ == "__main__":
    raise SystemExit(main())

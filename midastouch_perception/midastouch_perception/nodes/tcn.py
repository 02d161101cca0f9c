"""Node `tcn`: from the cloud of contact points to the code of the touch."""

from __future__ import annotations

import time
from collections.abc import Callable

from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from midastouch_common.errors import InputError
from midastouch_common.message_arrays import points_from_msg
from midastouch_common.ros import diagnostics, qos, spin
from midastouch_common.ros.conversions import float32_to_msg
from midastouch_common.ros.graph_watch import OnlyPublisher
from midastouch_common.ros.managed_node import AUTOSTART, ManagedNode
from midastouch_common.ros.parameters import QUEUE, Parameter
from midastouch_msgs.msg import TactileCode

from ..contact import Contact
from ..pipeline import CodeStage, TouchReading
from ..pointcloud import penetration_from_cloud
from ..sensor_model import SensorModel
from ..tcn import load_tcn

PARAMETERS = (
    Parameter("tcn", "fast", "Code network: a shipped one by name, or the path of its ONNX file"),
    Parameter("sensor_model", "digit_tacto", "Geometry of the sensor: a shipped one by name, or a YAML file"),
    *QUEUE,
    AUTOSTART,
)


class TcnNode(ManagedNode):
    """Node that, while active, publishes one TactileCode for every valid cloud, with its stamp and frame.

    For an empty cloud the message has no code. `tcn` replaces the network that the parameters name. When all stages run
    in one process, `on_contact` takes the place of the cloud topic (`subscribe` false), and `sink`, called with the
    header and the touch of each frame, hands the code to the filter.
    """

    def __init__(
        self,
        tcn=None,
        sink: Callable[[Header, TouchReading], None] | None = None,
        subscribe: bool = True,
        **node_options,
    ):
        super().__init__("tcn", PARAMETERS, **node_options)
        self._given, self._sink, self._subscribe = tcn, sink, subscribe
        self._stage: CodeStage | None = None
        self._codes = self.create_publisher(
            TactileCode, "tactile/code", qos.stage_publisher(self.parameters["queue_depth"])
        )
        self._rate, self._clouds_from = diagnostics.Rate(), OnlyPublisher(self, "tactile/points")
        self.autostart()

    def configure(self) -> None:
        """Load the code network."""
        sensor = SensorModel.load(self.parameters["sensor_model"])
        self._map_sensor = sensor.for_maps
        self.say(f"loading the code network '{self.parameters['tcn']}'")
        self._stage = CodeStage(self._given or load_tcn(self.parameters["tcn"], sensor))

    def unload(self) -> None:
        """Release the network."""
        self._stage = None

    def connect(self) -> None:
        """Subscribe to the clouds."""
        if self._subscribe:
            profile = qos.stage_subscriber(self.parameters["queue_depth"], self.parameters["reliable"])
            self.create_subscription(PointCloud2, "tactile/points", self._on_points, profile)

    def _on_points(self, msg: PointCloud2) -> None:
        started = time.perf_counter()
        try:
            penetration = penetration_from_cloud(points_from_msg(msg), self._map_sensor)
        except InputError as error:
            self.diagnostics.problem("bad_clouds", f"tactile/points: {error}")
            return
        self._encode(msg.header, Contact.of(penetration, self._map_sensor), started)

    def on_contact(self, header: Header, contact: Contact) -> None:
        """Take a result of the depth stage in the same process; it is dropped while the node is not active."""
        if self.active:
            self._encode(header, contact, time.perf_counter())

    def _encode(self, header: Header, contact: Contact, started: float) -> None:
        touch = self._stage.process(contact)
        self._codes.publish(
            TactileCode(
                header=header,
                in_contact=contact.in_contact,
                contact_area=contact.area_m2,
                code=float32_to_msg([] if touch.code is None else touch.code),
                network_id=touch.network_id,
            )
        )
        if self._sink is not None:
            self._sink(header, touch)
        self._rate.add(time.perf_counter() - started)

    def describe(self) -> tuple[bytes, str, dict]:
        """Return level, message and values for the diagnostics."""
        problem = self._clouds_from.problem if self._subscribe else ""
        level = diagnostics.WARN if problem else diagnostics.OK
        return level, problem, {**self._rate.values(), **self._stage.skipped}


def main(args=None) -> int:
    """Entry point of the executable `tcn`."""
    return spin.run(lambda: [TcnNode()], args)


if __name__ == "__main__":
    raise SystemExit(main())

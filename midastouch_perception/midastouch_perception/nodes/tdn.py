"""Node `tdn`: from tactile images to the penetration map, the contact and the cloud of contact points."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from sensor_msgs.msg import Image, PointCloud2
from std_msgs.msg import Header

from midastouch_common.errors import InputError
from midastouch_common.message_arrays import rgb_from_msg
from midastouch_common.ros import diagnostics, qos, spin
from midastouch_common.ros.addresses import resolve
from midastouch_common.ros.conversions import image_to_msg, points_to_msg
from midastouch_common.ros.graph_watch import OnlyPublisher, publishers, why_silent
from midastouch_common.ros.managed_node import AUTOSTART, ManagedNode
from midastouch_common.ros.parameters import QUEUE, Parameter
from midastouch_msgs.msg import TactileContact

from ..backends import AUTO, BACKENDS
from ..contact import Contact, ContactState
from ..gel_texture import GelCheck
from ..pipeline import DepthStage
from ..pointcloud import cloud_from_penetration
from ..sensor_model import SensorModel
from ..tdn import load_tdn
from ..tdn.background import TouchedBackground
from ..tdn.background_store import SensorBackground, store_of
from ..tdn.depth_net import CalibrationInUse
from ..tdn.fit_check import FitCheck
from ..tdn.fixed_pattern import PatternCheck, rolled_problem
from ..tdn.frame_guard import FrameGuard
from .capture_service import CaptureService
from .contact_message import contact_to_msg

SILENT_S = 5.0
"""Time without an image [s] after which the diagnostics warn."""

PARAMETERS = (
    Parameter("tdn", "fast", "Depth network: a shipped one by name, or the path of its ONNX file"),
    Parameter(
        "backend",
        AUTO,
        f"What runs the network: {', '.join(BACKENDS[1:])}; auto: the fastest one installed that answers alike",
    ),
    Parameter("sensor_model", "digit_tacto", "Geometry of the sensor: a shipped one by name, or a YAML file"),
    Parameter(
        "background",
        "",
        "No-contact image of this sensor, or a folder of its images; empty: estimated from the first ones",
    ),
    Parameter(
        "serial",
        "",
        "Serial number of the sensor: its captured background and its calibration are kept under it; empty: not kept",
    ),
    Parameter(
        "background_folder", "", "Where they are kept for the next start; empty: $ROS_HOME/midastouch/backgrounds"
    ),
    Parameter("background_frames", 32, "Images a background is estimated or captured from", minimum=1, maximum=1000),
    Parameter(
        "still_threshold",
        2.0,
        "capture_background refuses images of which a 16 x 16 block changes by more than this",
        unit="grey levels",
        minimum=0.0,
        maximum=255.0,
        read_only=False,
    ),
    Parameter(
        "capture_timeout",
        5.0,
        "capture_background gives up when its images have not come within this time",
        unit="s",
        minimum=0.1,
        maximum=600.0,
        read_only=False,
    ),
    Parameter("sensor_frame_id", "digit_gel_frame", "Frame of the cloud: the gel frame"),
    *QUEUE,
    AUTOSTART,
)


class TdnNode(ManagedNode):
    """Node that, while active, publishes for every valid image one cloud and one TactileContact, with its stamp.

    Without contact the cloud is empty. `depth` replaces the network that the parameters name. When the next stage runs
    in the same process, `sink`, called with the header and the contact of each frame, replaces the cloud, which is then
    published only if it has a subscriber.
    """

    def __init__(
        self, depth: DepthStage | None = None, sink: Callable[[Header, Contact], None] | None = None, **node_options
    ):
        super().__init__("tdn", PARAMETERS, **node_options)
        self._given, self._sink = depth, sink
        out = qos.stream_publisher(self.parameters["queue_depth"])
        self._points = self.create_publisher(
            PointCloud2, "tactile/points", qos.stage_publisher(self.parameters["queue_depth"])
        )
        self._penetration = self.create_publisher(Image, "tactile/penetration", out)
        self._contact = self.create_publisher(TactileContact, "tactile/contact", out)
        self._captures = CaptureService(self, self._contact_in, lambda image: self._background.replace(image))
        self._rate, self._images_from = diagnostics.Rate(), OnlyPublisher(self, "image_raw")
        self._unseen_clouds, self._any_image = 0, False
        self._state = ContactState.FREE
        self.autostart()

    def configure(self) -> None:
        """Load the depth network and the background."""
        self._sensor = SensorModel.load(self.parameters["sensor_model"])
        self._map_sensor = self._sensor.for_maps
        self._fit = FitCheck(self._map_sensor)
        store = store_of(self.parameters["background_folder"], self.parameters["serial"])
        self.say(f"loading the depth network '{self.parameters['tdn']}'")
        tdn = (
            None if self._given else load_tdn(self.parameters["tdn"], self._sensor, backend=self.parameters["backend"])
        )
        kept = store.load_calibration(self._sensor) if store and tdn else None
        self._calibration = CalibrationInUse(tdn, kept, self._sensor)
        self._backend = tdn.backend if tdn else "given"
        self._touched = TouchedBackground(tdn)
        self._gel = GelCheck(self._sensor)
        self._guard, self._pattern = FrameGuard(), PatternCheck()
        self._stage = self._given or DepthStage(tdn, self._fit, self._touched, self._gel)
        self.say(f"backend: {self._backend}; loading the background; calibration: {self._calibration}")
        frames = self.parameters["background_frames"]
        given = self.parameters["background"]
        self._background = SensorBackground(self._sensor, given and resolve(given, "background"), store, frames)
        if self._background.image is not None:
            self._calibration.check(self._background.image)

    def unload(self) -> None:
        """Release the network and the background."""
        self._stage = self._background = None
        self._any_image = False

    def connect(self) -> None:
        """Subscribe to the images."""
        self._heard = time.monotonic()
        profile = qos.stream_subscriber(self.parameters["queue_depth"], self.parameters["reliable"])
        self.create_subscription(Image, "image_raw", self._on_image, profile)

    def disconnect(self) -> None:
        """Refuse a capture that is under way."""
        self._captures.refuse("the node was deactivated")

    def _on_image(self, msg: Image) -> None:
        started, self._heard = time.perf_counter(), time.monotonic()
        try:
            image = rgb_from_msg(msg, self._sensor.height, self._sensor.width)
        except InputError as error:
            self.diagnostics.problem("bad_images", f"image_raw: {error}")
            return
        self._any_image = True
        if not (refused := self._guard.refusal(image)):
            self._observe_background(image)  # also a misplaced one, because a new no-contact image may be the fix
            refused = self._pattern.refusal(image, self._background.image)
        if refused:
            self.diagnostics.problem(refused.kind, f"image_raw: {refused.reason}")
            return
        contact = self._stage.process(image, self._background.image)
        self._publish(Header(stamp=msg.header.stamp, frame_id=self.parameters["sensor_frame_id"]), contact)
        self._stage.deferred_update()
        if self._gel.another:
            self._calibration.refuse(self._gel.problem)
        self._rate.add(time.perf_counter() - started)

    def _observe_background(self, image: np.ndarray) -> None:
        former = self._background.image
        self._background.observe(image)
        self._captures.observe(image)
        if self._background.image is not former:
            self._fit.reset()
            self._touched.reset()
            self._gel.reset()
            self._calibration.check(self._background.image)

    def _contact_in(self, image: np.ndarray) -> str:
        """Return the reason to refuse a captured image; empty if it is accepted."""
        if self._stage.shows_contact(image, self._background.image):
            return "the sensor is touching something; lift the finger off and try again"
        return rolled_problem(image)

    def _publish(self, header: Header, contact: Contact) -> None:
        self._contact.publish(contact_to_msg(contact, header))
        self._state = contact.state
        if self._sink is None or self._points.get_subscription_count() > 0:
            points = cloud_from_penetration(contact.penetration, contact.penetration > 0, self._map_sensor)
            self._points.publish(points_to_msg(points, header))
        else:
            self._unseen_clouds += 1
        if self._penetration.get_subscription_count() > 0:
            self._penetration.publish(image_to_msg(contact.penetration, "32FC1", header))
        if self._sink is not None:
            self._sink(header, contact)

    def obstacles(self) -> dict[str, str]:
        """Return that the no-contact image is doubtful, or that no image has come yet, if nobody publishes any.

        A driver or a replay names its own trouble, but its mere start does not end the one that has been logged.
        """
        if doubt := self._background.doubt(self.parameters["still_threshold"]):
            return {"background": doubt}
        if self._any_image or (publishers(self, "image_raw") and not self.has_warned("no_image")):
            return {}
        topic = self.resolve_topic_name("image_raw")
        return {"no_image": f"no image on {topic}, so no pose: no node publishes it; start a driver or a replay"}

    def describe(self) -> tuple[bytes, str, dict]:
        """Return level, message and values for the diagnostics."""
        values = {**self._rate.values(), "background": self._background.source, **self._stage.skipped}
        values["no_subscriber"] = self._unseen_clouds
        values |= {**self._fit.values, **self._gel.values, "calibration": str(self._calibration)}
        values |= {"backend": self._backend, "contact": self._state.value}
        if (
            problem := self._images_from.problem
            or self._background.problem
            or self._touched.problem
            or self._fit.problem
            or self._gel.problem
            or self._calibration.problem
            or (self._state.problem if self._fit.quiet is not None else "")  # before, it may find a deeper reason
            or self._background.doubt(self.parameters["still_threshold"])
        ):
            return diagnostics.WARN, problem, values
        if (silent := time.monotonic() - self._heard) > SILENT_S:
            topic = self.resolve_topic_name("image_raw")
            return diagnostics.WARN, f"no image on {topic} for {silent:.0f} s: {why_silent(self, topic)}", values
        return diagnostics.OK, "", values


def main(args=None) -> int:
    """Entry point of the executable `tdn`."""
    return spin.run(lambda: [TdnNode()], args)


if __name__ == "__main__":
    raise SystemExit(main())

"""Node `tdn`: tactile images -> penetration map, contact and the cloud of contact points."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.task import Future
from sensor_msgs.msg import Image, PointCloud2
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from midastouch_msgs.msg import TactileContact

from ..errors import InputError
from ..pipeline import DepthStage
from ..pointcloud import cloud_from_penetration
from ..ros import diagnostics, qos, spin
from ..ros.conversions import image_to_msg, points_to_msg, rgb_from_msg
from ..ros.managed_node import AUTOSTART, ManagedNode
from ..ros.parameters import QUEUE, Parameter
from ..sensor_model import SensorModel
from ..tdn import load_tdn
from ..tdn.colour_layout import exposure_problem, image_problem, shipped_layout, turned_since
from ..tdn.fit_check import FitCheck
from ..tdn.inputs import SCALE
from .background import BackgroundCapture, RunningBackground, read_background
from .background_store import store_of
from .stages import Depth, ImageStage

_MOST_SATURATED = 0.5  # of an image; a glint of the light on a contact is less

PARAMETERS = (
    Parameter("tdn", "fast", "Depth network: a shipped one by name, or the path of its ONNX file"),
    Parameter("sensor_model", "digit_tacto", "Geometry of the sensor: a shipped one by name, or a YAML file"),
    Parameter(
        "background",
        "",
        "No-contact image of this sensor, or a folder of its images; empty: estimated from the first ones",
    ),
    Parameter(
        "serial", "", "Serial number of the sensor: what capture_background takes is kept under it; empty: not kept"
    ),
    Parameter("background_folder", "", "Where it is kept for the next start; empty: $ROS_HOME/midastouch/backgrounds"),
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
    """While active, every valid image yields one cloud (empty without contact) and one TactileContact of its stamp.

    `depth` replaces the network that the parameters name. When the next stage runs in the same process,
    `sink`, called with the header and the depth of each frame, takes the place of the cloud on the way to it;
    the cloud is then published for other subscribers only.
    """

    def __init__(
        self,
        depth: DepthStage | None = None,
        sink: Callable[[Header, Depth], None] | None = None,
        **node_options,
    ):
        super().__init__("tdn", PARAMETERS, **node_options)
        self._given, self._sink = depth, sink
        self._running: RunningBackground | None = None
        self._capture: BackgroundCapture | None = None
        self._captured: Future | None = None

        out = qos.stream_publisher(self.parameters["queue_depth"])
        self._points = self.create_publisher(
            PointCloud2, "tactile/points", qos.stage_publisher(self.parameters["queue_depth"])
        )
        self._penetration = self.create_publisher(Image, "tactile/penetration", out)
        self._contact = self.create_publisher(TactileContact, "tactile/contact", out)
        # In a group of its own: while it waits for images, they must get through.
        group = ReentrantCallbackGroup()
        self.create_service(Trigger, "capture_background", self._on_capture, callback_group=group)
        self._rate = diagnostics.Rate()
        self._unseen_clouds = 0
        self.autostart()

    def configure(self) -> None:
        """Load the depth network and the background."""
        self._sensor = SensorModel.load(self.parameters["sensor_model"])
        self._map_sensor = self._sensor.scaled(SCALE)
        self._fit, self._layout = FitCheck(), shipped_layout()
        self.say(f"loading the depth network '{self.parameters['tdn']}'")
        self._depth = self._given or DepthStage(load_tdn(self.parameters["tdn"], self._sensor), fit=self._fit)
        self._stage = ImageStage(self._depth)
        self.say("loading the background")
        self._load_background()

    def unload(self) -> None:
        """Forget the network and the background."""
        self._depth = self._stage = self._background = self._running = self._image = None

    def connect(self) -> None:
        """Subscribe the images."""
        profile = qos.stream_subscriber(self.parameters["queue_depth"], self.parameters["reliable"])
        self.create_subscription(Image, "image_raw", self._on_image, profile)

    def disconnect(self) -> None:
        """Refuse a capture that is under way."""
        self._finish_capture(None, "the node was deactivated")

    def _load_background(self) -> None:
        path = self.parameters["background"]
        self._running = None
        self._background, self._background_source, self._background_problem = None, "none yet", ""
        self._store = store_of(self.parameters["background_folder"], self.parameters["serial"])
        size = self._sensor.height, self._sensor.width
        if path:
            self._set_background(read_background(path, *size), f"file {path}")
        elif self._store is not None and (kept := self._store.load(*size)) is not None:
            self._set_background(kept, f"kept in {self._store.path}")
        else:
            self._running = RunningBackground(self.parameters["background_frames"])

    def _set_background(self, image: np.ndarray, source: str) -> None:
        self._background, self._background_source = image, source
        self._background_problem = image_problem(image, self._layout)
        self._fit.reset()

    def _on_image(self, msg: Image) -> None:
        started = time.perf_counter()
        try:
            image = rgb_from_msg(msg, self._sensor.height, self._sensor.width)
            # the network would feel a contact in it; every fourth pixel tells
            if problem := exposure_problem(image[::4, ::4], _MOST_SATURATED):
                raise InputError(f"the image is {problem}")
        except InputError as error:
            self.diagnostics.problem("bad_images", f"image_raw: {error}")
            return
        self._image = image
        self._observe_background(image)
        depth = self._stage.process(image, self._background)
        self._publish(Header(stamp=msg.header.stamp, frame_id=self.parameters["sensor_frame_id"]), depth)
        self._rate.add(time.perf_counter() - started)

    def _observe_background(self, image) -> None:
        if self._running is not None:
            self._running.add(image)
            if self._running.image is not self._background:
                self._set_background(self._running.image, f"the first {self._running.count} images")
        if self._capture is not None:
            self._capture.add(image)
            if self._capture.done:
                self._finish_capture(
                    self._capture.image, self._capture.refusal or self._contact_in(self._capture.image)
                )

    def _contact_in(self, image: np.ndarray) -> str:
        """Why a captured image is not taken; empty if it is."""
        if not self._depth.shows_contact(image, self._background):
            return ""
        return "the sensor is touching something; lift the finger off and try again"

    def _publish(self, header: Header, depth: Depth) -> None:
        area = float(depth.area_m2)
        self._contact.publish(TactileContact(header=header, in_contact=depth.in_contact, area=area))
        if self._sink is None or self._points.get_subscription_count() > 0:
            points = cloud_from_penetration(depth.penetration, depth.penetration > 0, self._map_sensor)
            self._points.publish(points_to_msg(points, header))
        else:
            self._unseen_clouds += 1
        if self._penetration.get_subscription_count() > 0:
            self._penetration.publish(image_to_msg(depth.penetration, "32FC1", header))
        if self._sink is not None:
            self._sink(header, depth)

    async def _on_capture(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if not self.active:
            response.success, response.message = False, "the node is not active; activate it (ros2 lifecycle set)"
            return response
        if self._capture is not None:
            response.success, response.message = False, "a capture is already under way"
            return response
        self._capture = BackgroundCapture(self.parameters["background_frames"], self.parameters["still_threshold"])
        self._captured = Future(executor=self.executor)
        timeout = self.parameters["capture_timeout"]
        timer = self.create_timer(
            timeout,
            lambda: self._finish_capture(None, f"fewer images than asked for came within {timeout:g} s"),
            clock=Clock(clock_type=ClockType.STEADY_TIME),
        )
        response.success, response.message = await self._captured
        self.destroy_timer(timer)
        return response

    def _finish_capture(self, image, refusal: str) -> None:
        if self._capture is None:
            return
        self._capture = None
        if refusal:
            self._captured.set_result((False, refusal))
            return
        self._running = None
        self._set_background(image, "capture_background")
        kept = self._store.keep(image) if self._store else "not kept for the next start: set the parameter serial"
        self._captured.set_result((True, kept))

    def _misfit(self) -> str:
        """Why the images do not fit the no-contact image or the network; empty if they do."""
        return self._fit.problem and (turned_since(self._image, self._background) or self._fit.problem)

    def describe(self) -> tuple[bytes, str, dict]:
        """Level, message and values for the diagnostics."""
        values = {**self._rate.values(), "background": self._background_source, **self._stage.skipped}
        values["no_subscriber"] = self._unseen_clouds
        values |= self._fit.values
        if problem := self._background_problem or self._misfit():
            return diagnostics.WARN, problem, values
        if self._running is not None and self._running.change > self.parameters["still_threshold"]:
            return (
                diagnostics.WARN,
                "the background was estimated while the images changed; lift the finger and call "
                "capture_background, or set the parameter background",
                values,
            )
        return diagnostics.OK, "", values


def main(args=None) -> int:
    """Entry point of the executable `tdn`."""
    return spin.run(lambda: [TdnNode()], args)


if __name__ == "__main__":
    raise SystemExit(main())

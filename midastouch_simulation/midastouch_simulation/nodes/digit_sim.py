"""Node `digit_sim`: a simulated DIGIT, moved by TF, on the topics of the real one's driver."""

from __future__ import annotations

import time

import numpy as np
from rclpy.clock import Clock, ClockType
from sensor_msgs.msg import Image
from std_msgs.msg import Header

from digit_driver.camera_info import Intrinsics
from digit_driver.nodes.image_publisher import ImagePublisher
from midastouch_common.errors import InputError
from midastouch_common.frames import GEL_FRAME, TRUTH_FRAME
from midastouch_common.message_arrays import SECOND
from midastouch_common.ros import diagnostics, qos, spin
from midastouch_common.ros.addresses import load_mesh, resolve
from midastouch_common.ros.conversions import image_to_msg, stamp_from_ns
from midastouch_common.ros.managed_node import AUTOSTART, INACTIVE, ManagedNode
from midastouch_common.ros.parameters import Parameter
from midastouch_common.ros.services import offer
from midastouch_common.ros.transform_source import TransformSource
from midastouch_common.transforms.queue import Wait
from midastouch_common.transforms.rigid import TransformError
from midastouch_msgs.msg import TactileContact
from midastouch_msgs.srv import SetObject
from midastouch_perception.nodes.contact_message import contact_to_msg
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn.background_store import read_background
from midastouch_simulation.camera import no_contact_image
from midastouch_simulation.engine import MotionWatch, Shutter, too_deep
from midastouch_simulation.simulated_digit import SimulatedDigit

PARAMETERS = (
    Parameter("mesh", "", "Mesh of the object, metres: a path or package://NAME/...; must be given"),
    Parameter("sensor_model", "digit_tacto", "Geometry of the sensor: a shipped one by name, or a YAML file"),
    Parameter("seed", 0, "Which imaginary sensor: its light, gel, shadows and noise", minimum=0, maximum=2**31 - 1),
    Parameter("background", "", "Image of the sensor without contact; empty: one invented from seed"),
    Parameter("fps", 60.0, "Images per second of the time of TF", minimum=1.0, maximum=240.0),
    Parameter("frame_id", "digit_optical_frame", "Frame of the images: z forward, x right, y down (REP 103)"),
    Parameter("object_frame_id", TRUTH_FRAME, "Frame of the object, the mesh's own, where it really is"),
    Parameter("sensor_frame_id", GEL_FRAME, "Gel frame, where it really is"),
    Parameter(
        "transform_timeout",
        0.5,
        "TF counts as stopped after this time without a newer transform",
        unit="s",
        minimum=0.05,
        maximum=600.0,
    ),
    AUTOSTART,
)

_JPEG_QUALITY = 95  # the driver's
_LOOKS = 4  # checks for a due image per period, which bound how late it is taken


class DigitSim(ManagedNode):
    """Node that, while active, publishes each image that is due in the time of TF, with that stamp, and its truth.

    Nothing is published while TF lacks the pose of sensor or object; the diagnostics give the reason.
    """

    def __init__(self, **node_options) -> None:
        super().__init__("digit_sim", PARAMETERS, **node_options)
        self._images = ImagePublisher(self)
        out = qos.stream_publisher()
        self._penetration = self.create_publisher(Image, "ground_truth/penetration", out)
        self._contact = self.create_publisher(TactileContact, "ground_truth/contact", out)
        offer(self, SetObject, "~/set_object", self._on_set_object)
        self._rate = diagnostics.Rate()
        self._transforms: TransformSource | None = None
        self.autostart()

    def configure(self) -> None:
        """Load the mesh and make the sensor."""
        self._sensor = sensor = SensorModel.load(self.parameters["sensor_model"])
        if given := self.parameters["background"]:
            self._background = read_background(resolve(given, "background"), sensor.height, sensor.width)
        else:
            self._background = no_contact_image(sensor, np.random.default_rng(self.parameters["seed"]))
        self.say(f"loading the mesh {self.parameters['mesh']}")
        self._digit = self._looking_at(self.parameters["mesh"])
        self._calibration = _calibration(sensor)

    def _looking_at(self, mesh: str) -> SimulatedDigit:
        return SimulatedDigit(load_mesh(mesh), self._sensor, self._background, self.parameters["seed"])

    def unload(self) -> None:
        """Forget the simulated sensor with its mesh."""
        self._digit = None

    def connect(self) -> None:
        """Listen to TF, and look for due images."""
        self._shutter = Shutter(self.parameters["fps"])
        self._watch = MotionWatch(self.parameters["transform_timeout"])
        self._lacks, self._deepest = "", 0.0
        self._frames = self.parameters["object_frame_id"], self.parameters["sensor_frame_id"]
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(1 / (_LOOKS * self.parameters["fps"]), self._look, clock=steady)
        # last: it starts a thread, which nothing would end if a later step failed
        self._transforms = TransformSource(
            self,
            frames=self._frames,
            on_jump=self._on_time_jump,
            on_bad=lambda reason: self.diagnostics.problem("bad_transforms", reason),
        )

    def disconnect(self) -> None:
        """Stop reading TF."""
        if self._transforms is not None:
            self._transforms.close()
            self._transforms = None

    def describe(self) -> tuple[bytes, str, dict]:
        """Level, message and values for the diagnostics."""
        values = self._rate.values() | {
            "expected_fps": f"{self.parameters['fps']:g}",
            "deepest_mm": f"{1e3 * self._deepest:.2f}",
        }
        return diagnostics.ERROR if self._lacks else diagnostics.OK, self._lacks, values

    def _on_set_object(self, request: SetObject.Request) -> None:
        """Put another object where the previous one was; the sensor stays the same."""
        if not self.active:
            raise InputError(INACTIVE)
        with self.busy(f"loading the mesh {request.mesh_path}"):
            self._digit = self._looking_at(request.mesh_path)
        self._watch.restart()

    def _look(self) -> None:
        """Take the image that is due, if one is."""
        started = time.perf_counter()
        try:
            newest = self._transforms.latest_stamp(*self._frames)
            # frames that never move have no time of their own
            stamp = self._shutter.due(self.get_clock().now().nanoseconds if newest is None else newest)
            pose = None if stamp is None else self._transforms.lookup(*self._frames, stamp)
        except TransformError as error:  # not linked yet, or no longer known so far back
            self._lack(f"waiting for TF: {error}")
            self._shutter.restart()
            return
        silent = self._watch.silence(newest, started)
        stopped = f"TF has stopped: nothing newer than {(newest or 0) / SECOND:.3f} s came for {silent:.1f} s"
        self._lack(stopped if silent else "")
        if pose is not None and not isinstance(pose, Wait):
            self._take(stamp, pose)
            self._rate.add(time.perf_counter() - started)

    def _lack(self, what: str) -> None:
        """Keep the reason for missing images for the diagnostics; log when it begins and ends."""
        if what and not self._lacks:
            self.get_logger().warning(what)
        elif self._lacks and not what:
            self.get_logger().info("TF says where sensor and object are")
        self._lacks = what

    def _take(self, stamp: int, T_obj_gel: np.ndarray) -> None:
        frame = self._digit.look(T_obj_gel)
        self._deepest = frame.deepest
        for kind, oddity in ("jumps", self._watch.jump(stamp, T_obj_gel)), ("too_deep", too_deep(frame.deepest)):
            if oddity:
                self.diagnostics.problem(kind, oddity)
        header = Header(stamp=stamp_from_ns(stamp), frame_id=self.parameters["frame_id"])
        self._images.publish(frame.image, header, self._calibration, _JPEG_QUALITY)
        header = Header(stamp=header.stamp, frame_id=self._frames[1])
        self._contact.publish(contact_to_msg(frame.truth, header))
        if self._penetration.get_subscription_count():
            self._penetration.publish(image_to_msg(frame.truth.penetration, "32FC1", header))

    def _on_time_jump(self, stamp: int) -> None:
        self._shutter.restart()
        self._watch.restart()
        back = f"/tf jumped back in time to {stamp / SECOND:.3f} s: going on from there"
        self.diagnostics.problem("time_jumps", back)


def _calibration(sensor: SensorModel) -> Intrinsics:
    """The pin-hole camera that the images are rendered with."""
    f, x, y = sensor.focal, sensor.width / 2, sensor.height / 2
    return Intrinsics(
        sensor.width,
        sensor.height,
        distortion_model="plumb_bob",
        d=(0.0,) * 5,
        k=(f, 0.0, x, 0.0, f, y, 0.0, 0.0, 1.0),
        r=(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
        p=(f, 0.0, x, 0.0, 0.0, f, y, 0.0, 0.0, 0.0, 1.0, 0.0),
    )


def main(args=None) -> int:
    """Entry point of the executable `digit_sim`."""
    return spin.run(lambda: [DigitSim()], args)


if __name__ == "__main__":
    raise SystemExit(main())

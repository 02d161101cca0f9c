"""Node `calibrate`: guides a person through presses of a ball on a running sensor, and keeps the calibration."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from rclpy.clock import Clock, ClockType
from sensor_msgs.msg import Image
from std_srvs.srv import Trigger

from midastouch_common.errors import InputError
from midastouch_common.files import atomic_path, expanded, next_new_folder, require_place
from midastouch_common.message_arrays import rgb_from_msg
from midastouch_common.ros import diagnostics, qos, spin
from midastouch_common.ros.graph_watch import why_silent
from midastouch_common.ros.node import PipelineNode
from midastouch_common.ros.parameters import Parameter, Parameters
from midastouch_common.ros.services import offer
from midastouch_common.torn_frames import TornFrames

from ..sensor_calibration.calibration import scale_problem
from ..sensor_calibration.collector import PressCollector
from ..sensor_calibration.fit import FEWEST, MOST, Result, calibrate, require_ball
from ..sensor_model import SensorModel
from ..tdn.background_store import store_of
from ..tdn.colour_layout import image_problem
from ..tdn.fixed_pattern import PatternCheck
from ..tdn.frame_guard import TORN

PARAMETERS = (
    Parameter("serial", "", "Serial number of the sensor, under which its no-contact image was captured"),
    Parameter("ball_diameter", 0.0, "Diameter of the ball", "m", minimum=0.0, maximum=0.1),
    Parameter(
        "diameter_is_right",
        False,
        "Accept that diameter, even if the depth network measures another one",
        read_only=False,
    ),
    Parameter("presses", 10, "Presses to calibrate from", minimum=FEWEST, maximum=MOST),
    Parameter("sensor_model", "digit_real", "Geometry of the sensor: a shipped one by name, or a YAML file"),
    Parameter("px_per_mm", 0.0, "Scale of this very sensor; 0: the model's", minimum=0.0, maximum=1000.0),
    Parameter("background_folder", "", "Where sensors' images are kept; empty: $ROS_HOME/midastouch/backgrounds"),
    Parameter("out", "", "File of the calibration; empty: next to the no-contact image, where tdn looks for it"),
    Parameter(
        "presses_folder", "", "Folder for images of presses, NAME_2, ... where it holds something; empty: not kept"
    ),
)

_MOST_REASONS = 5  # of the refused presses, the last ones whose reason is published

SILENT_S = 5.0
"""Time without an image [s] after which the node asks whether the driver is running."""


class CalibrateNode(PipelineNode):
    """Node that subscribes `image_raw` and publishes the next step for the person on `/diagnostics`.

    After the last press it calibrates and keeps the result. The service `~/calibrate` does so with the presses taken so
    far, `~/restart` begins again. Args: say, called with each message as text; once, true if the node ends after that.
    Attributes: images (320, 240, 3) uint8 RGB by name, the presses taken; result of the calibration, or None; failure,
    reason why there is no result; presses_folder, folder of the kept images, or None. Raises InputError for parameters
    that do not fit, and if there is no no-contact image.
    """

    def __init__(self, say: Callable[[str], None] | None = None, once: bool = False, **node_options):
        super().__init__("calibrate", **node_options)
        self._settings = Parameters(self, PARAMETERS)
        self._say, self._once = say or self.get_logger().info, once
        self._serial, self._diameter = self._settings["serial"], self._settings["ball_diameter"]
        self._sensor = SensorModel.load(self._settings["sensor_model"])
        if self._settings["px_per_mm"]:
            model, self._sensor = self._sensor, self._sensor.at_scale(1e3 * self._settings["px_per_mm"])
            # tdn has the model's scale and would not use a calibration of another scale
            if not self._settings["out"] and (problem := scale_problem(model, self._sensor.pixel_size)):
                raise InputError(f"calibrate: parameter 'px_per_mm': {problem}")
        self._required()  # raises before anything is started
        self.gave_up = False
        self._diagnostics = diagnostics.Diagnostics(self, self._describe, self._serial)
        self._arrived, self._silent = False, ""
        self._torn, self._pattern = TornFrames(), PatternCheck()
        self._begin()
        self._topic = self.create_subscription(Image, "image_raw", self._on_image, qos.stream_subscriber()).topic_name
        self.create_timer(SILENT_S, self._listen, clock=Clock(clock_type=ClockType.STEADY_TIME))
        offer(self, Trigger, "~/calibrate", self._on_calibrate)
        offer(self, Trigger, "~/restart", self._on_restart)

    @property
    def images(self) -> dict[str, np.ndarray]:
        return self._collector.images

    def _required(self) -> tuple[np.ndarray, Path]:
        """Return the no-contact image and the path of the calibration."""
        if not self._diameter:
            raise InputError("calibrate: parameter 'ball_diameter' is 0; give the ball's diameter in metres")
        require_ball(self._diameter, self._sensor)
        store = store_of(self._settings["background_folder"], self._serial)
        if store is None:
            raise InputError("calibrate: parameter 'serial' is empty; give the sensor's serial number")
        background = store.load(self._sensor.height, self._sensor.width)
        if background is None:
            raise InputError(
                f"{store.path}: no no-contact image of this sensor; start midastouch run perception "
                f"serial:={self._serial} sensor_model:={self._settings['sensor_model']}, lift the finger, and take one "
                "by midastouch capture-background"
            )
        if problem := image_problem(background, None):
            raise InputError(f"{store.path}: {problem}, and call capture_background")
        return background, require_place(self._settings["out"] or store.calibration_path)

    def _begin(self) -> None:
        """Start again without presses, with the no-contact image now kept. On InputError the present state stays."""
        self._background, self._path = self._required()
        self.presses_folder = self._new_folder()
        self._collector = PressCollector(self._background, self._diameter, self._sensor, self._settings["presses"])
        self.result: Result | None = None
        self.failure = self._last = ""
        if self.presses_folder:
            self._announce(f"{self.presses_folder}: the images are kept here")
        self._announce(self._collector.next_step)

    def _new_folder(self) -> Path | None:
        """Make the folder for images from now on, with the no-contact image in it; return it, or None for none."""
        if not self._settings["presses_folder"]:
            return None
        named = expanded(self._settings["presses_folder"], "presses_folder")
        try:
            folder = next_new_folder(named)
            self._keep_image(folder / "background.png", self._background)
        except (OSError, ValueError) as error:  # "/" has no name to number
            why = getattr(error, "strerror", None) or error
            raise InputError(f"presses_folder: {named}: {why}; name another folder") from error
        return folder

    def _listen(self) -> None:
        """Report, once, if no image has come in the last `SILENT_S`."""
        if not (self._arrived or self._silent or self._collector.done):
            self._silent = f"no images on {self._topic}: {why_silent(self, self._topic)}"
            self._announce(self._silent)
        self._arrived = False

    def _on_image(self, msg: Image) -> None:
        self._arrived, self._silent = True, ""
        if self._collector.done:
            return
        taken, step = len(self.images), self._collector.next_step
        try:
            image = rgb_from_msg(msg, self._sensor.height, self._sensor.width)
        except InputError as error:
            self._diagnostics.problem("bad_images", f"image_raw: {error}")
            return
        if refused := TORN if self._torn.torn(image) else self._pattern.refusal(image, self._background):
            self._diagnostics.problem(refused.kind, f"image_raw: {refused.reason}")
            return
        said = self._collector.observe(image)
        self._last = said or self._last
        if len(self.images) > taken:
            self._keep_press()
        if self._collector.done:
            self._announce(said)
            self.failure = self._calibrate()
            self.gave_up = self._once
        elif (then := self._collector.next_step) != step:
            self._announce(*filter(None, [said, then]))

    def _calibrate(self) -> str:
        """Fit the presses taken so far and keep the result; return the reason if that fails, otherwise ""."""
        try:
            with self._diagnostics.kept_up():
                right = self._settings["diameter_is_right"]
                what = self.images, self._background, self._diameter, self._sensor, self._serial
                result = calibrate(*what, diameter_is_right=right)
            result.calibration.save(self._path)
        except InputError as error:
            self._announce(f"no calibration: {error}")
            return str(error)
        self.result = result
        self._announce(*result.warnings, self._outcome())
        return ""

    def _keep_press(self) -> None:
        if self.presses_folder is None:
            return
        name, image = list(self.images.items())[-1]
        try:
            self._keep_image(self.presses_folder / name, image)
        except OSError as error:  # the press still counts
            self._diagnostics.problem("images_not_kept", f"presses_folder: {self.presses_folder}: {error.strerror}")

    @staticmethod
    def _keep_image(path: Path, image: np.ndarray) -> None:
        with atomic_path(path) as temporary:
            temporary.write_bytes(cv2.imencode(".png", image[:, :, ::-1])[1].tobytes())

    def _outcome(self) -> str:
        made = self.result.calibration
        return f"{self._path}: calibration from {made.presses} presses; tdn uses it at its next start"

    def _on_calibrate(self, _: Trigger.Request) -> str:
        failure = self._calibrate()
        if self._collector.done:  # otherwise more presses follow
            self.failure = failure
        if failure:
            raise InputError(failure)
        return self._outcome()

    def _on_restart(self, _: Trigger.Request) -> str:
        self._begin()
        return self._collector.next_step

    def _announce(self, *words: str) -> None:
        for text in words:
            self._say(text)
        self._diagnostics.publish()

    def _describe(self) -> tuple[bytes, str, dict]:
        collector = self._collector
        values = {"taken": len(self.images), "wanted": self._settings["presses"], "last_press": self._last}
        values["thrown_away"] = len(collector.refusals)
        values |= {f"thrown_away_{k}": why for k, why in enumerate(collector.refusals[-_MOST_REASONS:], 1)}
        if self.failure:
            return diagnostics.ERROR, f"{self.failure} (begin again: ~/restart)", values
        if self.result is not None and collector.done:
            level = diagnostics.WARN if self.result.warnings else diagnostics.OK
            return level, "; ".join([*self.result.warnings, self._outcome()]), values
        if collector.done:
            return diagnostics.OK, "calibrating", values
        if self._silent:
            return diagnostics.WARN, self._silent, values
        return diagnostics.OK, collector.next_step, {**values, "region": collector.missing_region}


def main(args=None) -> int:
    """Entry point of the executable `calibrate`."""
    return spin.run(lambda: [CalibrateNode()], args)


if __name__ == "__main__":
    raise SystemExit(main())

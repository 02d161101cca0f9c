"""Node `calibrate`: shows the images of a running sensor to a collector of presses."""

from __future__ import annotations

from collections.abc import Callable

from sensor_msgs.msg import Image

from midastouch_perception.ball_calibration.collector import PressCollector
from midastouch_perception.errors import InputError
from midastouch_perception.message_arrays import rgb_from_msg
from midastouch_perception.ros import qos
from midastouch_perception.ros.node import PipelineNode
from midastouch_perception.sensor_model import SensorModel


class PressCollection(PipelineNode):
    """Listens to `image_raw` until the collector has what it wants; `say` is told what to do and what became of it.

    Attribute: gave_up, whether to stop spinning.
    """

    def __init__(self, collector: PressCollector, sensor: SensorModel, say: Callable[[str], None], **node_options):
        super().__init__("calibrate", **node_options)
        self._collector, self._sensor, self._say = collector, sensor, say
        self.gave_up = False
        self.create_subscription(Image, "image_raw", self._on_image, qos.stream_subscriber(1, False))
        say(collector.next_step)

    def _on_image(self, msg: Image) -> None:
        try:
            said = self._collector.observe(rgb_from_msg(msg, self._sensor.height, self._sensor.width))
        except InputError as error:
            self._say(f"image_raw: {error}")
            return
        if not said:
            return
        self._say(said)
        self.gave_up = self._collector.done
        if not self.gave_up:
            self._say(self._collector.next_step)

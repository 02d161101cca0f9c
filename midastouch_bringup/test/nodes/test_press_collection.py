"""Images of a running sensor reach the collector of presses, which ends the node."""

import numpy as np
import pytest
from sensor_msgs.msg import Image
from std_msgs.msg import Header

from midastouch_bringup.nodes.press_collection import PressCollection
from midastouch_perception.ros.conversions import image_to_msg
from midastouch_perception.sensor_model import SensorModel

pytestmark = pytest.mark.dds


class Collector:
    """Wants two images; says of each how bright it is."""

    def __init__(self):
        self.taken = []

    @property
    def done(self) -> bool:
        return len(self.taken) == 2

    @property
    def next_step(self) -> str:
        return f"{len(self.taken)} of 2"

    def observe(self, image: np.ndarray) -> str:
        if image.mean() in self.taken:
            return ""
        self.taken.append(image.mean())
        return f"brightness {image.mean():.0f}"


def test_what_the_collector_says_is_passed_on_until_it_has_enough(graph):
    said, sensor = [], SensorModel.load("digit_real")
    node = graph.add(lambda **options: PressCollection(Collector(), sensor, said.append, **options))
    images = graph.publisher(Image, "image_raw")
    assert said == ["0 of 2"]
    images.publish(image_to_msg(np.zeros((10, 10, 3), np.uint8), "rgb8", Header()))
    graph.spin_until(lambda: len(said) == 2)
    assert said[1].startswith("image_raw: ")
    for level in (10, 20):
        before = len(said)
        images.publish(image_to_msg(np.full((320, 240, 3), level, np.uint8), "rgb8", Header()))
        graph.spin_until(lambda before=before: len(said) > before)
    assert said[2:] == ["brightness 10", "1 of 2", "brightness 20"]
    assert node.gave_up

"""A sensor for the guide of a calibration: shows it presses, and hears what it says."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from perception_fakes import image_msg
from sensor_msgs.msg import Image


class Camera:
    """Publishes images as a sensor does, each until the node `calibrate` has said what is waited for."""

    def __init__(self, graph, topic: str = "image_raw"):
        self._graph, self._stamp = graph, 0
        self.health = graph.health("calibrate")
        self._images = graph.publisher(Image, topic)

    @property
    def status(self) -> DiagnosticStatus | None:
        return self.health.newest

    @property
    def values(self) -> dict[str, str]:
        return {value.key: value.value for value in self.status.values} if self.status else {}

    def hold(self, image: np.ndarray, until: Callable[[], bool]) -> None:
        def shown_until() -> bool:
            self._stamp += 1
            self._images.publish(image_msg(image, self._stamp))
            return until()

        self._graph.spin_until(shown_until, "what the guide says of a press")

    def press(self, image: np.ndarray, free: np.ndarray) -> None:
        """One press until it is judged, then the finger lifted until that is seen."""
        before = int(self.values["taken"]), int(self.values["thrown_away"])
        self.hold(image, lambda: (int(self.values["taken"]), int(self.values["thrown_away"])) != before)
        self.hold(free, lambda: "lift the ball" not in self.status.message)

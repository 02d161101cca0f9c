"""How far labelled circles of presses can be trusted: where is the ball by the images themselves?

Every press's contact is moved until one light for all presses explains the images best, as `midastouch calibrate` does;
no network and no label takes part. Labels are drawn by hand, some tenths of a millimetre off, and no network can agree
with them better than the ball there does.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from midastouch_bringup.datasets.ball_presses import IMAGES, BallPresses
from midastouch_perception.sensor_calibration.fit import MOST, calibrate
from midastouch_perception.sensor_calibration.presses import Press
from midastouch_perception.sensor_model import SensorModel


class FittedBall:
    """Reads a press as `DepthNet` does, but knows the ball: its cap where the images put it.

    Args: presses; ball_diameter m; sensor at full size. Raises InputError as `calibrate`. Attributes: sensor, at the
    map's resolution; presses, those that could be fitted, with these circles in place of the labels; unfitted, by file
    name why the others could not be.
    """

    def __init__(self, presses: BallPresses, ball_diameter: float, sensor: SensorModel):
        names = list(presses.images)
        # more do not say more, and the fit takes no more
        chosen = [names[i] for i in np.unique(np.linspace(0, len(names) - 1, MOST).round().astype(int))]
        images = {name: presses.images[name] for name in chosen}
        result = calibrate(images, presses.background, ball_diameter, sensor, diameter_is_right=True)
        self.sensor = result.sensor
        pairs = zip(result.presses, result.penetrations, strict=True)
        fitted = {press.name: (press, penetration) for press, penetration in pairs if penetration is not None}
        self._fitted = {presses.images[name].tobytes(): each for name, each in fitted.items()}
        circles = {name: _circle(press, sensor) for name, (press, _) in fitted.items()}
        self.presses = dataclasses.replace(presses.only(list(fitted)), circles=circles, circles_from=IMAGES)
        problems = {press.name: press.problem for press in result.presses}
        beyond = f"not among the {MOST} that the ball was fitted to"
        self.unfitted = {name: problems.get(name, beyond) for name in names if name not in fitted}

    def difference(self, image: np.ndarray, background: np.ndarray) -> np.ndarray:
        """The press's change (H, W, 3) grey levels."""
        return self._fitted[image.tobytes()][0].change

    def predict(self, image: np.ndarray, background: np.ndarray, difference: np.ndarray) -> np.ndarray:
        """Penetration (H, W) m of the ball."""
        return np.maximum(self._fitted[image.tobytes()][1], 0)


def _circle(press: Press, sensor: SensorModel) -> tuple[float, float, float]:
    """Column, row and radius of a press's contact in pixels of the full image."""
    contact, scale = press.contact, sensor.width / press.change.shape[1]
    # the middle of a pixel of the map lies between pixels of the image
    u, v = (scale * (place + 0.5) - 0.5 for place in (contact.u, contact.v))
    return u, v, contact.radius / sensor.pixel_size

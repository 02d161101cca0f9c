"""Where the ball is in each press: by labels, else by the images themselves, else by the outline that is felt.

A felt outline is the network's own: by it the network seems several times better than it is.
"""

from __future__ import annotations

import dataclasses

from midastouch_bringup.datasets.ball_presses import BallPresses
from midastouch_common.errors import InputError
from midastouch_perception.sensor_model import SensorModel

from .label_check import FittedBall


@dataclasses.dataclass(frozen=True)
class KnownPresses:
    """presses, with circles wherever labels or images tell them; unfitted, by file name why the images do not tell a
    press's; problem, why depth cannot be judged, empty if it can.
    """

    presses: BallPresses
    unfitted: dict[str, str]
    problem: str = ""


def with_truth(presses: BallPresses, ball_diameter: float, sensor: SensorModel) -> KnownPresses:
    """The presses with the best circles there are; ball_diameter m, sensor at full size."""
    if presses.circles is not None:
        return KnownPresses(presses, {})
    try:
        ball = FittedBall(presses, ball_diameter, sensor)
    except InputError as error:
        return KnownPresses(presses, {}, str(error))
    known = dataclasses.replace(presses, circles=ball.presses.circles, circles_from=ball.presses.circles_from)
    return KnownPresses(known, ball.unfitted)

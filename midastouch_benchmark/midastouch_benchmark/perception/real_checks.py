"""How often the checks on tactile images are wrong on a real sensor, of which presses of a ball are at hand."""

from __future__ import annotations

import numpy as np

from midastouch_bringup.datasets.ball_presses import BallPresses
from midastouch_perception.tdn import DepthNet

from .check_quality import TOUCHES, judge

_DRAWS = 2


def real_checks(tdn: DepthNet, presses: BallPresses, rng: np.random.Generator) -> dict[str, float]:
    """Share of alarms when the no-contact image is right, and when it shows one of the presses.

    Every press is the no-contact image twice, for `TOUCHES` others that are drawn; the same others are judged with the
    right one. Result: trials of each kind, alarms by kind.
    """
    names = list(presses.images)
    alarms: dict[str, list[bool]] = {"right": [], "touched": []}
    for name in np.repeat(names, _DRAWS):
        others = rng.choice([other for other in names if other != name], TOUCHES, replace=False)
        images = [presses.images[other] for other in others]
        for kind, background in (("right", presses.background), ("touched", presses.images[name])):
            check, touched = judge(tdn, images, background)
            alarms[kind].append(bool(check.problem or touched.problem))
    return {"trials": len(names) * _DRAWS, **{kind: float(np.mean(given)) for kind, given in alarms.items()}}

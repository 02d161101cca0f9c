"""What a step's answer is called: one hypothesis that particles follow in two parts is still one."""

from types import SimpleNamespace

import numpy as np
import pytest

from midastouch_common import se3
from midastouch_filter.core import state
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.estimate import Mode
from midastouch_filter.core.gates import Gates, Stopwatch
from midastouch_filter.refinement.fine_stage import Published
from midastouch_filter.step import Outcome, Reporter
from midastouch_perception.symmetry.search import ObjectSymmetry

NARROW = np.diag([1e-7, 1e-7, 1e-7, 1e-4, 1e-4, 1e-4])


def mode(weight: float, x: float) -> Mode:
    return Mode(weight, se3.translation([x, 0.0, 0.0]), NARROW, 200)


@pytest.mark.parametrize(
    ("beside", "expected", "reason"),
    [(0.4e-3, state.CONVERGED, "100%"), (0.03, state.AMBIGUOUS, "its particles follow another hypothesis")],
)
def test_it_is_as_sure_where_the_particles_are_in_two_parts(beside, expected, reason):
    """The comparison's hypothesis belongs to the lighter part, `beside` [m] the heavier one."""
    parts = [mode(0.66, 0.0), mode(0.34, beside)]
    published = Published([mode(0.9999, beside)], 0.9999, NARROW)
    policies = SimpleNamespace(
        refine=SimpleNamespace(published=lambda belief: published, doubt="", unknown=0.0),
        reweigh=SimpleNamespace(trend=SimpleNamespace(support=0.0, short=1.0)),
        correct=SimpleNamespace(calibration=None),
    )
    belief = SimpleNamespace(answers=parts, modes=parts, particles=np.zeros(400), weights=np.full(400, 1 / 400))
    reporter = Reporter(FilterConfig(), policies, ObjectSymmetry(), Gates(), Stopwatch(lambda: 0.0))
    status = reporter.estimate(belief, Outcome([], True, "")).status
    assert status.state == expected
    assert reason in status.reason

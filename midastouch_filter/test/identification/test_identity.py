from dataclasses import replace

import numpy as np
import pytest

from midastouch_common import se3
from midastouch_filter.core.alignment import transform_covariance
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.touch import Measurement
from midastouch_filter.filter import ParticleFilter
from midastouch_filter.identification.identity import UNKNOWN, CandidateObject, Identity

CONFIG = FilterConfig(threads=1)


class Identified:
    """A filter on the objects of a catalogue, and what it has found."""

    def __init__(self, catalogue, config=CONFIG):
        self._names = [entry.name for entry in catalogue.entries]
        self.filter = ParticleFilter.on([entry.model for entry in catalogue.entries], config)
        self.filter.initialise_uniform()

    @property
    def now(self) -> Identity:
        return Identity.of(self._names, self.filter)


@pytest.fixture
def slid(shelf):
    """A slide over the first object."""
    out = Identified(shelf.catalogue)
    for moved, touch in shelf.touches(0, steps=60)[1]:
        out.filter.step(moved, touch)
    return out


def test_before_any_touch_it_is_what_was_assumed(shelf):
    now = Identified(shelf.catalogue, replace(CONFIG, unknown_prior=0.4)).now
    assert [each.probability for each in now.objects] == pytest.approx([0.2] * 3)
    assert [each.hypotheses for each in now.objects] == [[], [], []]
    assert now.answer == UNKNOWN
    assert now.in_words() == "unknown 40%, bumpy_1 20%, bumpy_2 20%, bumpy_3 20%"


def test_objects_add_up_to_one_and_hypotheses_to_their_object(slid):
    now = slid.now
    assert sum(each.probability for each in now.objects) + now.unknown == pytest.approx(1.0)
    assert now.leading.name == now.answer == "bumpy_1"
    for each in now.objects:
        if each.hypotheses:
            probabilities = [mode.probability for mode in each.hypotheses]
            assert sum(probabilities) == pytest.approx(each.probability)
            assert probabilities == sorted(probabilities, reverse=True)


def test_hypotheses_move_with_the_gel(slid):
    before = slid.now.leading.hypotheses[0]
    step = se3.exp([0.005, 0.0, 0.002, 0.0, 0.1, 0.0])  # a gap, no lift yet
    slid.filter.step(step, Measurement(False))
    after = slid.now.leading.hypotheses[0]
    assert np.allclose(after.pose, before.pose @ step)
    assert np.allclose(after.covariance, transform_covariance(before.covariance, step))


def test_what_competes_is_said():
    objects = [CandidateObject(name, p, []) for name, p in (("mug", 0.62), ("bowl", 0.296), ("plate", 0.004))]
    identity = Identity(objects, 0.08)
    assert identity.answer == "mug"
    assert identity.in_words() == "mug 62%, bowl 30%, unknown 8%"

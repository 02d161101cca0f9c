"""Three ellipsoids with bumps at other places: which one is slid over, and where?"""

import numpy as np
import pytest

from midastouch_common import se3
from midastouch_filter.active_touch.suggestion import Wanted
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.state import CONVERGED
from midastouch_filter.core.touch import Measurement
from midastouch_filter.filter import ParticleFilter
from midastouch_filter.identification.catalogue_localiser import CatalogueLocaliser
from midastouch_filter.identification.identity import UNKNOWN
from midastouch_filter.loaded_object import LoadedObject

CONFIG = FilterConfig(threads=1)
FRAME = 50_000_000  # ns
BASE = se3.exp([0.4, -0.1, 0.2, 0.3, 0.0, 1.0])


class Run:
    """What a localiser makes of slides over an object that it is not told; of every frame, told: what it has last said
    of the object, None before it was touched. placed: where it last had the object, None before it was sure."""

    def __init__(self, catalogue):
        self.led: list[str] = []
        self.told: list = []
        self._said = self.placed = None
        self.localiser = CatalogueLocaliser(
            catalogue,
            CONFIG,
            seed=0,
            on_object=lambda entry: self.led.append(entry.name),
            on_identity=self._on_identity,
        )
        self.estimates = []

    def _on_identity(self, identity, T_base_gel, stamp):
        assert stamp == len(self.estimates) * FRAME
        self._said = identity

    def slide(self, truth, frames):
        """The object rests where BASE is, and the arm jitters."""
        noise = np.random.default_rng(0).standard_normal((len(truth), 6)) * np.repeat([2e-4, 5e-3], 3)
        measured = BASE @ truth @ se3.exp(noise)
        for pose, (_, touch) in zip(measured, frames, strict=True):
            self.estimates.append(self.localiser.process(pose, touch, stamp=len(self.estimates) * FRAME))
            self.told.append(self._said)
            if (placed := self.localiser.T_base_obj()) is not None:
                self.placed = placed
            self.localiser.deferred_update()
        return self


@pytest.fixture(scope="module")
def run(shelf):
    return Run(shelf.catalogue).slide(*shelf.touches(1))


@pytest.mark.parametrize("k", [0, 1, 2])
def test_the_object_and_the_pose_on_it_are_found(shelf, run, k):
    truth, frames = shelf.touches(k)
    found = run if k == 1 else Run(shelf.catalogue).slide(truth, frames)
    name, last = f"bumpy_{k + 1}", found.estimates[-1]
    assert found.led[-1] == found.localiser.object.name == found.localiser.identity.answer == name
    assert last.status.mode_mass > CONFIG.converged_probability
    assert CONVERGED in [each.status.state for each in found.estimates if each is not None]
    assert last.status.reason.endswith(found.told[-1].in_words())
    for pose in (last.pose, found.localiser.identity.leading.hypotheses[0].pose):
        assert np.linalg.norm(pose[:3, 3] - truth[-1][:3, 3]) < 3e-3
    assert np.allclose(found.placed[:3, 3], BASE[:3, 3], atol=5e-3)


def test_nothing_is_estimated_before_an_object_is_the_answer(run):
    first = next(k for k, estimate in enumerate(run.estimates) if estimate is not None)
    assert first > 0
    assert first == next(k for k, identity in enumerate(run.told) if identity and identity.answer != UNKNOWN)
    assert all(estimate is not None for estimate in run.estimates[first:])


def test_nothing_is_converged_while_the_object_is_not_sure(run):
    for estimate, identity in zip(run.estimates, run.told, strict=True):
        if estimate is not None:
            assert estimate.status.reason.endswith(identity.in_words())
            if estimate.status.state == CONVERGED:
                assert identity.answer != UNKNOWN
                assert identity.leading.probability >= CONFIG.converged_probability * (1.0 - identity.unknown)


def test_on_an_unknown_object_hardly_any_frame_converges(shelf):
    run = Run(shelf.catalogue.without("bumpy_2")).slide(*shelf.touches(1))
    assert run.localiser.identity.answer == UNKNOWN
    states = [each.status.state for each in run.estimates if each is not None]
    assert states.count(CONVERGED) < 0.1 * len(states)
    assert run.localiser.T_base_obj() is None


def test_an_object_exchanged_during_a_lift_is_found(shelf):
    truth, frames = shelf.touches(0, steps=100)
    run = Run(shelf.catalogue).slide(truth, frames)
    assert run.led[-1] == "bumpy_1"
    up = np.stack([truth[-1] @ se3.exp([0.0, 0.0, z, 0.0, 0.0, 0.0]) for z in (0.01, 0.02)])
    run.slide(up, [(None, Measurement(False))] * 2)
    truth, frames = shelf.touches(1)
    run.slide(truth, frames)
    assert run.led[-1] == run.localiser.identity.answer == "bumpy_2"
    assert np.linalg.norm(run.estimates[-1].pose[:3, 3] - truth[-1][:3, 3]) < 3e-3


def test_it_starts_again_without_an_object(shelf):
    run = Run(shelf.catalogue)
    assert "3 objects" in run.localiser.waiting_for
    run.slide(*shelf.touches(0, steps=60))
    assert not run.localiser.waiting_for
    run.localiser.restart()
    assert "3 objects" in run.localiser.waiting_for
    assert run.localiser.identity.in_words() == "unknown 50%, bumpy_1 17%, bumpy_2 17%, bumpy_3 17%"
    truth, frames = shelf.touches(1)
    assert run.localiser.process(BASE @ truth[0], frames[0][1], stamp=0) is None


def test_where_to_touch_next_tells_objects_apart(shelf):
    run = Run(shelf.catalogue).slide(*shelf.touches(1, steps=4))
    advisor = run.localiser.object.advisor
    assert len({each.name for each in advisor.hypotheses}) > 1
    advice = run.localiser.advise(Wanted(0.05, False, 3))
    assert all(each.information > 0 for each in advice.suggestions)
    assert advice.suggestions or advice.indistinguishable


def test_an_object_that_somebody_names_is_not_doubted(shelf):
    run, entry = Run(shelf.catalogue), shelf.catalogue.entry("bumpy_1")
    alone = ParticleFilter.on([entry.model], CONFIG)
    run.localiser.set_object(LoadedObject(alone, entry.mesh.diagonal, entry.name))
    assert run.localiser.identity is None
    run.slide(*shelf.touches(1, steps=30))
    assert run.localiser.object.name == "bumpy_1"
    assert run.told[-1] is None

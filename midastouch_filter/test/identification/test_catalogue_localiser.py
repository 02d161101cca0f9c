import numpy as np
import pytest

from midastouch_common import se3
from midastouch_filter.active_touch.suggestion import Wanted
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.state import CONVERGED
from midastouch_filter.identification.catalogue_localiser import CatalogueLocaliser
from midastouch_filter.identification.identity import UNKNOWN

CONFIG = FilterConfig(threads=1, max_particles=3000)
FRAME = 50_000_000  # ns; at an unlikely speed a clock that is 50 ms off would explain any motion of the object


class Run:
    """A slide over an object of the shelf by a localiser that does not know which one it is."""

    def __init__(self, catalogue):
        self.led: list[str] = []
        self.told: list[tuple] = []
        self.localiser = CatalogueLocaliser(
            catalogue,
            CONFIG,
            seed=0,
            on_object=lambda entry: self.led.append(entry.name),
            on_identity=lambda identity, T_base_gel, stamp: self.told.append((identity, T_base_gel, stamp // FRAME)),
        )
        self.estimates = []

    def slide(self, truth, frames):
        """The object rests where BASE is, and the arm jitters."""
        noise = np.random.default_rng(0).standard_normal((len(truth), 6)) * np.repeat([2e-4, 5e-3], 3)
        measured = BASE @ truth @ se3.exp(noise)
        for k, (pose, (_, touch)) in enumerate(zip(measured, frames, strict=True)):
            self.estimates.append(self.localiser.process(pose, touch, stamp=k * FRAME))
        return self


BASE = se3.exp([0.4, -0.1, 0.2, 0.3, 0.0, 1.0])


@pytest.fixture(scope="module")
def run(shelf):
    return Run(shelf.catalogue).slide(*shelf.touches(1))


def test_the_filter_of_the_most_probable_object_converges(shelf, run):
    truth, _ = shelf.touches(1)
    assert run.led[-1] == "bumpy_2"
    assert run.localiser.object.name == "bumpy_2"
    last = run.estimates[-1]
    assert last.status.state == CONVERGED
    assert "bumpy_2" in last.status.reason
    assert np.linalg.norm(last.pose[:3, 3] - truth[-1][:3, 3]) < 3e-3
    assert np.allclose(run.localiser.T_base_obj()[:3, 3], BASE[:3, 3], atol=5e-3)


def test_nothing_is_estimated_before_an_object_is_the_answer(run):
    first = next(k for k, estimate in enumerate(run.estimates) if estimate is not None)
    assert first > 0
    assert first == next(stamp for identity, _, stamp in run.told if identity.answer != UNKNOWN)


def test_on_an_object_that_is_not_in_the_catalogue_nothing_converges(shelf):
    run = Run(shelf.catalogue.without("bumpy_2")).slide(*shelf.touches(1))
    assert run.localiser.identity.answer == UNKNOWN
    assert not [each for each in run.estimates if each is not None and each.status.state == CONVERGED]
    assert run.localiser.T_base_obj() is None


def test_nothing_is_converged_while_the_object_is_not_sure(run):
    told = {stamp: identity for identity, _, stamp in run.told}
    identity = None
    for k, estimate in enumerate(run.estimates):
        identity = told.get(k, identity)
        if estimate is not None and identity.leading.probability < CONFIG.converged_probability:
            assert estimate.status.state != CONVERGED
            assert identity.in_words() in estimate.status.reason


def test_it_starts_again_without_an_object(shelf, run):
    other = Run(shelf.catalogue).slide(*shelf.touches(1))
    other.localiser.restart()
    assert other.localiser.object is None
    assert "3 objects" in other.localiser.waiting_for
    other.slide(*shelf.touches(0))
    assert other.localiser.object.name == "bumpy_1"


def test_possible_poses_carry_models_for_who_asks_where_to_touch_next(run):
    possible = run.localiser.possible_poses()
    assert possible[0].name == "bumpy_2"
    assert possible[0].model.alignment is not None
    assert sum(each.probability for each in possible) <= 1.0
    assert len({id(each.model) for each in possible}) == len({each.name for each in possible})


def test_where_to_touch_next_tells_objects_apart(shelf):
    run = Run(shelf.catalogue)
    truth, frames = shelf.touches(1)
    for k in range(len(truth)):
        run.slide(truth[k : k + 1], frames[k : k + 1])
        names = {each.name for each in run.localiser.possible_poses()}
        if len(names) > 1:
            break
    assert len(names) > 1
    advice = run.localiser.advise(Wanted(0.05, False, 3))
    assert all(each.information > 0 for each in advice.suggestions)
    assert advice.suggestions or advice.indistinguishable


def test_an_object_that_somebody_names_is_not_doubted(shelf):
    run = Run(shelf.catalogue)
    run.localiser.set_object(shelf.catalogue.entries[0].load(CONFIG, 0))
    assert run.localiser.identity is None
    assert run.localiser.possible_poses() == []
    assert run.localiser.advise(Wanted(0.05, False, 3)) is None
    run.slide(*shelf.touches(1, steps=30))
    assert run.localiser.object.name == "bumpy_1"
    assert not run.told

"""Where to touch next: on an object whose two halves are alike, or differ in one hypothesis only."""

import copy
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.active_touch.expected_evidence import map_evidence
from midastouch_filter.active_touch.hypotheses import MOST, Hypothesis, hypotheses_of
from midastouch_filter.active_touch.slide_prediction import predict_slides
from midastouch_filter.active_touch.suggestion import Advisor, Wanted, advise, mixture_information
from midastouch_filter.core.answer import grouped
from midastouch_filter.core.belief import Belief, Hypotheses
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.noise_model import NoiseModel
from midastouch_filter.core.object_model import ObjectModel
from midastouch_filter.core.workers import Workers
from midastouch_perception.symmetry.group import Symmetry
from midastouch_perception.symmetry.search import ObjectSymmetry

CONFIG = FilterConfig(threads=1)
NOISE = NoiseModel.of(CONFIG)
HALF_TURN = se3.make(np.diag([-1.0, -1.0, 1.0]), np.zeros(3))
KNOB = np.array([0.015, 0.025, -0.014])
NOTHING_MEASURED = np.empty((0, 4, 4))


TWOFOLD = Symmetry(np.stack([np.eye(4), HALF_TURN]))


def model_of(world, mesh, symmetry: ObjectSymmetry) -> ObjectModel:
    poses = world.random_poses(mesh, 4000, np.random.default_rng(0))
    codebook = world.make_codebook(poses, world.encode(poses))
    codebook.meta["sensor"], codebook.symmetry = "digit_tacto", symmetry  # which a search would find in seconds
    return ObjectModel(mesh, codebook, CONFIG, NOISE, Workers(1))


@pytest.fixture(scope="module")
def alike(world):
    return model_of(world, world.bumpy_mesh(twofold=True), ObjectSymmetry(TWOFOLD, 0.0, TWOFOLD))


@pytest.fixture(scope="module")
def handed(world):
    """The same with one knob more, below."""
    mesh = world.bumpy_mesh(twofold=True)
    direction = mesh.vertices / np.linalg.norm(mesh.vertices, axis=1, keepdims=True)
    knob = np.exp(60 * (direction @ KNOB / np.linalg.norm(KNOB) - 1))
    vertices = mesh.vertices * (1 + 0.4 * knob[:, None])
    return model_of(
        world, ObjectMesh.from_arrays(vertices, mesh.faces, "handed"), ObjectSymmetry(Symmetry(), 0.0, TWOFOLD)
    )


def copies(world, model, point=(0.02, 0.03, 0.012)) -> list[Hypothesis]:
    pose = world.poses_at(model.mesh, np.array([point]), np.zeros(1), 1e-3)[0]
    return [Hypothesis(model, each, 0.5, True, residual_ratio=0.05) for each in (pose, HALF_TURN @ pose)]


def test_copies_are_said_to_be_indistinguishable(world, alike):
    advice = advise(copies(world, alike), NOTHING_MEASURED, Wanted(), NOISE)
    assert advice.indistinguishable
    assert "nothing within reach" in advice.message
    assert advice.message.count("(50%)") == 2
    assert sum(each.information for each in advice.suggestions) < 0.2


def test_it_leads_to_where_copies_differ(world, handed):
    advice = advise(copies(world, handed), NOTHING_MEASURED, Wanted(), NOISE)
    assert not advice.indistinguishable
    best = advice.suggestions[0]
    assert best.information > 0.3
    assert best.path[-1, 2, 3] < 0.0 < best.path[0, 2, 3]
    assert "differs from" in best.reason


KNOWN, VAGUE = NOISE.jitter, 100 * NOISE.between_entries


def believing(models, *hypotheses, untested=0.0) -> SimpleNamespace:
    """A filter on these models that believes in hypotheses, each (number of its model, pose, covariance, weight), and
    gives all poses of the first codebook a weight together."""
    belief = Belief(models)
    for number, pose, covariance, weight in hypotheses:
        one = Hypotheses.at(pose[None], covariance, np.log([weight]), number, 0.0)
        belief.hypotheses = belief.hypotheses.joined(one)
    if untested:
        entries = np.arange(len(models[0].lookup))
        belief.expect(0, entries, np.full(len(entries), np.log(untested / len(entries))))
    groups = grouped(belief)
    return SimpleNamespace(
        belief=belief,
        groups=groups,
        modes=[None],
        objects=models,
        object=models[groups[0].object if groups else 0],
        config=CONFIG,
        measured_gels=NOTHING_MEASURED,
    )


def possible(model, *centres) -> list[Hypothesis]:
    """Of a filter that knows the pose to be at one of these centres (4, 4), all equally probable."""
    return hypotheses_of(believing([model], *((0, centre, KNOWN, 1 / len(centres)) for centre in centres)))


def test_a_lone_hypothesis_is_confirmed_where_its_images_differ(world, handed):
    pose = copies(world, handed)[0].pose
    found, image = possible(handed, pose)
    assert found.probability == pytest.approx(CONFIG.converged_probability, abs=0.001)
    assert np.linalg.norm(image.pose[:3, 3] - (HALF_TURN @ pose)[:3, 3]) < 1e-3
    advice = advise([found, image], NOTHING_MEASURED, Wanted(), NOISE)
    assert not advice.indistinguishable
    best = advice.suggestions[0]
    assert best.path[-1, 2, 3] < 0.0 < best.path[0, 2, 3], "the knob is below"


def test_a_mode_beside_a_near_image_is_taken_for_it(world, handed):
    """Two poses that are known to a millimetre or two would else seem to differ wherever there is an edge."""
    pose = copies(world, handed)[0].pose
    beside = HALF_TURN @ pose @ se3.exp([0.002, -0.001, 0, 0, 0, 0.03])
    found, image = hypotheses_of(believing([handed], (0, pose, KNOWN, 0.6), (0, beside, KNOWN, 0.4)))
    assert image.probability == pytest.approx(0.4)
    (motion,) = handed.symmetry.look_alikes
    np.testing.assert_allclose(image.pose, motion @ found.pose, atol=1e-6)


def test_a_mode_that_is_no_image_stays_where_it_is(world, handed):
    here, there = copies(world, handed)[0].pose, copies(world, handed, point=(-0.02, 0.03, 0.012))[0].pose
    np.testing.assert_allclose(possible(handed, here, there)[1].pose, there, atol=1e-12)


def test_exact_images_are_no_other_hypotheses(world, alike):
    pose = copies(world, alike)[0].pose
    found, *others = possible(alike, pose)
    assert len(alike.symmetry.exact.transforms) == 2
    assert (found.narrow, len(others)) == (True, MOST - 1)
    assert not any(each.narrow for each in others)


def test_a_hypothesis_says_what_it_left_of_the_last_map(world, handed):
    running = believing([handed], (0, copies(world, handed)[0].pose, KNOWN, 1.0))
    running.belief.hypotheses = replace(running.belief.hypotheses, fit=np.array([0.93]))
    assert hypotheses_of(running)[0].residual_ratio == pytest.approx(0.07)


def test_the_rest_of_the_belief_is_drawn_where_the_gel_is_now(world, handed):
    """A mode that is known too badly, and poses that no touch was compared with."""
    here, there = copies(world, handed)[0].pose, copies(world, handed, point=(-0.02, 0.03, 0.012))[0].pose
    running = believing([handed], (0, here, KNOWN, 0.6), (0, there, VAGUE, 0.3), untested=0.1)
    running.belief.since = moved = se3.translation([0.01, 0.0, 0.0])
    found, *others = hypotheses_of(running)
    assert (found.probability, found.narrow, len(others)) == (pytest.approx(0.6), True, MOST - 1)
    np.testing.assert_allclose(found.pose, here @ moved, atol=1e-12)
    assert [each.probability for each in others] == pytest.approx([0.4 / len(others)] * len(others))
    vague = [np.allclose(each.pose, there @ moved) for each in others]
    assert vague == [True] * 5 + [False] * 2
    for each in others[5:]:
        assert np.abs(handed.lookup.poses @ moved - each.pose).max(axis=(1, 2)).min() < 1e-5
    assert not any(each.narrow for each in others)


def test_a_filter_is_advised_from_its_first_touch_on(mapped_slide):
    running = mapped_slide.make_filter()
    running.initialise_uniform()
    advisor = Advisor(running)
    assert advisor.advise(Wanted()) is None
    for motion, touch in list(zip(mapped_slide.odometry, mapped_slide.touches, strict=True))[:20]:
        running.step(motion, touch)
        running.deferred_update()
        assert sum(each.probability for each in advisor.hypotheses) == pytest.approx(1.0)
    assert all(each.information > 0 for each in advisor.advise(Wanted()).suggestions)
    assert advisor.advise(Wanted()).suggestions


def test_an_object_is_as_probable_as_the_filter_says(world, alike, handed):
    pose = copies(world, alike)[0].pose
    believed = (0, pose, KNOWN, 0.7), (1, pose, KNOWN, 0.3)
    running = believing([alike, handed], *believed)
    found, other = hypotheses_of(running)
    assert [each.probability for each in (found, other)] == pytest.approx([0.7, 0.3])
    assert [(each.model, each.name) for each in (found, other)] == [(alike, "bumpy"), (handed, "handed")]
    advice = Advisor(running).advise(Wanted())
    assert all(name in advice.message for name in ("bumpy at", "handed at"))


def test_what_is_out_of_reach_does_not_count(world, handed):
    advice = advise(copies(world, handed), NOTHING_MEASURED, Wanted(max_length=0.012), NOISE)
    assert advice.indistinguishable
    assert all(each.length <= 0.012 for each in advice.suggestions)


def test_of_two_objects_the_difference_counts(world, alike, handed):
    pose = world.poses_at(alike.mesh, np.array([[0.02, 0.03, 0.012]]), np.zeros(1), 1e-3)[0]
    hypotheses = [
        Hypothesis(model, pose, 0.5, True, name, 0.05) for model, name in ((alike, "twofold"), (handed, "handed"))
    ]
    advice = advise(hypotheses, NOTHING_MEASURED, Wanted(), NOISE, on="handed")
    assert "twofold at" in advice.message
    assert "handed at" in advice.message
    assert advice.suggestions[0].information > 0.3
    way = advice.suggestions[0].path[:, :3, 3]
    assert np.abs(handed.mesh.closest_points(way)[1]).max() < 2e-3
    nowhere = advise(hypotheses, NOTHING_MEASURED, Wanted(), NOISE, on="mug")
    assert [each.path.shape for each in nowhere.suggestions] == [(0, 4, 4)] * len(nowhere.suggestions)


@pytest.mark.parametrize(("off", "told"), [(0.0, False), (0.002, False), (0.03, True)])
def test_a_copy_is_refuted_off_the_surface_only(world, alike, off, told):
    """By a millimetre its pose may be wrong: then the gel would hover, and not be somewhere else."""
    right, copy = copies(world, alike)
    way = predict_slides(alike, right.pose[None], np.zeros(1), np.array([0.01, 0.02, 0.03]))[0][0, 0]
    at_copy = HALF_TURN @ way @ se3.translation([0.0, 0.0, off])
    evidence = map_evidence(right, [copy], way, at_copy[:, None], NOISE)
    assert evidence.shape == (4, 1)
    assert (np.abs(evidence).max() < 0.3) != told
    assert (evidence.min() > 2.0) == told


def test_what_is_nearly_known_needs_less_to_be_certain(world, handed):
    here, there = copies(world, handed)
    hopeless = {}
    for fraction in (0.5, 0.9):
        belief = [replace(here, probability=fraction), replace(there, probability=1 - fraction)]
        advices = [advise(belief, NOTHING_MEASURED, Wanted(length), NOISE) for length in np.arange(0.012, 0.032, 0.002)]
        hopeless[fraction] = [advice.indistinguishable for advice in advices]
    assert sum(hopeless[0.9]) < sum(hopeless[0.5]) < len(hopeless[0.5])


def test_a_slide_is_worth_the_touch_at_its_end(world, handed):
    many = advise(copies(world, handed), NOTHING_MEASURED, Wanted(count=8), NOISE).suggestions
    assert many
    assert all(each.length >= NOISE.touch_correlation for each in many)


def test_who_wants_certainty_gets_advice_too(world, handed):
    certain = copy.copy(handed)
    certain.config = replace(CONFIG, converged_probability=1.0)
    advice = advise(copies(world, certain), NOTHING_MEASURED, Wanted(), NOISE)
    assert advice.suggestions
    assert all(np.isfinite(each.information) for each in advice.suggestions)


def test_best_first_and_no_more_than_wanted(world, handed):
    hypotheses = copies(world, handed)
    many = advise(hypotheses, NOTHING_MEASURED, Wanted(count=8), NOISE).suggestions
    rates = [each.information / each.cost for each in many]
    assert rates == sorted(rates, reverse=True)
    assert len(advise(hypotheses, NOTHING_MEASURED, Wanted(count=1), NOISE).suggestions) == 1
    assert not any(each.lift for each in many)


def test_what_was_measured_already_is_no_news(world, handed):
    hypotheses = copies(world, handed)
    best = advise(hypotheses, NOTHING_MEASURED, Wanted(), NOISE).suggestions[0]
    measured = se3.inverse(best.path[0]) @ best.path
    again = advise(hypotheses, measured, Wanted(count=8), NOISE).suggestions
    same = [each for each in again if each.heading == best.heading and each.length <= best.length]
    assert again
    assert max((each.information for each in same), default=0.0) < 0.5 * best.information


def test_a_slide_goes_as_headed_and_stays_on_the_surface(alike):
    starts = alike.lookup.poses[:20]
    headings = np.array([0.0, math.pi / 2])
    tracks, touchable = predict_slides(alike, starts, headings, np.array([0.01, 0.02]))
    assert tracks.shape == (20, 2, 3, 4, 4)
    surface, _, _ = alike.mesh.closest_points(tracks[..., :3, 3].reshape(-1, 3))
    off = np.linalg.norm(surface - tracks[..., :3, 3].reshape(-1, 3), axis=1)
    assert off.max() < 1.6e-3  # the press
    first = np.linalg.norm(tracks[:, :, 1, :3, 3] - tracks[:, :, 0, :3, 3], axis=2)
    assert np.median(first) == pytest.approx(0.01, abs=2e-3)
    for k, heading in enumerate(headings):
        moved = (se3.inverse(tracks[:, k, 0]) @ tracks[:, k, 1])[:, :2, 3]
        direction = np.arctan2(moved[:, 1], moved[:, 0])
        assert np.median(np.abs(direction - heading)) < 0.1
    assert touchable.mean() > 0.9


def test_information_lies_between_nothing_and_the_entropy():
    p = np.array([0.7, 0.2, 0.1])
    evidence = np.zeros((3, 2, 3))
    evidence[:, 1] = 50 * (1 - np.eye(3))
    nothing, everything = mixture_information(p, evidence)
    assert nothing == pytest.approx(0.0)
    assert everything == pytest.approx(-(p * np.log(p)).sum())

from dataclasses import replace

import numpy as np
import pytest
from filter_runs import hypotheses_at, model_of

from midastouch_common import se3
from midastouch_filter.core.belief import Belief
from midastouch_filter.core.births import Births
from midastouch_filter.core.comparison import Comparison
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.gates import Gates
from midastouch_filter.core.measurement_model import log_ratios
from midastouch_filter.core.noise_model import NoiseModel

NOISE = NoiseModel.of(FilterConfig())
OFF = se3.exp([1e-3, -8e-4, 4e-4, 0.02, -0.02, 0.02])
FAR = se3.translation([0.02, 0.0, 0.0])


@pytest.fixture(scope="module")
def model(world, mapped_slide):
    return model_of(world, mapped_slide.codebook)


@pytest.fixture(scope="module")
def touch(mapped_slide):
    """The first one of the slide, made at its first pose."""
    return mapped_slide.touches[0]


@pytest.fixture
def belief(model):
    """Nothing is known."""
    belief = Belief([model])
    Births(NOISE, 10_000).anywhere(belief, 0.0)
    return belief


class Run:
    """A comparison, and what its gates counted."""

    def __init__(self, belief, *touches, weight=1.0, negligible=0.0, most=None, changed=False):
        self.belief, self.counts = belief, (gates := Gates()).counts
        ratios = [log_ratios([model.measurement for model in belief.objects], each.code) for each in touches]
        weights = np.broadcast_to(weight, len(touches)).astype(float)
        self.comparison = Comparison(belief, touches, ratios, weights, negligible, most, 0.0, changed, NOISE, gates)

    def to_the_end(self, slice_=10_000):
        while not (self.comparison.done or self.comparison.paused):
            self.comparison.work(slice_)
        return self

    def weights_at(self, poses, reach=3e-3):
        """Normalised weights of all hypotheses that are near, in m, to each of poses (n, 4, 4), 30 mm being 1 rad."""
        hypotheses = self.belief.hypotheses
        weights = np.exp(hypotheses.log_weights - self.belief.total())
        between = se3.log(se3.inverse(poses)[:, None] @ hypotheses.poses)
        near = np.linalg.norm(between * np.repeat([1, 0.03], 3), axis=-1) < reach
        return near @ weights


@pytest.mark.parametrize("weight", [1.0, 0.25])
def test_codes_count_at_once_and_in_proportion(belief, model, touch, weight):
    before = belief.untested[0].log_weights
    Run(belief, touch, weight=weight)
    (ratio,) = log_ratios([model.measurement], touch.code)
    np.testing.assert_allclose(belief.untested[0].log_weights - before, weight * ratio, atol=1e-5)


def test_far_from_the_surface_a_code_speaks_fully_against(belief, model, touch):
    belief.since = se3.translation([0, 0, 0.06])
    belief.come_up(0.06, np.zeros((6, 6)))
    before = belief.untested[0].log_weights
    Run(belief, touch)
    (ratio,) = log_ratios([model.measurement], touch.code)
    gain = belief.untested[0].log_weights - before
    assert (gain == pytest.approx(ratio.min(), abs=1e-4)) or np.median(gain) == pytest.approx(ratio.min(), abs=1e-4)


def test_what_a_further_finger_measures_adds_up(belief, model, mapped_slide):
    first, other = mapped_slide.touches[0], mapped_slide.touches[40]
    between = se3.inverse(mapped_slide.poses[0]) @ mapped_slide.poses[40]
    before = belief.untested[0].log_weights
    Run(belief, first, replace(other, T_gel_finger=between))
    ratios = [log_ratios([model.measurement], each.code)[0] for each in (first, other)]
    entries, distance = model.lookup.nearest(belief.untested[0].poses @ between)
    near = distance < 0.019
    assert 0.05 < near.mean() < 0.95
    gain = belief.untested[0].log_weights - before
    np.testing.assert_allclose(gain[near], (ratios[0] + ratios[1][entries])[near], atol=1e-4)


def test_a_finger_that_sees_the_same_again_does_not_count_again(belief, mapped_slide):
    """As a thumb that rests while another finger explores."""
    truth, first = mapped_slide.poses[0], mapped_slide.touches[0]
    poses = np.stack([truth, truth @ OFF])
    further = replace(mapped_slide.touches[40], T_gel_finger=se3.inverse(truth) @ mapped_slide.poses[40])
    gains = []
    for weight in ([1.0, 0.0], [0.0, 1.0], [1.0, 1.0]):
        belief.hypotheses = hypotheses_at(poses, np.zeros(2), 1e-5, 1e-5)
        Run(belief, first, further, weight=weight, most=0).to_the_end()
        gains.append(np.diff(belief.hypotheses.log_weights)[0])
    assert gains[2] == pytest.approx(gains[0] + gains[1])


def test_the_heaviest_then_the_likeliest_untested_are_aligned(belief, model, touch):
    poses = model.lookup.poses[[10, 500, 1000, 2000, 3000]]
    belief.hypotheses = hypotheses_at(poses, np.array([-3.0, -1.0, -2.0, -5.0, -4.0]))
    run = Run(belief, touch)
    assert run.comparison.work(2) == run.counts["descents"] >= 2
    assert set(run.comparison.seen) == {1, 2}
    best = np.argsort(-belief.untested[0].log_weights, kind="stable")[:3]
    expected = belief.untested[0].entries[best]
    run.comparison.work(6)
    assert run.counts["promoted"] == 3
    assert not np.isin(expected, belief.untested[0].entries).any()
    assert len(belief.hypotheses) == 5 + 3


def test_what_was_not_reached_keeps_what_its_code_says(belief, touch):
    run = Run(belief, touch, most=20)
    before = dict(zip(belief.untested[0].entries.tolist(), belief.untested[0].log_weights.tolist(), strict=True))
    run.to_the_end()
    assert run.counts["promoted"] == len(belief.hypotheses) == 20
    (some,) = belief.untested
    assert len(some) == 8000 - 20
    np.testing.assert_array_equal(some.log_weights, [before[entry] for entry in some.entries.tolist()])


def test_while_the_gel_is_held_still_further_poses_are_tested(belief, touch):
    run = Run(belief, touch, most=20).to_the_end()
    assert run.comparison.paused
    run.comparison.extend(15)
    run.to_the_end()
    assert run.counts["promoted"] == len(belief.hypotheses) == 35


def test_a_hypothesis_that_waits_counts_by_its_code(belief, model, touch, mapped_slide):
    poses = np.stack([mapped_slide.poses[0], mapped_slide.poses[0] @ FAR])
    belief.hypotheses = hypotheses_at(np.repeat(poses, [1, 1], axis=0), np.array([-1.0, -1.1]))
    Run(belief, touch).comparison.work(1)
    (ratio,) = log_ratios([model.measurement], touch.code)
    waiting = ratio[model.lookup.exact(poses[1:])[0]]
    assert belief.hypotheses.log_weights[1] == pytest.approx(-1.1 + waiting, abs=1e-4)


def test_hopeless_hypotheses_are_left_out_and_counted(belief, mapped_slide):
    poses = np.stack([mapped_slide.poses[0], mapped_slide.poses[0] @ OFF])
    belief.hypotheses = hypotheses_at(poses, np.array([0.0, -100.0]))
    run = Run(belief, mapped_slide.touches[0], most=0).to_the_end(1)
    assert run.counts["hopeless"] == 1
    np.testing.assert_array_equal(belief.hypotheses.poses[1], poses[1])
    assert belief.hypotheses.log_weights[1] < -50


@pytest.mark.parametrize("slice_", [1, 7])
def test_slices_end_in_the_same_weights_as_one_go(model, mapped_slide, slice_):
    """Of all that matters; what is given up early is not known as exactly."""
    truth = mapped_slide.poses[0]
    poses = np.concatenate([[truth @ FAR], model.lookup.poses[::160], [truth @ OFF]])
    results = []
    for size in (10_000, slice_):
        belief = Belief([model])
        belief.hypotheses = hypotheses_at(poses, np.linspace(0.0, -1.0, len(poses)), 4e-3, 0.2)
        run = Run(belief, mapped_slide.touches[0]).to_the_end(size)
        results.append(run.weights_at(poses, 0.02))
    assert results[0].max() > 0.1
    np.testing.assert_allclose(*results, atol=0.02)


def test_it_ends_once_untested_poses_weigh_little(belief, touch):
    few = Run(belief, touch, negligible=0.3).to_the_end(16)
    assert belief.untested_mass < 0.3
    assert few.counts["promoted"] < 8000
    assert few.comparison.work(100) == 0


def test_maps_decide_between_hypotheses_and_sharpen_them(belief, mapped_slide):
    truth = mapped_slide.poses[0]
    belief.hypotheses = before = hypotheses_at(np.stack([truth @ OFF, truth @ FAR]), np.zeros(2), 2e-3, 0.05)
    Run(belief, mapped_slide.touches[0], most=0).to_the_end()
    now = belief.hypotheses
    assert now.log_weights[0] > now.log_weights[1] + 1.0
    assert now.fit[0] > 0.9 > now.fit[1]
    off = [np.linalg.norm(se3.log(se3.inverse(truth) @ each.poses[0])[:3]) for each in (before, now)]
    assert off[1] < 0.5 * off[0]
    assert np.linalg.det(now.covariances[0]) < np.linalg.det(before.covariances[0])


def test_touches_support_the_object_that_they_are_on(shelf):
    truth, frames = shelf.touches(1)
    support = {}
    for changed in (False, True):
        belief = Belief([entry.model for entry in shelf.catalogue.entries[:2]])
        belief.hypotheses = hypotheses_at(truth[[36, 36]], np.zeros(2), 5e-4, 0.01, numbers=(0, 1))
        run = Run(belief, frames[36][1], most=0, changed=changed).to_the_end()
        support[changed] = [run.comparison.support(number) for number in (0, 1)]
    assert support[False][1] == support[True][1] > support[False][0] + 1
    # after a change it contradicts nothing that the touches are not where the object was
    assert support[True][0] == pytest.approx(support[False][0] + NOISE.contradiction)


def test_without_maps_codes_are_the_evidence(world, touch, mapped_slide):
    model, truth = model_of(world), mapped_slide.poses[0]
    belief = Belief([model])
    Births(NOISE, 10_000).anywhere(belief, np.log(1e-6))
    (ratio,) = log_ratios([model.measurement], touch.code)
    poses = np.stack([truth, truth @ OFF, model.lookup.poses[ratio.argmin()]])
    wide = np.stack([between := NOISE.between_entries, 100 * between, 100 * between])
    belief.hypotheses = before = replace(hypotheses_at(poses, np.zeros(3)), covariances=wide)
    Run(belief, touch, most=0).to_the_end()
    gain = belief.hypotheses.log_weights - before.log_weights
    np.testing.assert_allclose(gain, ratio[model.lookup.exact(before.poses)], atol=1e-4)
    np.testing.assert_array_equal(belief.hypotheses.poses, before.poses)
    # where they speak for it a pose is known as well as an entry, however long the path was
    np.testing.assert_array_equal(belief.hypotheses.covariances, wide[[0, 0, 2]])
    assert belief.hypotheses.fit[1] > 0.9
    assert belief.hypotheses.fit[2] < NOISE.explained

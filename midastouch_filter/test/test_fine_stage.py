"""The fine stage in the whole filter: what it does for an answer, and what once the answer is out."""

from dataclasses import replace

import numpy as np
import pytest

from midastouch_filter.config import FilterConfig
from midastouch_filter.filter import Measurement, ParticleFilter
from midastouch_filter.state import CONVERGED
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.simulation.renderer import PenetrationRenderer

SETTINGS = FilterConfig(max_particles=2000, min_particles=300, converged_translation=7e-3, threads=1)


@pytest.fixture(scope="module")
def slide(world):
    """make_filter(), started near the truth; odometry and touches along a slide of 60 poses."""
    book = world.make_codebook(world.poses, world.encode(world.poses), world.mesh)
    book.meta["sensor"] = "digit_tacto"
    poses = world.make_slide(world.mesh, 60, np.random.default_rng(12))
    maps = np.maximum(PenetrationRenderer(world.mesh, SensorModel.load("digit_tacto").scaled(0.25)).render(poses), 0)
    touches = [
        Measurement(True, code, 1e-4, penetration=penetration)
        for code, penetration in zip(world.encode(poses), maps, strict=True)
    ]

    def make_filter() -> ParticleFilter:
        running = ParticleFilter(world.mesh, book, SETTINGS, 0)
        running.initialise_gaussian(poses[0], 0.03, 0.3)
        return running

    return make_filter, world.odometry_of(poses), touches


def without_ms(status):
    return replace(status, ms={})


def test_who_does_not_ask_for_reflection_gets_the_same_answers(slide):
    make_filter, odometry, touches = slide
    asked, left_alone = make_filter(), make_filter()
    states = set()
    for motion, touch in zip(odometry, touches, strict=True):
        one, other = asked.step(motion, touch, elapsed=0.05), left_alone.step(motion, touch, elapsed=0.05)
        asked.reflect()
        assert without_ms(one.status) == without_ms(other.status)
        np.testing.assert_array_equal(one.pose, other.pose)
        np.testing.assert_array_equal(one.covariance, other.covariance)
        states.add(one.status.state)
    assert CONVERGED in states  # which it is not before places were compared


def test_places_are_compared_after_the_answer(slide):
    make_filter, odometry, touches = slide
    running = make_filter()
    first, second = (
        running.step(motion, touch).status.ms for motion, touch in zip(odometry[:2], touches, strict=False)
    )
    assert "refinement" in first
    assert not {"hindsight", "track"} & set(first)
    assert {"refinement", "hindsight", "track"} <= set(second), "those of the first touch"


def test_a_restart_forgets_what_is_left_to_reflect_on(slide):
    make_filter, odometry, touches = slide
    reflected, restarted = make_filter(), make_filter()
    for running in (reflected, restarted):
        running.step(None, touches[0])
    reflected.reflect()
    for running in (reflected, restarted):
        running.initialise_uniform()
    ms = [running.step(odometry[1], touches[1]).status.ms for running in (reflected, restarted)]
    assert "hindsight" in ms[0]
    assert "hindsight" not in ms[1]


def test_there_is_nothing_to_reflect_on_without_a_start(slide):
    make_filter, _, touches = slide
    running = make_filter()
    running.reset(0)
    running.step(None, touches[0])
    running.reflect()
    assert running.poses.shape == (0, 4, 4)

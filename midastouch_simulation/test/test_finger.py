import numpy as np
import pytest
from fake_arms import ended

from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.objects import bundled_objects
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_simulation.finger import SimulatedFinger

STEP = 1.5e-3
DOWN = np.array([0.0, 0.0, -1.0])
UP = np.array([0.0, 0.0, 1.0])


def moved(motion):
    """Poses (N, 4, 4) of a motion, and whether it went as far as it was to."""
    poses, whole = ended(motion)
    return np.array(poses).reshape(-1, 4, 4), whole


def finger_on(name, sensor, seed=0, lifted=0.0):
    mesh = ObjectMesh.load(bundled_objects()[name])
    finger = SimulatedFinger(mesh, sensor, np.random.default_rng(seed), STEP)
    down, touched = moved(finger.touch(0.05, DOWN))
    assert touched
    assert finger.touching
    if lifted:
        moved(finger.lift(lifted))
    return finger, down, PenetrationRenderer(mesh, sensor.scaled(0.25))


def deepest(renderer, poses):
    return renderer.render(poses).max(axis=(1, 2))


@pytest.mark.parametrize("name", sorted(bundled_objects()))
def test_it_begins_in_the_air_and_comes_down_until_it_touches(name, sensor):
    finger, down, renderer = finger_on(name, sensor)
    depths = deepest(renderer, down)
    assert depths[0] == 0
    assert 2e-4 < depths[-1] < 2.2e-3
    assert finger.depth == pytest.approx(7.5e-4, abs=2.6e-4)
    assert moved(finger.touch(0.05, DOWN))[1], "it touches already"


def test_where_nothing_is_it_goes_as_far_as_it_is_sent(sensor):
    finger, _, _ = finger_on("ball", sensor, lifted=0.02)
    before = finger.pose
    poses, touched = moved(finger.touch(0.03, UP))
    assert not touched
    assert finger.depth == 0
    gone = np.linalg.norm(poses[-1][:3, 3] - before[:3, 3])
    assert gone == pytest.approx(0.03, abs=5 * STEP)


@pytest.mark.parametrize("tilt", [0.3, 0.6])
def test_it_comes_down_flat_however_it_is_tilted(tilt, sensor):
    finger, _, renderer = finger_on("ball", sensor, lifted=0.02)
    moved(finger.approach(finger.pose @ se3.exp(np.array([0, 0, 0, tilt, 0, 0]))))
    poses, touched = moved(finger.touch(0.04, DOWN))
    assert touched
    outwards = poses[-1][:3, 3] / np.linalg.norm(poses[-1][:3, 3])
    assert outwards @ poses[-1][:3, 2] > np.cos(np.radians(6))
    assert deepest(renderer, poses).max() < 2.2e-3


def test_a_slide_goes_where_it_is_sent_and_stays_in_contact(sensor):
    finger, down, renderer = finger_on("ball", sensor)
    slide, arrived = moved(finger.slide(np.pi / 2, 0.03))
    way = se3.inverse(down[-1]) @ slide
    assert arrived
    assert len(slide) == 20
    assert np.linalg.norm(np.diff(slide[:, :3, 3], axis=0), axis=1).max() < 2 * STEP
    # along the gel's y axis, up to the tilt of a hand that is not quite steady
    assert way[9, 1, 3] > 5 * abs(way[9, 0, 3])
    assert 2e-4 < deepest(renderer, slide).min() <= deepest(renderer, slide).max() < 2.2e-3


def test_a_slide_ends_where_it_cannot_go_on(sensor):
    finger, _, _ = finger_on("eyebolt", sensor, seed=2)
    poses, arrived = moved(finger.slide(0.3, 1.0))
    assert not arrived
    assert len(poses) < 1.0 / STEP / 2


def test_it_lifts_straight_slides_in_contact_approaches_in_air(sensor):
    finger, down, renderer = finger_on("ball", sensor)
    nowhere = (pytest.approx(np.zeros((0, 4, 4))), False)
    assert moved(finger.approach(down[-1] @ se3.translation([0, 0, 0.05]))) == nowhere
    poses, arrived = moved(finger.lift(0.02))
    assert moved(finger.slide(0.0, 0.02)) == nowhere
    assert arrived
    assert not finger.touching
    np.testing.assert_allclose((se3.inverse(down[-1]) @ poses[-1])[:3, 3], [0, 0, 0.02], atol=1e-9)
    assert deepest(renderer, poses)[-1] == 0


def test_an_approach_is_straight_and_ends_at_the_turned_pose(sensor):
    finger, _, _ = finger_on("ball", sensor, lifted=0.02)
    start = finger.pose
    goal = start @ se3.exp(np.array([0.03, 0.02, 0.05, 0.4, -0.3, 0.6]))
    poses, arrived = moved(finger.approach(goal))
    assert arrived
    np.testing.assert_allclose(finger.pose, goal, atol=1e-9)
    ways = poses[:, :3, 3] - start[:3, 3]
    assert np.linalg.matrix_rank(ways, tol=1e-9) == 1


def test_what_is_in_the_way_ends_an_approach_before_it(sensor):
    finger, _, renderer = finger_on("ball", sensor, lifted=0.02)
    opposite = finger.pose.copy()
    opposite[:3, 3] *= -1
    poses, arrived = moved(finger.approach(opposite))
    assert not arrived
    assert deepest(renderer, poses).max() < 3e-4
    assert moved(finger.lift(0.02))[1], "it is not caught there"


def test_it_yields_to_an_object_that_is_moved(sensor):
    finger, down, renderer = finger_on("ball", sensor)
    sideways = down[-1] @ se3.exp(np.array([2e-3, 0, 0, 0, 0, 0.05])) @ se3.inverse(down[-1])
    after = finger.stay_in_place(sideways)
    assert finger.touching
    assert 2e-4 < deepest(renderer, after[None])[0] < 2.2e-3
    # the object went one way, so on the object the gel went the other; along its axis it gave way
    way = se3.inverse(down[-1]) @ after
    assert way[0, 3] == pytest.approx(-2e-3, abs=3e-4)
    finger.stay_in_place(se3.translation([0, 0, 0.2]))
    assert np.linalg.norm(finger.pose[:3, 3]) < 0.04  # it follows the surface

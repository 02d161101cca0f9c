import numpy as np
import pytest

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.objects import bundled_objects
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.simulation.finger import SimulatedFinger

STEP = 1.5e-3


def finger_on(name, sensor, seed=0):
    mesh = ObjectMesh.load(bundled_objects()[name])
    finger = SimulatedFinger(mesh, sensor, np.random.default_rng(seed), STEP)
    down = np.stack(list(finger.leap(0.0, 0.0)))
    assert finger.touching
    return finger, down, PenetrationRenderer(mesh, sensor.scaled(0.25))


def deepest(renderer, poses):
    return renderer.render(poses).max(axis=(1, 2))


def test_it_begins_in_the_air_and_comes_down_until_it_touches(sensor):
    _, down, renderer = finger_on("handle_tool", sensor)
    depths = deepest(renderer, down)
    assert depths[0] == 0
    assert 2e-4 < depths[-1] < 2.2e-3


def test_a_slide_goes_where_it_is_sent_and_stays_in_contact(sensor):
    finger, down, renderer = finger_on("ball", sensor)
    slide = np.stack(list(finger.slide(np.pi / 2, 0.03)))
    way = se3.inverse(down[-1]) @ slide
    assert len(slide) == 20
    assert np.linalg.norm(np.diff(slide[:, :3, 3], axis=0), axis=1).max() < 2 * STEP
    # along the gel's y axis, up to the tilt of a hand that is not quite steady
    assert way[9, 1, 3] > 5 * abs(way[9, 0, 3])
    assert 2e-4 < deepest(renderer, slide).min() <= deepest(renderer, slide).max() < 2.2e-3


@pytest.mark.parametrize("name", sorted(bundled_objects()))
def test_a_leap_leads_through_free_air_to_another_touch(name, sensor):
    finger, down, renderer = finger_on(name, sensor)
    leap = np.stack(list(finger.leap(0.5, 0.03)))
    depths = deepest(renderer, leap)
    assert (depths == 0).sum() > 3
    assert depths.max() < 2.2e-3
    assert depths[-1] > 2e-4
    # as the crow flies it is nearer than along the surface, and around an eyebolt much so
    assert 3e-3 < np.linalg.norm(leap[-1, :3, 3] - down[-1, :3, 3]) < 0.08


def place_on_ball(finger, degrees):
    """A point (3,) so far around the ball from where the finger is."""
    return 0.03 * finger.pose[:3, :3] @ (np.sin(np.radians(degrees)), 0, np.cos(np.radians(degrees)))


def test_a_slide_to_a_place_comes_nearer_with_every_step_and_stays_in_contact(sensor):
    finger, down, renderer = finger_on("ball", sensor)
    goal = place_on_ball(finger, 60)
    slide = np.stack(list(finger.slide_to(goal)))
    assert finger.touches(goal)
    assert np.array_equal(slide[-1], finger.pose)
    left = np.linalg.norm(np.concatenate([down[-1:], slide])[:, :3, 3] - goal, axis=1)
    assert (np.diff(left) < 0).all()
    assert len(slide) == pytest.approx(0.03 * np.radians(60) / STEP, abs=2)
    assert 2e-4 < deepest(renderer, slide).min() <= deepest(renderer, slide).max() < 2.2e-3


def test_no_slide_leads_to_the_far_side_but_a_leap_does(sensor):
    finger, down, _ = finger_on("ball", sensor)
    goal = place_on_ball(finger, 175)
    assert not list(finger.slide_to(goal))
    assert np.array_equal(finger.pose, down[-1])
    assert list(finger.leap_to(goal))
    assert finger.touches(goal)


@pytest.mark.parametrize("name", sorted(bundled_objects()))
def test_a_leap_to_a_place_ends_there_or_before_it(name, sensor):
    finger, _, renderer = finger_on(name, sensor)
    mesh = ObjectMesh.load(bundled_objects()[name])
    goals, _, _ = mesh.sample_surface(10, np.random.default_rng(5))
    there = 0
    for goal in goals:
        leap = np.stack(list(finger.leap_to(goal)))
        depths = deepest(renderer, leap)
        assert (depths == 0).sum() > 3
        assert depths[-1] > 2e-4
        assert np.linalg.norm(leap[-1, :3, 3] - goal) < 0.04 + 3e-3
        there += finger.touches(goal)
    assert there >= 5


def test_a_slide_ends_where_it_cannot_go_on(sensor):
    finger, _, _ = finger_on("eyebolt", sensor, seed=1)
    assert len(list(finger.slide(0.3, 1.0))) < 1.0 / STEP / 2


def test_it_yields_to_an_object_that_is_moved(sensor):
    finger, down, renderer = finger_on("ball", sensor)
    sideways = down[-1] @ se3.exp(np.array([2e-3, 0, 0, 0, 0, 0.05])) @ se3.inverse(down[-1])
    after = finger.stay_in_place(sideways)
    assert finger.touching
    assert 2e-4 < deepest(renderer, after[None])[0] < 2.2e-3
    # the object went one way, so on the object the gel went the other; along its axis it gave way
    way = se3.inverse(down[-1]) @ after
    assert way[0, 3] == pytest.approx(-2e-3, abs=3e-4)
    finger.stay_in_place(se3.make(np.eye(3), np.array([0, 0, 0.2])))
    assert np.linalg.norm(finger.pose[:3, 3]) < 0.04  # it follows the surface


def test_an_object_that_nothing_can_touch_is_named(sensor):
    corners = np.array([[0, 0, 0], [0.05, 0, 0], [0.05, 0.05, 0], [0, 0.05, 0]])
    plate = ObjectMesh.from_arrays(corners, np.array([[0, 1, 2], [0, 2, 3]]), "plate")
    plate.face_normals = -plate.face_normals
    with pytest.raises(InputError, match="plate: no reachable"):
        SimulatedFinger(plate, sensor, np.random.default_rng(0), STEP)

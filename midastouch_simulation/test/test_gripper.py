"""A gripper that pinches an object, carries it and puts it down."""

import numpy as np
import pytest

from midastouch_common import se3
from midastouch_common.pose_metric import pose_errors
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_simulation.gripper import SimulatedGripper


@pytest.fixture(scope="module")
def renderer(tool, sensor):
    return PenetrationRenderer(tool, sensor.scaled(0.25))


def depths(seen, renderer):
    """(2,) of the gels in the object."""
    gels = se3.inverse(seen.base_from_object) @ seen.base_from_gripper @ seen.gripper_from_gels
    return renderer.render(gels).max(axis=(1, 2))


@pytest.fixture(scope="module")
def life(tool, sensor):
    """What is seen in two pinches, and in the way from one to the next."""
    gripper = SimulatedGripper(tool, sensor, np.random.default_rng(3))
    return [list(gripper.pinch()), list(gripper.release()), list(gripper.pinch())]


def test_both_gels_touch_from_the_end_of_closing_on_until_it_opens(life, renderer):
    for pinch in (life[0], life[2]):
        touching = np.array([depths(seen, renderer).min() > 1e-4 for seen in pinch])
        assert np.flatnonzero(np.diff(touching)).size == 1
        assert touching[-1]
    deepest = np.array([depths(seen, renderer).max() for seen in life[1][1:]])
    assert deepest.max() == 0, "it opens and turns through the air"


def test_the_object_rests_in_the_gripper_then_where_it_was_put(life):
    first, way, _ = life
    objects = np.stack([seen.base_from_object for seen in first])
    held = [k for k, pose in enumerate(objects) if k and not np.array_equal(pose, objects[k - 1])]
    in_gripper = np.stack(
        [se3.inverse(seen.base_from_gripper) @ seen.base_from_object for seen in first[held[0] - 1 :]]
    )
    np.testing.assert_allclose(in_gripper, np.broadcast_to(in_gripper[0], in_gripper.shape), atol=1e-12)
    lifted, _ = pose_errors(objects, objects[0])
    assert lifted.max() > 0.08
    last = objects[-1]
    assert last[2, 3] == pytest.approx(objects[0][2, 3]), "it is put down at the height it was taken from"
    np.testing.assert_allclose(last[:3, 2], objects[0][:3, 2], atol=1e-12)
    assert all(np.array_equal(seen.base_from_object, last) for seen in way)


def test_the_next_pinch_is_another(life):
    ends = [se3.inverse(pinch[-1].base_from_object) @ pinch[-1].base_from_gripper for pinch in (life[0], life[2])]
    assert pose_errors(ends[1][None], ends[0])[1][0] > 0.1

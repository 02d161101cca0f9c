import math

import numpy as np
import pytest
import trimesh

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.objects import bundled_objects
from midastouch_perception.sensor_model import SensorModel
from midastouch_simulation.gel_layer import Gel, GelLayer
from midastouch_simulation.mujoco_arm import MujocoArm, Setting

SENSOR = SensorModel.load("digit_tacto")
BALL = ObjectMesh.load(bundled_objects()["ball"])
TOP = float(BALL.bounds[1, 2])
BASE_FROM_OBJECT = se3.translation([0.45, 0.1, 0.2])


def over(height: float) -> np.ndarray:
    """T_obj_gel (4, 4) of a gel over the ball."""
    return se3.translation([0.0, 0.0, TOP + height])


def arm(height: float, **changes) -> MujocoArm:
    pytest.importorskip("mujoco", reason="not installed: tools/requirements/mujoco.txt")
    return MujocoArm(BALL, SENSOR, Setting(BASE_FROM_OBJECT, BASE_FROM_OBJECT @ over(height), **changes))


def push(of: MujocoArm, twist: list[float], seconds: float) -> None:
    """Command a twist a hundred times a second."""
    until = of.time + seconds
    while of.time < until - 1e-6:
        of.command(of.time, np.array(twist))
        of.advance(of.time + 0.01)


def test_it_begins_where_it_is_put_unless_that_is_out_of_reach():
    np.testing.assert_allclose(arm(0.01).pose, BASE_FROM_OBJECT @ over(0.01), atol=2e-4)
    far = se3.translation([1.5, 0.0, 0.2])
    with pytest.raises(InputError, match="does not reach"):
        MujocoArm(BALL, SENSOR, Setting(far, far @ over(0.01)))


def test_what_it_reaches_it_can_be_led_on_from():
    """The farthest pose away from its base: an arm that is stretched to the last does not go there."""
    there = arm(0.03)
    out = np.stack([there.pose @ se3.translation([way, 0, 0]) for way in np.arange(0.4, 0.44, 2.5e-4)])
    reached = there.reaches(out)
    assert reached[0]
    assert not reached[-1]
    farthest = MujocoArm(BALL, SENSOR, Setting(BASE_FROM_OBJECT, out[reached][-1]))
    begin, speed, seconds = farthest.pose[0, 3], 1e-3, 0.5
    push(farthest, [speed, 0, 0, 0, 0, 0], seconds)
    assert farthest.pose[0, 3] - begin > 0.8 * speed * (seconds - 0.05)


def test_at_a_singularity_it_stands_still_rather_than_leave_its_way():
    stretched = se3.translation([0.8705, 0.1, 0.26])
    for turn, moves in ((0.3, False), (-0.3, True)):
        far = MujocoArm(BALL, SENSOR, Setting(BASE_FROM_OBJECT, stretched))
        begin, twist = far.pose, np.array([5e-3, 0.0, 0.0, 0.0, turn, 0.0])
        push(far, list(twist), 1.0)
        went = se3.log(se3.inverse(begin) @ far.pose)
        assert bool(np.linalg.norm(went[3:]) > 0.2) == moves
        assert np.linalg.norm(went[:3] - twist[:3] * (went[4] / turn)) < 2e-3


def test_what_it_reaches_is_on_a_way_without_what_it_meets():
    there = arm(0.03)
    here = there.pose
    under = here @ se3.exp(np.array([0, 0, 0, *np.radians(140.0) * np.array([np.cos(3.6), np.sin(3.6)]), 0]))
    table, far = here @ se3.translation([0, 0, -0.35]), here @ se3.translation([0.9, 0, 0])
    ways = [here, table, here @ se3.translation([0.05, 0, 0]), far, here @ se3.translation([0, 0.05, 0.02])]
    assert there.reaches(np.stack(ways)).tolist() == [True, False, True, False, True]
    assert not there.reaches(under[None]).any()
    np.testing.assert_array_equal(there.pose, here)
    assert not there.stopped


@pytest.mark.parametrize("axis", range(6))
def test_it_follows_a_twist_in_the_gel_s_own_frame_late(axis):
    there = arm(0.03, latency=0.05, timeout=0.1)
    twist = np.zeros(6)
    twist[axis] = 0.01 if axis < 3 else 0.2
    start = there.pose
    push(there, twist.tolist(), 0.05)
    assert np.abs(se3.log(se3.inverse(start) @ there.pose)).max() < 2e-4
    push(there, twist.tolist(), 0.95)
    gone = se3.log(se3.inverse(start) @ there.pose)
    # late by its latency and by the lag of its joints
    np.testing.assert_allclose(gone, twist * 0.93, atol=0.02 * np.abs(twist).max())
    there.advance(there.time + 0.3)
    rest = there.pose
    there.advance(there.time + 0.5)
    np.testing.assert_allclose(there.pose, rest, atol=2e-5, err_msg="it stops when no more twists come")


def test_an_arm_that_meets_the_table_stays_where_it_is():
    there = arm(0.03)
    push(there, [0, 0, -0.1, 0, 0, 0], 1.0)
    assert not there.stopped
    push(there, [0, 0, -0.1, 0, 0, 0], 2.0)  # through the ball, to the table 0.2 m below
    assert there.stopped
    rest = there.pose
    push(there, [0, 0, 0.1, 0, 0, 0], 0.5)
    np.testing.assert_array_equal(there.pose, rest)
    assert not there.joints[1].any()
    assert not there.reaches(rest[None] @ se3.translation([0, 0, 0.05])).any()


def test_a_press_pushes_back_and_friction_is_bounded():
    there = arm(1e-3, gel=Gel(friction=0.3))
    push(there, [0, 0, -0.005, 0, 0, 0], 0.4)
    assert 2e-4 < there.deepest < 1.2e-3
    normal = there.wrench[2]
    assert normal > 0.1
    push(there, [0.01, 0, 0, 0, 0, 0], 0.3)
    across, normal = np.linalg.norm(there.wrench[:2]), there.wrench[2]
    assert across <= 0.3 * normal * (1 + 1e-6)
    assert across > 0.25 * normal


def test_a_gel_that_is_mounted_elsewhere_touches_elsewhere():
    off = se3.translation([0.0, 0.0, -2e-3])
    drawn, mounted = arm(1e-3), arm(1e-3, mount=off)
    for each in (drawn, mounted):
        each.advance(0.02)
    assert drawn.deepest == 0
    assert mounted.deepest == pytest.approx(1e-3, abs=3e-4)
    np.testing.assert_allclose(mounted.pose, drawn.pose, atol=2e-3)


@pytest.mark.parametrize(("holding", "least", "most"), [(math.inf, 0.0, 0.0), (20.0, 0.0, 5e-5), (0.3, 1e-3, 1e-2)])
def test_an_object_gives_way_to_more_than_what_holds_it(holding, least, most):
    there = arm(1e-3, holding=holding, gel=Gel(friction=1.0))
    push(there, [0, 0, -0.005, 0, 0, 0], 0.4)
    push(there, [0.01, 0, 0, 0, 0, 0], 0.6)
    moved = np.linalg.norm((there.base_from_object - BASE_FROM_OBJECT)[:3, 3])
    assert least <= moved <= most


def test_the_layer_pushes_by_its_stiffness_times_the_volume():
    layer = GelLayer(BALL, SENSOR, Gel(stiffness=1e8))
    force = layer.force(over(-5e-4), np.zeros(2), 2e-3)
    # a ball on a domed gel: a cap whose curvature is the sum of both
    dome = dict(SENSOR.dome)
    radius = 1 / (1 / TOP + 1 / dome["radius_x"])
    assert force[2] == pytest.approx(1e8 * np.pi * radius * 5e-4**2, rel=0.1)
    np.testing.assert_allclose(force[[0, 1, 3, 4]], 0, atol=0.02 * force[2])
    for name, value in {"stiffness": -1.0, "friction": math.nan, "shear": math.inf}.items():
        with pytest.raises(InputError, match=name):
            Gel(**{name: value})


def test_a_wall_at_its_border_presses_a_gel_in_sideways():
    block = trimesh.creation.box([0.04, 0.04, 0.03])
    layer = GelLayer(ObjectMesh(block.vertices, block.faces, "block", ""), SENSOR, Gel())
    assert layer.indented(se3.translation([0.0, 0.0, 0.02]), 0.0) == 0.0
    assert layer.indented(se3.translation([0.0, 0.0, 0.015 - 6e-4]), 0.0) == pytest.approx(6e-4, abs=1.5e-4)
    half = (SENSOR.rays[0] * SENSOR.gel_depth).max()
    for behind in (8e-4, 1.6e-3):
        at_wall = se3.translation([0.02 + half - behind, 0.0, 0.005])
        layer.force(at_wall, np.zeros(2), 2e-3)
        assert layer.deepest > 2 * behind
        assert layer.indented(at_wall, 0.0) == pytest.approx(behind, abs=2e-4)
    deep, deeper = (layer.force(se3.translation([0, 0, height]), np.zeros(2), 2e-3)[2] for height in (8e-3, 6e-3))
    assert deeper == pytest.approx(deep), "no more than the gel gives way"

import numpy as np
import pytest
import trimesh

from midastouch_common.mesh import ObjectMesh
from midastouch_perception.rendering.contact_poses import (
    MAX_PENETRATION,
    ContactSampling,
    Reachability,
    pose_from_contact,
    sample_contact_poses,
)
from midastouch_perception.rendering.renderer import PenetrationRenderer


@pytest.fixture(scope="module")
def poses(tool, sensor):
    return sample_contact_poses(tool, 400, np.random.default_rng(0), sensor)


def test_poses_touch_within_limits(tool, sensor, poses):
    deepest = PenetrationRenderer(tool, sensor.scaled(0.25)).render(poses).max(axis=(1, 2))
    assert (deepest > 1e-4).mean() > 0.95
    assert deepest.max() < MAX_PENETRATION + 2e-4


def test_two_percent_hover(tool, sensor):
    poses = sample_contact_poses(tool, 1000, np.random.default_rng(1), sensor, ContactSampling(free_fraction=0.2))
    deepest = PenetrationRenderer(tool, sensor.scaled(0.125)).render(poses).max(axis=(1, 2))
    assert (deepest == 0).mean() == pytest.approx(0.2, abs=0.05)


def test_tilt_is_a_few_degrees_from_the_face_normals(block, sensor):
    sampling = ContactSampling(edge_fraction=0.0, free_fraction=0.0)
    poses = sample_contact_poses(block, 500, np.random.default_rng(2), sensor, sampling)
    _, _, face = block.closest_points(poses[:, :3, 3])
    tilt = np.degrees(np.arccos(np.clip((poses[:, :3, 2] * block.face_normals[face]).sum(axis=1), -1, 1)))
    # the median of |N(0, 5 deg)| is 3.4 deg; on the rounded edges the nearest face is another one
    assert np.median(tilt) == pytest.approx(3.4, abs=1.0)


def test_yaw_is_uniform(poses):
    x = poses[:, :3, 0]
    assert np.linalg.norm(x.mean(axis=0)) < 0.12


def test_press_pushes_along_the_gel_axis():
    pose = pose_from_contact(
        np.array([[0.1, 0.2, 0.3]]), np.array([[0.0, 1, 0]]), *(np.array([v]) for v in (0.5, 0.1, 2.0, 1e-3))
    )[0]
    np.testing.assert_allclose(pose[:3, 3] + 1e-3 * pose[:3, 2], [0.1, 0.2, 0.3])
    assert pose[1, 2] == pytest.approx(np.cos(0.1))


def test_inside_of_a_ring_too_narrow_for_the_finger_is_out_of_reach(sensor):
    from midastouch_common.mesh import ObjectMesh
    from midastouch_perception.objects import bundled_objects

    eyebolt = ObjectMesh.load(bundled_objects()["eyebolt"])
    inner = np.array([[0.0105 - 0.0032, 0.015, 0.0]])
    pose = pose_from_contact(inner, np.array([[-1.0, 0, 0]]), *(np.array([v]) for v in (0.0, 0.0, 0.0, 1e-3)))
    assert not Reachability(eyebolt, sensor).settle(pose, np.array([1e-3]))[1][0]


def test_same_seed_same_poses(tool, sensor, poses):
    np.testing.assert_array_equal(poses, sample_contact_poses(tool, 400, np.random.default_rng(0), sensor))


def test_hovering_poses_touch_nothing_even_inside_a_cup(sensor):
    outer = trimesh.creation.annulus(r_min=0.012, r_max=0.016, height=0.06)
    ring = ObjectMesh.from_arrays(np.asarray(outer.vertices), np.asarray(outer.faces), "ring")
    sampling = ContactSampling(free_fraction=1.0)
    poses = sample_contact_poses(ring, 60, np.random.default_rng(0), sensor, sampling)
    assert not PenetrationRenderer(ring, sensor.scaled(0.5)).render(poses).any()

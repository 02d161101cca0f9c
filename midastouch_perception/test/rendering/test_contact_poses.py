import numpy as np
import pytest
import trimesh

from midastouch_common.mesh import ObjectMesh
from midastouch_perception.objects import bundled_objects
from midastouch_perception.rendering.contact_poses import (
    ContactSampling,
    Reachability,
    pose_from_contact,
    sample_contact_poses,
)
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_model import MAX_PENETRATION


@pytest.fixture(scope="module")
def poses(tool, sensor):
    return sample_contact_poses(tool, 400, np.random.default_rng(0), sensor)


def deepest(mesh, poses, sensor):
    return PenetrationRenderer(mesh, sensor.scaled(0.25)).render(poses).max(axis=(1, 2))


def test_poses_touch_within_limits(tool, sensor, poses):
    depths = deepest(tool, poses, sensor)
    assert (depths > 1e-4).mean() > 0.95
    assert depths.max() < MAX_PENETRATION + 2e-4
    assert np.linalg.norm(poses[:, :3, 0].mean(axis=0)) < 0.12, "turned about their axes at random"


def test_as_many_hover_as_asked_even_inside_a_cup(tool, sensor):
    sampling = ContactSampling(free_fraction=0.2)
    poses = sample_contact_poses(tool, 1000, np.random.default_rng(1), sensor, sampling)
    assert (deepest(tool, poses, sensor) == 0).mean() == pytest.approx(0.2, abs=0.05)
    outer = trimesh.creation.annulus(r_min=0.012, r_max=0.016, height=0.06)
    ring = ObjectMesh.from_arrays(np.asarray(outer.vertices), np.asarray(outer.faces), "ring")
    poses = sample_contact_poses(ring, 60, np.random.default_rng(0), sensor, ContactSampling(free_fraction=1.0))
    assert not deepest(ring, poses, sensor).any()


def test_tilt_is_a_few_degrees_from_the_face_normals(block, sensor):
    sampling = ContactSampling(edge_fraction=0.0, free_fraction=0.0)
    poses = sample_contact_poses(block, 500, np.random.default_rng(2), sensor, sampling)
    _, _, face = block.closest_points(poses[:, :3, 3])
    tilt = np.degrees(np.arccos(np.clip((poses[:, :3, 2] * block.face_normals[face]).sum(axis=1), -1, 1)))
    # the median of |N(0, 5 deg)| is 3.4 deg; on the rounded edges the nearest face is another one
    assert np.median(tilt) == pytest.approx(3.4, abs=1.0)


def test_press_pushes_along_the_gel_axis():
    pose = pose_from_contact(
        np.array([[0.1, 0.2, 0.3]]), np.array([[0.0, 1, 0]]), *(np.array([v]) for v in (0.5, 0.1, 2.0, 1e-3))
    )[0]
    np.testing.assert_allclose(pose[:3, 3] + 1e-3 * pose[:3, 2], [0.1, 0.2, 0.3])
    assert pose[1, 2] == pytest.approx(np.cos(0.1))


def test_the_inside_of_a_ring_too_narrow_is_out_of_reach(sensor):
    eyebolt = ObjectMesh.load(bundled_objects()["eyebolt"])
    inner = np.array([[0.0105 - 0.0032, 0.015, 0.0]])
    pose = pose_from_contact(inner, np.array([[-1.0, 0, 0]]), *(np.array([v]) for v in (0.0, 0.0, 0.0, 1e-3)))
    assert not Reachability(eyebolt, sensor).settle(pose, np.array([1e-3]))[1][0]


def test_poses_are_pressed_as_deep_as_asked_where_they_touch(tool, sensor, poses):
    rng = np.random.default_rng(3)
    press = np.exp(rng.uniform(np.log(0.1e-3), np.log(1.5e-3), len(poses)))
    pressed, touching = Reachability(tool, sensor).pressed(poses, press)
    assert touching.mean() > 0.8
    assert np.abs(deepest(tool, pressed[touching], sensor) - press[touching]).max() < 1.1e-4
    np.testing.assert_allclose(pressed[:, :3, :3], poses[:, :3, :3])  # along their own axes
    aside = np.einsum("nij,ni->nj", poses[:, :3, :3], pressed[:, :3, 3] - poses[:, :3, 3])[:, :2]
    assert np.abs(aside).max() < 1e-9
    away = poses.copy()
    away[:, :3, 3] += 0.5
    assert not Reachability(tool, sensor).pressed(away, press)[1].any()

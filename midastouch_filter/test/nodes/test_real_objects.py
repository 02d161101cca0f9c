"""The node on objects from files, with either filter: what the other tests replace by fakes."""

from __future__ import annotations

import itertools
import re
from pathlib import Path

import numpy as np
import pytest
import trimesh
from filter_bench import T_BASE_OBJ, Bench
from filter_fakes import pose_msg
from filter_runs import meta_of
from geometry_msgs.msg import PoseArray, PoseWithCovarianceStamped
from std_srvs.srv import Empty
from tf_messages import translation

from midastouch_common.mesh import ObjectMesh
from midastouch_common.message_arrays import SECOND
from midastouch_filter.loaded_object import load_object
from midastouch_msgs.srv import SetObject
from midastouch_perception.codebook import Codebook
from midastouch_perception.sensor_model import SensorModel

pytestmark = pytest.mark.dds
CORNER = np.array([0.03, 0.02, 0.015])


def write_object(folder: Path, name: str, shape: trimesh.Trimesh, network: str = "fake") -> None:
    """A mesh file and a small codebook with random codes, as `build-codebook` would name them."""
    shape.export(folder / f"{name}.ply")
    mesh, rng, sensor = (
        ObjectMesh.load(folder / f"{name}.ply"),
        np.random.default_rng(0),
        SensorModel.load("digit_tacto"),
    )
    poses = np.tile(np.eye(4), (500, 1, 1))
    poses[:, :3, 3] = mesh.sample_surface(500, rng)[0]
    meta = meta_of(mesh, sensor_id=sensor.content_id, tcn=network)
    codes = rng.standard_normal((500, 2)).astype(np.float32)
    Codebook(poses, codes / np.linalg.norm(codes, axis=1, keepdims=True), meta).save(folder / f"{name}.npz")


@pytest.fixture(scope="module")
def objects(tmp_path_factory) -> Path:
    folder, ball = tmp_path_factory.mktemp("objects"), trimesh.creation.icosphere(subdivisions=3, radius=0.03)
    write_object(folder, "box", trimesh.creation.box(2 * CORNER).subdivide().subdivide())
    write_object(folder, "ball", ball)
    write_object(folder, "foreign", ball.copy().apply_scale(0.9), "other")
    (folder / "broken.ply").write_bytes(b"ply\nnonsense")
    return folder


@pytest.mark.parametrize("preset", ["balanced", "paper"])
def test_it_starts_where_it_is_asked_and_switches_objects(graph, objects, preset):
    files = {"mesh": str(objects / "box.ply"), "codebook": str(objects / "box.npz")}
    bench = Bench(graph, load_object, preset=preset, max_particles=1000, threads=1, **files)
    clouds, stamps = graph.listen(PoseArray, "particles"), itertools.count(SECOND, SECOND)

    def distances(place) -> np.ndarray:
        """Of the particles to a place on the object, m, after one more frame without contact."""
        clouds.clear()
        assert bench.frame(next(stamps), in_contact=False).state == "no_contact"
        graph.spin_until(lambda: clouds, "the particles")
        return np.linalg.norm([[p.position.x, p.position.y, p.position.z] for p in clouds[-1].poses] - place, axis=1)

    def comes_to(topic, pose, place) -> bool:
        """Whether it does after one of the next frames: it may hear of the pose after a later one."""
        graph.publisher(PoseWithCovarianceStamped, topic).publish(pose)
        return any(np.median(distances(place)) < 0.008 for _ in range(50))

    assert distances(CORNER).max() > 0.05
    sharp = (1e-6,) * 3 + (1e-4,) * 3
    assert comes_to("initialpose", pose_msg("object", translation(*CORNER), sharp), CORNER)
    graph.call(Empty, "request_nomotion_update", Empty.Request())
    assert bench.frame(next(stamps)).n_modes > 0
    graph.call(Empty, "reinitialize_global_localization", Empty.Request())
    assert distances(CORNER).max() > 0.05
    # the object is where the gel touches its opposite corner
    assert comes_to("object_pose_prior", pose_msg("base_link", T_BASE_OBJ @ translation(*CORNER), sharp), -CORNER)

    def set_object(mesh: str, codebook: str) -> SetObject.Response:
        paths = {"mesh_path": str(objects / f"{mesh}.ply"), "codebook_path": str(objects / f"{codebook}.npz")}
        return graph.call(SetObject, "set_object", SetObject.Request(**paths))

    for mesh, codebook, complaint in (
        ("broken", "broken", "broken.ply"),
        ("missing", "missing", "missing.ply"),
        ("foreign", "foreign", r"foreign.npz: .*network other.* fake"),
        ("ball", "box", "'box'"),
    ):
        assert re.search(complaint, set_object(mesh, codebook).message)
    assert set_object("ball", "ball").success
    assert bench.frame(next(stamps)).n_modes > 0

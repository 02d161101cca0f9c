"""The parameter `objects` over DDS: which object is touched, on `object_hypotheses` and in the status."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from filter_bench import REPLAY, is_answer
from filter_runs import meta_of
from tf2_msgs.msg import TFMessage
from tf_messages import tf_msg
from vision_msgs.msg import Detection3DArray
from visualization_msgs.msg import MarkerArray

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_common.message_arrays import SECOND, pose_from_msg, stamp_ns
from midastouch_filter.nodes.particle_filter import ParticleFilterNode
from midastouch_msgs.msg import FilterStatus
from midastouch_perception.codebook import Codebook

pytestmark = pytest.mark.dds

BASE = se3.exp([0.4, -0.1, 0.2, 0.3, 0.0, 1.0])


@pytest.fixture(scope="module")
def folder(shelf, tmp_path_factory):
    """Codebooks of the shelf's objects as files, with their meshes."""
    folder = tmp_path_factory.mktemp("catalogue")
    for entry in shelf.catalogue.entries:
        path = folder / f"{entry.name}.ply"
        entry.mesh.save(path)
        meta, model = entry.meta | meta_of(ObjectMesh.load(path), **entry.meta), entry.model
        Codebook(model.lookup.poses, model.measurement.codes, meta).save(path.with_suffix(".npz"))
    return folder


class CatalogueBench:
    """A node that takes measurements from a stage in its process; statuses, detections and meshes that it published."""

    def __init__(self, graph, objects: str | Path, **parameters):
        self.graph = graph
        given = {**REPLAY, "objects": str(objects), "max_particles": 2000, "threads": 1, **parameters}
        self.node = graph.add(lambda **options: ParticleFilterNode(subscribe=False, **options), given)
        self.statuses = graph.listen(FilterStatus, "filter_status", latched=True, wanted=is_answer)
        self.detections = graph.listen(Detection3DArray, "object_hypotheses", latched=True)
        self.meshes = graph.listen(MarkerArray, "object_mesh", latched=True)
        self.tf = graph.publisher(TFMessage, "/tf")

    def slide(self, truth, frames) -> None:
        """Each frame is answered before the next one."""
        for k, (pose, (_, touch)) in enumerate(zip(truth, frames, strict=True), start=1):
            stamp = k * SECOND // 20
            self.tf.publish(tf_msg(stamp, BASE @ pose))
            self.node.on_code(stamp, touch)
            self.graph.spin_until(
                lambda stamp=stamp: self.statuses and stamp_ns(self.statuses[-1].header.stamp) == stamp,
                f"the answer to {stamp}",
            )


def test_the_object_is_named_with_its_pose(graph, shelf, folder):
    bench = CatalogueBench(graph, folder)
    graph.spin_until(lambda: bench.statuses, "the status at start")
    truth, frames = shelf.touches(2, steps=40)
    bench.slide(truth[:1], frames[:1])
    assert bench.statuses[-1].state == "uninitialised"
    assert "which of 3 objects it is" in bench.statuses[-1].reason
    bench.slide(truth, frames)
    assert "bumpy_3" in bench.statuses[-1].reason
    graph.spin_until(lambda: bench.meshes and "bumpy_3" in bench.meshes[-1].markers[-1].mesh_resource, "its mesh")
    scores = {
        one.results[0].hypothesis.class_id: one.results[0].hypothesis.score for one in bench.detections[-1].detections
    }
    assert max(scores, key=scores.get) == "bumpy_3"
    assert sum(scores.values()) == pytest.approx(1.0, abs=1e-3)
    assert bench.statuses[-1].unknown == pytest.approx(scores["unknown"], abs=1e-3)
    best = bench.detections[-1].detections[0]
    assert best.header.frame_id == "base_link"
    assert np.allclose(pose_from_msg(best.results[0].pose.pose), BASE, atol=0.05)


@pytest.mark.parametrize(
    ("objects", "parameters", "said"),
    [
        ("/nowhere/cup.npz", {}, "/nowhere/cup.npz"),
        ("", {"mesh": "/data/cup.ply"}, "mesh or codebook"),
        ("", {"init_mode": "wait"}, "init_mode.*uniform"),
        ("", {"preset": "paper"}, "paper's filter has to know the object"),
        ("", {"refinement": False}, "refinement.*true"),
    ],
)
def test_what_cannot_be_is_said(graph, folder, objects, parameters, said):
    with pytest.raises(InputError, match=said):
        CatalogueBench(graph, objects or folder, **parameters)

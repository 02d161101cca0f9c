"""The chain from image to pose over DDS, with stand-ins for both networks and the real filter.

Run as a program with `tdn` or `tcn`, this file is that node with its stand-in network.
"""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import Image
from tf2_msgs.msg import TFMessage

# as a program it is not among pytest's tests, whose folders are known
sys.path.append(str(Path(__file__).parents[3] / "tests"))
sys.path.extend(str(Path(__file__).parents[3] / f"midastouch_{name}/test/nodes") for name in ("filter", "perception"))

from perception_fakes import BACKGROUND, FakeDepthStage, FakeTcn, image_msg
from process_rig import SHIPPED, processes
from tf_messages import tf_msg

from midastouch_bringup.nodes import all_in_one
from midastouch_bringup.nodes.all_in_one import main, make_nodes
from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_common.message_arrays import SECOND, pose_from_msg, stamp_ns
from midastouch_common.ros import spin
from midastouch_common.ros.graph_watch import LifecycleWatch
from midastouch_msgs.msg import FilterStatus, TactileCode
from midastouch_perception.codebook import Codebook
from midastouch_perception.codebook_build import build_codebook
from midastouch_perception.nodes.tcn import TcnNode
from midastouch_perception.nodes.tdn import TdnNode
from midastouch_perception.objects import bundled_objects
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_model import SensorModel
from midastouch_simulation.slide import simulate_slide

pytestmark = pytest.mark.dds
T_BASE_OBJ = se3.make(se3.random_rotations(1, np.random.default_rng(9))[0], np.array([0.4, 0.1, 0.2]))


class BookTcn(FakeTcn):
    """The stand-in as `build_codebook` wants it: batches, a dimension and a calibration."""

    dim = 48
    calibration = {"temperature": 0.05, "outlier": 0.05}  # noqa: RUF012

    def encode(self, penetration: np.ndarray) -> np.ndarray:
        if penetration.ndim == 2:
            return super().encode(penetration)
        return np.stack([super(BookTcn, self).encode(one) for one in penetration])


@dataclasses.dataclass(frozen=True)
class Touches:
    """A slide over a bundled object: its codebook's path, true poses T_obj_gel and images."""

    mesh: Path
    codebook: Path
    poses: np.ndarray
    images: list[np.ndarray]


@pytest.fixture(scope="module")
def touches(tmp_path_factory) -> Touches:
    path = bundled_objects()["eyebolt"]
    mesh, sensor = ObjectMesh.load(path), SensorModel.load("digit_tacto")
    book: Codebook = build_codebook(mesh, BookTcn(), sensor, size=1500, seed=0)
    book_path = tmp_path_factory.mktemp("book") / "eyebolt.npz"
    book.save(book_path)
    poses = simulate_slide(mesh, sensor, 0.024, np.random.default_rng(3))
    penetration = PenetrationRenderer(mesh, sensor.scaled(0.5)).render(poses)
    images = []
    for one in penetration:
        image = BACKGROUND.copy()
        image[:, :, 0] += np.clip(np.rint(one / 1e-5), 0, 155).astype(np.uint8).repeat(2, 0).repeat(2, 1)
        images.append(image)
    return Touches(path, book_path, poses, images)


def parameters(touches: Touches, tmp_path: Path) -> dict[str, dict]:
    background = str(tmp_path / "background.png")
    cv2.imwrite(background, BACKGROUND)
    queue = {"queue_depth": 50, "reliable": True}
    return {
        "tdn": {**queue, "background": background},
        "tcn": queue,
        "particle_filter": {
            **queue,
            "mesh": str(touches.mesh),
            "codebook": str(touches.codebook),
            "init_mode": "pose",
            "initial_pose": [*touches.poses[0][:3, 3].tolist(), *_euler(touches.poses[0][:3, :3])],
            "initial_sigma": [0.003, 0.15],
            "max_particles": 3000,
            "threads": 1,
            "input_timeout": 1000.0,
        },
    }


def _euler(rotation: np.ndarray) -> list[float]:
    return Rotation.from_matrix(rotation).as_euler("xyz").tolist()


def _is_answer(status: FilterStatus) -> bool:
    return status.state != FilterStatus.STATE_WAITING


def play(graph, touches: Touches) -> tuple[list[FilterStatus], list[PoseWithCovarianceStamped]]:
    """Send every frame once, when all stages are active and the one before is answered; the answers and the poses."""
    poses = graph.listen(PoseWithCovarianceStamped, "pose", latched=True)
    statuses = graph.listen(FilterStatus, "filter_status", latched=True, wanted=_is_answer)
    watch = LifecycleWatch(graph.companion, ["tdn", "tcn", "particle_filter"])
    graph.spin_until(lambda: not watch.waiting_for, "the stages to be active")
    images, tf = graph.publisher(Image, "image_raw"), graph.publisher(TFMessage, "/tf")
    sent = [SECOND + i * SECOND // 10 for i in range(len(touches.poses))]
    for stamp, T_obj_gel, image in zip(sent, touches.poses, touches.images, strict=True):
        tf.publish(tf_msg(stamp, T_BASE_OBJ @ T_obj_gel))
        images.publish(image_msg(image, stamp))
        graph.spin_until(lambda stamp=stamp: stamp in map(stamp_of, statuses), f"the answer to the frame of {stamp}")
    graph.spin_until(lambda: set(map(stamp_of, poses)) == set(sent))
    answers = {stamp_of(status): status for status in statuses}
    return [answers[stamp] for stamp in sent], sorted(poses, key=stamp_of)


def stamp_of(msg) -> int:
    return stamp_ns(msg.header.stamp)


def error(touches: Touches, msg: PoseWithCovarianceStamped) -> tuple[float, float]:
    """(m, rad) of the last pose."""
    off = se3.inverse(touches.poses[-1]) @ pose_from_msg(msg.pose.pose)
    return float(np.linalg.norm(off[:3, 3])), float(se3.rotation_angle(off[:3, :3]))


@pytest.fixture
def overrides(touches, tmp_path) -> dict[str, dict]:
    return parameters(touches, tmp_path)


def run_together(graph, touches, overrides):
    graph.add_all(lambda options: make_nodes(depth=FakeDepthStage(), tcn=BookTcn(), options=options), overrides)
    return play(graph, touches)


@pytest.mark.slow
def test_processes_and_all_in_one_give_the_same_estimate(graph, touches, overrides, tmp_path):
    stand_ins = {name: [__file__, name] for name in ("tdn", "tcn")}
    with processes(SHIPPED | stand_ins, overrides, tmp_path):
        statuses, poses = play(graph, touches)
    translation, rotation = error(touches, poses[-1])
    assert translation < 0.005
    assert rotation < np.radians(30)
    assert statuses[-1].state in ("converged", "ambiguous")
    graph.remove_all()

    together, poses_together = run_together(graph, touches, overrides)
    assert [stamp_ns(s.header.stamp) for s in together[1:]] == [stamp_ns(s.header.stamp) for s in statuses[1:]]
    for apart, near in zip(poses, poses_together, strict=True):
        assert apart.pose.pose == near.pose.pose, "the same to the last bit"


@pytest.mark.slow
def test_all_in_one_still_publishes_what_is_between_the_stages(graph, touches, overrides):
    graph.add_all(lambda options: make_nodes(depth=FakeDepthStage(), tcn=BookTcn(), options=options), overrides)
    codes = graph.listen(TactileCode, "tactile/code")
    images = graph.publisher(Image, "image_raw")
    images.publish(image_msg(touches.images[0], SECOND))
    graph.spin_until(lambda: codes)
    assert codes[0].in_contact
    assert len(codes[0].code) == 48


def test_help_names_the_driver(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["all_in_one", "--help"])
    assert ended.value.code == 0
    assert "--driver" in capsys.readouterr().out


def test_a_driver_that_gives_up_ends_the_process(monkeypatch):
    monkeypatch.setattr(all_in_one, "make_nodes", list)
    settings = {"serial": "no-such-serial", "wait_for_device_timeout": "0.1", "reconnect_timeout": "0.1"}
    words = [word for name, value in settings.items() for word in ("-p", f"digit_driver:{name}:={value}")]
    assert main(["all_in_one", "--driver", "--ros-args", *words]) == 1


def test_where_one_node_cannot_be_made_none_stays_behind(monkeypatch):
    """A thread of theirs would keep the process from ending."""
    destroyed = []

    class Made:
        def __init__(self, **_):
            pass

        def destroy_node(self):
            destroyed.append(type(self).__name__)

    def refuse(**_):
        raise InputError("tdn: background: no such file")

    for name in ("ParticleFilterNode", "TcnNode"):
        monkeypatch.setattr(all_in_one, name, type(name, (Made,), {"on_contact": None}))
    monkeypatch.setattr(all_in_one, "make_driver", type("Driver", (Made,), {}))
    monkeypatch.setattr(all_in_one, "TdnNode", refuse)
    assert main(["all_in_one", "--driver"]) == 2
    assert sorted(destroyed) == ["Driver", "ParticleFilterNode", "TcnNode"]


def test_bad_parameter_is_one_line_and_exit_code_2():
    command = [sys.executable, "-m", "midastouch_bringup.nodes.all_in_one"]
    refused = subprocess.run(
        [*command, "--ros-args", "-p", "particle_filter:sede:=1"], capture_output=True, text=True, timeout=300
    )
    assert refused.returncode == 2
    assert "no parameter 'sede'" in refused.stderr
    assert "Traceback" not in refused.stderr


if __name__ == "__main__":
    makers = {"tdn": lambda: TdnNode(depth=FakeDepthStage()), "tcn": lambda: TcnNode(tcn=BookTcn())}
    raise SystemExit(spin.run(lambda: [makers[sys.argv[1]]()]))

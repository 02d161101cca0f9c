"""A bag with inputs and results becomes snapshots."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from midastouch_bringup.bags.messages import Message, sequence_messages, typestore
from midastouch_bringup.bags.reader import bag_messages
from midastouch_bringup.bags.run_record import read_run
from midastouch_bringup.bags.writer import BagWriter
from midastouch_perception import se3
from midastouch_perception.errors import InputError

FRAMES = 4


class Results:
    """Serialised results of the nodes, made up."""

    def __init__(self):
        self.store = typestore()

    def new(self, type_name: str, **fields):
        return self.store.types[type_name](**fields)

    def header(self, stamp: int):
        time = self.new("builtin_interfaces/msg/Time", sec=stamp // 10**9, nanosec=stamp % 10**9)
        return self.new("std_msgs/msg/Header", stamp=time, frame_id="object")

    def pose(self, transform: np.ndarray):
        x, y, z, qx, qy, qz, qw = se3.to_xyzquat(transform).tolist()
        point = self.new("geometry_msgs/msg/Point", x=x, y=y, z=z)
        return self.new(
            "geometry_msgs/msg/Pose",
            position=point,
            orientation=self.new("geometry_msgs/msg/Quaternion", x=qx, y=qy, z=qz, w=qw),
        )

    def message(self, topic: str, content, stamp: int) -> Message:
        name = content.__msgtype__
        return Message(topic, name, stamp, bytes(self.store.serialize_cdr(content, name)))

    def of_frame(self, stamp: int, truth: np.ndarray, in_contact: bool) -> list[Message]:
        header = self.header(stamp)
        covariance = np.arange(36.0)
        with_covariance = self.new("geometry_msgs/msg/PoseWithCovariance", pose=self.pose(truth), covariance=covariance)
        mode = self.new("midastouch_msgs/msg/PoseMode", weight=0.75, pose=with_covariance)
        contents = {
            "/filter_status": self.new(
                "midastouch_msgs/msg/FilterStatus",
                header=header,
                state="converged",
                reason="",
                n_particles=700,
                ess=600.0,
                n_modes=1,
                mode_mass=0.75,
                spread_translation=0.001,
                spread_rotation=0.01,
                likelihood_trend=1.0,
                skipped_names=[],
                skipped_counts=np.zeros(0, np.uint64),
                stage_names=["motion", "weights"],
                stage_ms=np.array([1.5, 2.0]),
            ),
            "/pose_modes": self.new("midastouch_msgs/msg/PoseModes", header=header, modes=[mode]),
            "/particles": self.new(
                "geometry_msgs/msg/PoseArray", header=header, poses=[self.pose(truth), self.pose(np.eye(4))]
            ),
            "/pose": self.new("geometry_msgs/msg/PoseWithCovarianceStamped", header=header, pose=with_covariance),
            "/tactile/code": self.new(
                "midastouch_msgs/msg/TactileCode",
                header=header,
                in_contact=in_contact,
                contact_area=1e-4,
                code=np.array([0.6, 0.8], np.float32) if in_contact else np.zeros(0, np.float32),
                network_id="net",
            ),
            "/tactile/penetration": self.new(
                "sensor_msgs/msg/Image",
                header=header,
                height=3,
                width=2,
                encoding="32FC1",
                is_bigendian=0,
                step=8,
                data=np.arange(6, dtype=np.float32).view(np.uint8),
            ),
        }
        return [self.message(topic, content, stamp) for topic, content in contents.items()]

    def other(self, stamp: int, state: str) -> Message:
        """A status beside the answer of a frame."""
        kind = "midastouch_msgs/msg/FilterStatus"
        empty = {
            "skipped_names": [],
            "skipped_counts": np.zeros(0, np.uint64),
            "stage_names": [],
            "stage_ms": np.zeros(0),
        }
        numbers = dict.fromkeys(("ess", "mode_mass", "spread_translation", "spread_rotation", "likelihood_trend"), 0.0)
        content = self.new(
            kind, header=self.header(stamp), state=state, reason="", n_particles=5, n_modes=0, **numbers, **empty
        )
        return self.message("/filter_status", content, stamp)

    def diagnostics(self, stamp: int, node: str, rate: float, ms: float) -> Message:
        values = [
            self.new("diagnostic_msgs/msg/KeyValue", key=k, value=str(v))
            for k, v in (("rate_hz", rate), ("mean_ms", ms))
        ]
        status = self.new(
            "diagnostic_msgs/msg/DiagnosticStatus",
            level=0,
            name=f"{node}: /{node}",
            message="",
            hardware_id="",
            values=values,
        )
        array = self.new("diagnostic_msgs/msg/DiagnosticArray", header=self.header(stamp), status=[status])
        return self.message("/diagnostics", array, stamp)


@pytest.fixture
def bag(simulated_sequence, tmp_path):
    """Function that writes a bag of a sequence: results of `answered` frames only, nothing on topics `without`."""

    def write(answered=range(FRAMES), repeated=(), waited=(), refused=(), without=()):
        sequence = simulated_sequence(FRAMES)
        results = Results()
        messages = list(sequence_messages(sequence))
        images = [m for m in messages if m.topic == "/image_raw"]
        for i in repeated:
            messages.append(images[i])
        for i in waited:
            messages.append(results.other(int(sequence.stamps_ns[i]), "waiting"))
        for i in answered:
            messages += results.of_frame(int(sequence.stamps_ns[i]), sequence.poses_true[i], in_contact=i != 1)
        for i in refused:
            messages.append(results.other(int(sequence.stamps_ns[i]), "stale"))
        last = int(sequence.stamps_ns[-1])
        messages += [results.diagnostics(last, "tdn", 10.0, 3.0), results.diagnostics(last, "tdn", 30.0, 5.0)]
        messages += [results.diagnostics(last, "tcn", 0.0, 0.0)]
        path = tmp_path / "run.mcap"
        with BagWriter(path) as writer:
            for message in messages:
                if message.topic not in without:
                    writer.write(message)
        return sequence, path

    return write


def test_every_answered_frame_is_a_snapshot_with_its_truth(bag):
    sequence, path = bag()
    record = read_run(path)
    assert [s.frame for s in record.snapshots] == [0, 1, 2, 3]
    assert [s.time for s in record.snapshots] == pytest.approx([0, 0.1, 0.2, 0.3])
    for i, snapshot in enumerate(record.snapshots):
        assert snapshot.truth == pytest.approx(sequence.poses_true[i], abs=1e-6)
        assert snapshot.particles[0] == pytest.approx(sequence.poses_true[i], abs=1e-6)
        assert snapshot.particles[1] == pytest.approx(np.eye(4))
        assert snapshot.estimate == pytest.approx(sequence.poses_true[i], abs=1e-6)
        assert (snapshot.image == sequence.image(i)).all()
        assert snapshot.penetration.tolist() == [[0, 1], [2, 3], [4, 5]]
        assert snapshot.state == "converged"
    (mode,) = record.snapshots[2].modes
    assert mode.weight == 0.75
    assert mode.covariance[1].tolist() == [6, 7, 8, 9, 10, 11]


def test_without_contact_there_is_no_code(bag):
    codes = [s.code for s in read_run(bag()[1]).snapshots]
    assert codes[1] is None
    assert codes[2] == pytest.approx([0.6, 0.8])


def test_what_the_recorder_leaves_out_may_be_missing(bag):
    """Penetration maps are not among its topics, and a real run has no pose published before it is sure."""
    record = read_run(bag(without={"/tactile/penetration", "/tactile/code", "/pose", "/diagnostics"})[1])
    for snapshot in record.snapshots:
        assert snapshot.penetration is None
        assert snapshot.code is None
        assert snapshot.estimate is None
        assert len(snapshot.particles) == 2
    assert record.node_ms == {}


def test_a_real_run_has_no_truth(bag, tmp_path):
    _, path = bag()
    measured = tmp_path / "measured.mcap"
    store = typestore()
    with BagWriter(measured) as writer:
        for message in bag_messages(path):
            if message.topic == "/tf":
                content = store.deserialize_cdr(message.data, message.type_name)
                content.transforms = content.transforms[:1]
                message = dataclasses.replace(message, data=bytes(store.serialize_cdr(content, message.type_name)))
            writer.write(message)
    assert [s.truth for s in read_run(measured).snapshots] == [None] * FRAMES


def test_times_per_frame(bag):
    record = read_run(bag()[1])
    assert record.filter_ms == pytest.approx([3.5] * FRAMES)
    assert record.n_particles == [700] * FRAMES
    assert record.node_ms == pytest.approx({"tdn": 4.5})  # weighted by their frames; tcn was idle


def test_unanswered_and_repeated_frames_do_not_count(bag):
    record = read_run(bag(answered=[0, 2, 3], repeated=[2, 3])[1])
    assert [s.frame for s in record.snapshots] == [0, 2, 3]


def test_the_word_that_an_answer_is_still_to_come_is_none(bag):
    record = read_run(bag(answered=[0, 2, 3], waited=[1, 2])[1])
    assert [s.frame for s in record.snapshots] == [0, 2, 3]
    assert [s.state for s in record.snapshots] == ["converged"] * 3
    assert record.n_particles == [700] * 3


def test_of_a_frame_recorded_twice_the_first_answer_counts(bag):
    """The filter refuses the second."""
    record = read_run(bag(repeated=[2], refused=[2])[1])
    assert [s.frame for s in record.snapshots] == [0, 1, 2, 3]
    assert [s.state for s in record.snapshots] == ["converged"] * 4


def test_a_run_without_results_is_refused(bag):
    with pytest.raises(InputError, match=r"run\.mcap"):
        read_run(bag(answered=[])[1])

"""A filter that records what it is asked, and messages for the node that owns it."""

from __future__ import annotations

import array
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
from geometry_msgs.msg import PoseWithCovarianceStamped
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header
from tf_messages import translation

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.ros.conversions import points_to_msg, pose_to_msg, stamp_from_ns
from midastouch_filter.active_touch.suggestion import Advice, Suggestion, Wanted
from midastouch_filter.core.estimate import Estimate, Mode
from midastouch_filter.core.state import AMBIGUOUS, Status
from midastouch_filter.loaded_object import LoadedObject
from midastouch_msgs.msg import TactileCode
from midastouch_perception.pointcloud import cloud_from_penetration
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.symmetry.search import ObjectSymmetry

DIAGONAL = 0.3
MAP_SENSOR = SensorModel.load("digit_tacto").scaled(0.5)


class FakeFilter:
    """Believes the motion it is told: the estimate is the start moved by the odometry.

    Attributes: object, of which nothing is known; starts, odometry, measurements, others, elapsed and wanted, what it
    was asked; state and alike, whether hypotheses cannot be distinguished, what it answers;
    deferred_updates, how many measurements had come at each `deferred_update`.
    """

    def __init__(self):
        self.object = SimpleNamespace(density="", symmetry=ObjectSymmetry())
        self.starts: list = []
        self.odometry: list = []
        self.measurements: list = []
        self.others: list = []
        self.elapsed: list = []
        self.deferred_updates: list[int] = []
        self.forced = 0
        self.state = AMBIGUOUS
        self.alike = False
        self.wanted: list[Wanted] = []
        self.spoil = False
        self.identity = np.ones(1), 0.0
        self._pose = np.eye(4)

    def initialise_uniform(self) -> None:
        self.starts.append("uniform")
        self._pose = np.eye(4)

    def initialise_gaussian(self, pose, sigma_t, sigma_r) -> None:
        self.starts.append((pose, sigma_t, sigma_r))
        self._pose = pose

    def force_update(self) -> None:
        self.forced += 1

    def step(self, odometry, measurement, others=None, elapsed=None) -> Estimate:
        if measurement.network_id not in ("", "fake"):
            raise InputError("tactile code: from network other, but the codebook was built with fake")
        self.odometry.append(odometry)
        self.measurements.append(measurement)
        self.others.append(others)
        self.elapsed.append(elapsed)
        if odometry is not None:
            self._pose = self._pose @ odometry
        covariance = np.diag([1e-6, 2e-6, 3e-6, 1e-4, 2e-4, 3e-4])
        pose = np.full((4, 4), np.nan) if self.spoil else self._pose
        modes = [Mode(0.75, pose, covariance, 600), Mode(0.25, translation(0.05), covariance, 200)]
        status = Status(self.state, "as told", 800, 400.0, 2, 0.75, 1e-3, 0.1, -0.5, {"at_rest": 3}, {"modes": 0.5})
        status = replace(status, symmetry=self.object.symmetry.describe())
        return Estimate(modes, status, covariance)

    def deferred_update(self, in_time=None) -> None:
        self.deferred_updates.append(len(self.measurements))

    def advise(self, wanted) -> Advice:
        self.wanted.append(wanted)
        path = np.stack([translation(x) for x in (0.0, 0.01, 0.02)])
        slide = Suggestion(0.5, 0.02, False, 0.6, 0.02, "after 20 mm two hypotheses differ", path)
        lift = Suggestion(-0.5, 0.04, True, 0.1, 0.06, "touched again 40 mm away", path[[0, 2]])
        return Advice([slide, lift][: wanted.count], self.alike, "two hypotheses compete")

    @property
    def poses(self) -> np.ndarray:
        offsets = np.linspace(-0.01, 0.01, 2000)
        return self._pose @ se3.translation(np.stack([offsets, 0 * offsets, 0 * offsets], axis=1))

    @property
    def weights(self) -> np.ndarray:
        return np.full(2000, 1 / 2000)


class StubGrowth:
    """Stands for `growth.Growth`: its filter can take what `ready` is set to; calls are those that begin and end it."""

    def __init__(self):
        self.calls, self.ready, self.done, self.failure = [], None, False, ""

    def start(self) -> None:
        self.calls.append("start")

    def close(self) -> None:
        self.calls.append("close")

    def take(self) -> object:
        ready, self.ready = self.ready, None
        return ready


def loader_of(filters: list[FakeFilter]):
    """A `load` for the node that hands out fakes and refuses a mesh called bad.ply; the paper's gives no advice."""

    def load(mesh_path, codebook_path, config, seed, paper=False) -> LoadedObject:
        if mesh_path.name == "bad.ply":
            raise InputError(f"{mesh_path}: not a mesh")
        filters.append(FakeFilter())
        advisor = None if paper else filters[-1]
        return LoadedObject(filters[-1], DIAGONAL, mesh_path.stem, MAP_SENSOR, advisor=advisor)

    return load


def code_msg(stamp: int, network_id: str = "fake", in_contact: bool = True) -> TactileCode:
    header = Header(stamp=stamp_from_ns(stamp), frame_id="digit_gel_frame")
    code = array.array("f", [0.6, 0.8] if in_contact else [])
    return TactileCode(header=header, in_contact=in_contact, contact_area=1e-5, code=code, network_id=network_id)


def pose_msg(frame: str, pose: np.ndarray, variances=(1e-4,) * 3 + (1e-2,) * 3) -> PoseWithCovarianceStamped:
    msg = PoseWithCovarianceStamped(header=Header(frame_id=frame))
    msg.pose.pose = pose_to_msg(pose)
    msg.pose.covariance = np.diag(variances).ravel().tolist()
    return msg


def cloud_msg(stamp: int, penetration: np.ndarray) -> PointCloud2:
    header = Header(stamp=stamp_from_ns(stamp), frame_id="digit_gel_frame")
    return points_to_msg(cloud_from_penetration(penetration, penetration > 0, MAP_SENSOR), header)


def all_finite(msg) -> bool:
    """Whether every number in a message is finite, at any depth."""
    if isinstance(msg, float | np.floating):
        return bool(np.isfinite(msg))
    if isinstance(msg, np.ndarray | array.array):
        return bool(np.isfinite(np.asarray(msg)).all())
    if isinstance(msg, list | tuple):
        return all(map(all_finite, msg))
    if hasattr(msg, "get_fields_and_field_types"):
        return all(all_finite(getattr(msg, name)) for name in msg.get_fields_and_field_types())
    return True

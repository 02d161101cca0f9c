"""A finished run, moment by moment: read from a bag, or from a result of `midastouch evaluate`."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.sensor_model import SensorModel

from ..bags.reader import bag_metadata
from ..bags.run_record import RecordedMode, Snapshot, read_run
from ..datasets.loading import is_bag
from ..drawing.object_view import measured_contact
from ..result_file import read_json
from .scene import Scene

_NO_POSES = np.empty((0, 4, 4))


@dataclasses.dataclass(frozen=True)
class Moment:
    """One moment of a run; poses are `T_obj_gel` (4, 4).

    label: time and state in words; particles (N, 4, 4); modes: heaviest first; estimates: published pose of each
    trial, None if it had none; truth: None if the run has none; contact (K, 3) m: measured points in the object's
    frame, placed by the estimate.
    """

    label: str
    particles: np.ndarray
    modes: list[RecordedMode]
    estimates: list[np.ndarray | None]
    truth: np.ndarray | None
    contact: np.ndarray


@dataclasses.dataclass(frozen=True)
class Run:
    """A finished run; mesh: file or name of the object, empty if the run does not state it; moments: in time order."""

    name: str
    mesh: str
    moments: list[Moment]


def load(path: str | Path, sequence: str | None = None, sensor: str = "digit_tacto") -> Run:
    """Read a bag with the results of a run, or the trials of a `sequence` in a result of `midastouch evaluate`.

    sequence: needed if the file has several; sensor: the model whose rays turn a penetration map into points.
    Raises InputError if `path` is neither of the two, or holds no results.
    """
    path = Path(path)
    if is_bag(path):
        model, snapshots = SensorModel.load(sensor), read_run(path).snapshots
        try:
            moments = [_of_snapshot(snapshot, model) for snapshot in snapshots]
        except InputError as error:
            raise InputError(f"{path}: {error}") from error
        return Run(path.name, bag_metadata(path).get("object", ""), moments)
    if not path.exists():
        raise InputError(f"{path}: no such bag or result file; check the path")
    if path.suffix != ".json":
        bags = ", ".join(str(bag) for bag in sorted(path.glob("*.mcap")))
        within = f"; name the bag in it: {bags}" if bags else ""
        raise InputError(
            f"{path}: neither a bag (.mcap file or folder) nor a result of midastouch evaluate (.json){within}"
        )
    content = read_json(path)
    try:
        return _of_trials(path, content["sequences"], content["trials"], sequence)
    except (KeyError, TypeError, IndexError) as error:
        raise InputError(f"{path}: not a result of midastouch evaluate ({error!r})") from error


def _of_snapshot(snapshot: Snapshot, sensor: SensorModel) -> Moment:
    label, contact = f"{snapshot.time:.1f} s, {snapshot.state}", measured_contact(snapshot, sensor)
    return Moment(label, snapshot.particles, snapshot.modes, [snapshot.estimate], snapshot.truth, contact)


def _of_trials(path: Path, sequences: list[dict], trials: list[dict], name: str | None) -> Run:
    names = [one["sequence"] for one in sequences]
    if name is None and len(names) == 1:
        name = names[0]
    if name not in names:
        raise InputError(f"{path}: give the --sequence to look at: {', '.join(names)}")
    chosen = sequences[names.index(name)]
    truth = se3.from_xyzquat(np.array(chosen["truth"], float).reshape(-1, 7))
    own = [trial["per_frame"] for trial in trials if trial["sequence"] == name]
    moments = []
    for i, true_pose in enumerate(truth):
        estimates = [None if one["estimate"][i] is None else se3.from_xyzquat(one["estimate"][i]) for one in own]
        converged = sum(one["state"][i] == "converged" for one in own)
        label = f"frame {own[0]['frame'][i]}, converged in {converged} of {len(own)} trials"
        moments.append(Moment(label, _NO_POSES, [], estimates, true_pose, np.empty((0, 3))))
    return Run(name, chosen["mesh"], moments)


def draw(run: Run, mesh: ObjectMesh, scene: Scene, recording) -> None:
    """Draw all moments of a run into a scene on a `rerun.RecordingStream`, on its timeline `moment`."""
    scene.mesh(mesh.vertices, mesh.faces, mesh.vertex_normals)
    for index, moment in enumerate(run.moments):
        recording.set_time("moment", sequence=index)
        scene.status(moment.label, run.name, {})
        scene.particles(moment.particles[:, :3, 3], moment.particles[:, :3, 2], np.ones(len(moment.particles)))
        covariances = np.array([mode.covariance for mode in moment.modes]).reshape(-1, 6, 6)
        poses = np.array([mode.pose for mode in moment.modes]).reshape(-1, 4, 4)
        scene.modes([mode.weight for mode in moment.modes], poses, covariances)
        for trial, pose in enumerate(moment.estimates):
            if pose is not None:
                scene.estimate(pose, f"_{trial + 1}" if trial else "")
        if moment.truth is not None:
            scene.truth(moment.truth)
        if moment.estimates[0] is not None:
            placed = moment.estimates[0]
            scene.contact((moment.contact - placed[:3, 3]) @ placed[:3, :3])

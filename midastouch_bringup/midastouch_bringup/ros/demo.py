"""The demo: a simulated slide over a bundled object through the real nodes, over real DDS, then a report.

Nothing outside the installation is needed; slide and codebook are kept in `out/` for the next time.
"""

from __future__ import annotations

import os
import time
from pathlib import Path

import numpy as np
import rclpy
from PIL import Image
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from tqdm import tqdm

from midastouch_msgs.msg import FilterStatus
from midastouch_perception.codebook import Codebook
from midastouch_perception.files import atomic_path
from midastouch_perception.mesh import ObjectMesh
from midastouch_perception.message_arrays import stamp_ns
from midastouch_perception.ros import qos
from midastouch_perception.ros.lifecycle_watch import LifecycleWatch
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tcn import load_tcn

from ..codebooks import cached_codebook, cached_codebook_path
from ..commands.demo import SLIDE_LENGTH
from ..datasets import Sequence, load_sequence
from ..evaluation.metrics import closest_mode_error, particle_rmse, pose_errors
from ..evaluation.result_file import write_json
from ..evaluation.table import number, text_table
from ..messages import IMAGE_TYPE
from ..node_processes import NodeFailed, NodeProcesses
from ..nodes.recorder import TOPICS, Recorder, Topic
from ..parameter_files import merged, read_parameters, written
from ..progress import progress_bar
from ..report.animation import write_gif
from ..report.figures import error_figure, run_figure, save
from ..report.object_view import ObjectView
from ..report.page import Page
from ..report.snapshot import moments
from ..run_record import PENETRATION, RunRecord, read_run
from ..slide_simulation import cached_slide

NODES = ("tdn", "tcn", "particle_filter")
CODEBOOK_SIZES = 5_000, 20_000
"""Fewest and most poses of a codebook: built within a minute on two cores."""
_POSES_PER_AREA = 1e6  # 1/m^2
_SILENCE_S = 120.0  # without a status while the replay goes on
_LAST_STATUS_S = 5.0
_COLUMNS = 5
_FOUND_MM, _FOUND_DEG = 10, 15
_GIF_FRAMES = 60


def run_demo(object_path: Path, out: Path, domain: int, seed: int) -> Path:
    """Run the demo on the mesh at `object_path`; returns the path of its page, `out/index.html`.

    domain: ROS_DOMAIN_ID for the nodes. Raises NodeFailed when a node dies or falls silent, InputError for
    parts that are not installed.
    """
    out.mkdir(parents=True, exist_ok=True)
    mesh, sensor = ObjectMesh.load(object_path), SensorModel.load("digit_tacto")
    print(f"1/5  a slide of {SLIDE_LENGTH:g} m over '{mesh.name}', simulated", flush=True)
    sequence = load_sequence(cached_slide(mesh, sensor, SLIDE_LENGTH, seed))
    size = int(np.clip(_POSES_PER_AREA * mesh.area, *CODEBOOK_SIZES))
    print(f"2/5  its codebook of {size:,} touches", flush=True)
    codebook = cached_codebook(mesh, load_tcn("fast", sensor), sensor, size)
    print(f"3/5  replay, tdn, tcn and particle_filter as processes, ROS_DOMAIN_ID={domain}", flush=True)
    bag = out / "run.mcap"
    with atomic_path(bag) as temporary:
        seconds = _run_nodes(sequence, _parameters(mesh, size, sequence, out), temporary, out / "log", domain)
    print(f"4/5  reading {bag}", flush=True)
    record = read_run(bag)
    print("5/5  pictures", flush=True)
    result = _result(record, mesh, seconds)
    write_json(out / "result.json", result)
    page = _write_report(record, mesh, codebook, result, out)
    print(f"\n{_table(result)}\n")
    return page


def _parameters(mesh: ObjectMesh, size: int, sequence: Sequence, out: Path) -> Path:
    """Parameter file of all nodes: the shipped ones for recordings, with this object and its slide."""
    config = _config_folder()
    own = {
        "replay": {"source": str(sequence.path.resolve()), "wait_for_subscribers": 2},
        "tdn": {"background": str(sequence.background_path.resolve())},
        "particle_filter": {
            "mesh": str(mesh.path),
            "codebook": str(cached_codebook_path(mesh, size).resolve()),
            "view_rate": 0.0,  # particles of every frame, for the pictures
        },
    }
    layers = [read_parameters(config / "midastouch.yaml"), read_parameters(config / "replay.yaml"), own]
    nodes = {node: merged(layers)[node] for node in (*NODES, "replay")}
    for node in NODES:
        nodes[node]["use_sim_time"] = True
    path = out / "parameters.yaml"
    path.write_text(written(nodes, ""))
    return path


def _config_folder() -> Path:
    """`config` of this package: in the source tree, or where an install has put it."""
    beside = Path(__file__).resolve().parents[2] / "config"
    if beside.is_dir():
        return beside
    from ament_index_python.packages import get_package_share_directory

    return Path(get_package_share_directory("midastouch_bringup")) / "config"


def _run_nodes(sequence: Sequence, parameters: Path, bag: Path, logs: Path, domain: int) -> float:
    """Play the sequence through the nodes into a bag; returns the seconds from first to last status."""
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    rclpy.init(args=[], domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
    executor = SingleThreadedExecutor()
    nodes: list[Node] = []
    try:
        with NodeProcesses(logs, domain) as processes:
            for name in NODES:
                processes.start(name, parameters)
            nodes += [_recorder(bag, sequence), listener := _Listener(sequence)]
            for node in nodes:
                executor.add_node(node)
            _await_answers(executor, processes, *nodes)
            processes.start("replay", parameters)
            _follow(executor, processes, listener)
            return listener.seconds
    finally:
        executor.shutdown()
        for node in nodes:
            node.destroy_node()
        rclpy.try_shutdown()


def _recorder(bag: Path, sequence: Sequence) -> Recorder:
    topics = (*TOPICS, Topic(PENETRATION, IMAGE_TYPE))
    overrides = [Parameter("path", value=str(bag)), Parameter("use_sim_time", value=True)]
    metadata = {"object": sequence.object_name, "sequence": sequence.name, "layout": sequence.layout}
    return Recorder(topics, metadata, parameter_overrides=overrides)


class _Listener(Node):
    """Follows the filter's status with a progress bar, and which nodes are active."""

    def __init__(self, sequence: Sequence):
        super().__init__("demo")
        self._last_stamp = int(sequence.stamps_ns[-1])
        self._bar = progress_bar(total=sequence.n_frames, unit="frame")
        self._seen: set[int] = set()
        self.heard_at = self._first_at = time.monotonic()
        self.done = False
        self.consumers = LifecycleWatch(self, NODES)
        self.create_subscription(FilterStatus, "filter_status", self._on_status, qos.latched(depth=100))

    @property
    def seconds(self) -> float:
        """From the first status of a frame to the newest."""
        return self.heard_at - self._first_at

    def _on_status(self, status: FilterStatus) -> None:
        stamp = stamp_ns(status.header.stamp)
        if status.state == FilterStatus.STATE_WAITING or status.n_particles == 0 or stamp in self._seen:
            return
        self.heard_at = time.monotonic()
        if not self._seen:
            self._first_at = self.heard_at
        self._seen.add(stamp)
        self._bar.update()
        self._bar.set_postfix_str(f"{status.state}, {status.n_particles} particles, {status.n_modes} modes")
        self.done = stamp >= self._last_stamp

    def destroy_node(self) -> None:
        self._bar.close()
        super().destroy_node()


def _await_answers(
    executor: SingleThreadedExecutor, processes: NodeProcesses, recorder: Recorder, listener: _Listener
) -> None:
    """Spin until the nodes are active and the recorder hears what it is to keep: a frame sent earlier would be lost."""
    started = time.monotonic()
    awaited = ("tactile/code", "tactile/points", "pose_modes", "particles", "filter_status")
    while listener.consumers.waiting_for or not all(recorder.count_publishers(topic) for topic in awaited):
        executor.spin_once(timeout_sec=0.1)
        processes.check(*NODES)
        if time.monotonic() - started > _SILENCE_S:
            waiting = listener.consumers.waiting_for or "the recorder, for their topics"
            raise NodeFailed(f"still waiting for {waiting} after {_SILENCE_S:g} s; see the logs in the output folder")


def _follow(executor: SingleThreadedExecutor, processes: NodeProcesses, listener: _Listener) -> None:
    """Spin until the replay has ended and its last frame is answered."""
    while processes.running("replay"):
        executor.spin_once(timeout_sec=0.1)
        processes.check(*NODES)
        if time.monotonic() - listener.heard_at > _SILENCE_S:
            raise NodeFailed(f"no filter_status for {_SILENCE_S:g} s; see the logs in the output folder")
    ended = time.monotonic()
    while not listener.done:
        executor.spin_once(timeout_sec=0.1)
        processes.check(*NODES)
        if time.monotonic() - ended > _LAST_STATUS_S:
            raise NodeFailed("the replay has ended, but its last frame was never answered")
    # what the nodes had sent before their last status may still be on its way to the recorder
    quiet_until = time.monotonic() + 0.5
    while time.monotonic() < quiet_until:
        executor.spin_once(timeout_sec=0.05)


def _result(record: RunRecord, mesh: ObjectMesh, seconds: float) -> dict:
    """Final errors, rates, particles and state: `result.json`."""
    last = record.snapshots[-1]
    modes = np.array([mode.pose for mode in last.modes]).reshape(-1, 4, 4)
    errors = {
        "particles": particle_rmse(last.particles, last.truth),
        "closest mode": closest_mode_error(modes, last.truth),
        "published pose": (np.nan, np.nan) if last.estimate is None else pose_errors(last.estimate, last.truth),
    }
    stage_ms = {**record.node_ms, "particle_filter": float(np.mean(record.filter_ms))}
    return {
        "object": mesh.name,
        "frames": len(record.snapshots),
        "final": {
            name: {"trans_mm": 1e3 * float(e[0]), "rot_deg": float(np.degrees(e[1]))} for name, e in errors.items()
        },
        "state": last.state,
        "n_particles": record.n_particles[-1],
        "n_modes": len(last.modes),
        "stage_ms": {name: stage_ms[name] for name in NODES if name in stage_ms},
        "hz": (len(record.snapshots) - 1) / seconds if seconds > 0 else None,
    }


def _rows(result: dict) -> tuple[list[str], list[list[str]]]:
    rows = [
        [f"{name}, final error", f"{number(e['trans_mm'])} mm, {number(e['rot_deg'])} deg"]
        for name, e in result["final"].items()
    ]
    rows += [
        [f"{name}", f"{number(1e3 / ms, 0)} Hz ({number(ms, 2)} ms per frame)"]
        for name, ms in result["stage_ms"].items()
        if ms > 0
    ]
    closest = result["final"]["closest mode"]
    found = closest["trans_mm"] <= _FOUND_MM and closest["rot_deg"] <= _FOUND_DEG
    rows.append([f"found (closest mode within {_FOUND_MM} mm, {_FOUND_DEG} deg)", "yes" if found else "no"])
    rows.append(["frames over DDS", f"{result['frames']} at {number(result['hz'])} Hz"])
    rows.append(["state", f"{result['state']}, {result['n_particles']} particles, {result['n_modes']} modes"])
    return [result["object"], ""], rows


def _table(result: dict) -> str:
    return text_table(*_rows(result))


def _write_report(record: RunRecord, mesh: ObjectMesh, codebook: Codebook, result: dict, out: Path) -> Path:
    run = record.snapshots
    view = ObjectView(mesh, np.array([s.truth for s in run]), 760)
    overview = save(
        run_figure(view, codebook, moments(run, _COLUMNS), run, f"{mesh.name}, {len(run)} frames"), out / "run.png"
    )
    errors = save(error_figure(run), out / "errors.png")
    final = out / "final.png"
    with atomic_path(final) as temporary:
        Image.fromarray(view.particles(run[-1])).save(temporary)
    with progress_bar(unit="picture") as bar:
        animation = write_gif(out / "run.gif", view, run, _GIF_FRAMES, lambda chosen: _ticked(chosen, bar))
    page = Page(f"MidasTouch demo: {mesh.name}")
    page.table(*_rows(result))
    page.picture(animation, "The run: particles on the object, touch, errors")
    page.picture(overview, "Touch, its likelihood over the object, particles, errors (the paper's figure 7)")
    page.picture(final, "Particles, modes and ground truth at the end")
    page.picture(errors, "Errors over time")
    page.note("Recorded in run.mcap: inputs, ground truth and all results. Play it with: midastouch replay run.mcap")
    return page.write(out / "index.html")


def _ticked(items: list, bar: tqdm):
    bar.reset(len(items))
    for item in items:
        yield item
        bar.update()

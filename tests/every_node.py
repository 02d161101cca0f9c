"""Makes every node that users start, with stand-ins for networks, object and hardware."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import rclpy
from rclpy.node import Node
from rclpy.parameter import Parameter

from midastouch_bringup.datasets import write_sequence
from midastouch_perception.objects import bundled_objects
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn.background_store import BackgroundStore


class FakeNet:
    """Stands for a network or a stage: the nodes are only asked for their interfaces."""

    network_id, dim = "fake", 4


def make_node(name: str, context: rclpy.Context, tmp_path: Path, **parameters) -> Node:
    """The node of that name, with parameter values as from a YAML file."""
    values = {**_needed(name, tmp_path), **parameters}
    overrides = [Parameter(key, value=value) for key, value in values.items()]
    options = {"context": context, "parameter_overrides": overrides}
    if name == "digit_driver":
        from digit_driver.nodes.digit_driver import DigitDriver

        return DigitDriver(**options)
    if name == "digit_sim":
        from midastouch_bringup.nodes.digit_sim import DigitSim

        return DigitSim(**options)
    if name == "explorer":
        from midastouch_bringup.nodes.explorer import Explorer

        return Explorer(**options)
    if name == "tdn":
        from midastouch_perception.nodes.tdn import TdnNode

        return TdnNode(depth=FakeNet(), **options)
    if name == "tcn":
        from midastouch_perception.nodes.tcn import TcnNode

        return TcnNode(tcn=FakeNet(), **options)
    if name == "particle_filter":
        from midastouch_filter.nodes.particle_filter import ParticleFilterNode

        return ParticleFilterNode(**options)
    if name == "ur_tf":
        from midastouch_bringup.nodes.ur_tf import UrTf

        def connect(robot_ip, rate):
            raise ConnectionError("no arm")

        return UrTf(connect, **options)
    if name == "detection_prior":
        from midastouch_bringup.nodes.detection_prior import DetectionPrior

        return DetectionPrior(**options)
    if name == "mount_tf":
        from midastouch_bringup.nodes.mount_tf import MountTf

        return MountTf(**options)
    if name == "view":
        from midastouch_bringup.nodes.view import View

        return View(scene=FakeNet(), **options)
    if name == "calibrate":
        from midastouch_perception.nodes.calibrate import CalibrateNode

        return CalibrateNode(**options)
    if name == "recorder":
        from midastouch_bringup.nodes.recorder import Recorder

        return Recorder(**options)
    from midastouch_bringup.nodes.replay import Replay

    return Replay(**options)


def _needed(name: str, tmp_path: Path) -> dict:
    """Parameters without which the node does not start here."""
    if name == "digit_driver":
        return {"autostart": False}
    if name in ("digit_sim", "explorer"):
        return {"mesh": str(bundled_objects()["ball"])}
    if name == "ur_tf":
        return {"robot_ip": "the.arm"}
    if name == "recorder":
        return {"path": str(tmp_path / "recorded.mcap")}
    if name == "calibrate":
        BackgroundStore(tmp_path, "D20123").save(np.full((320, 240, 3), 100, np.uint8))
        return {"serial": "D20123", "ball_diameter": 0.006, "background_folder": str(tmp_path)}
    if name != "replay":
        return {}
    image, poses = np.zeros((320, 240, 3), np.uint8), np.tile(np.eye(4), (2, 1, 1))
    write_sequence(
        tmp_path / "00",
        ((image, np.zeros((320, 240), np.float32)) for _ in poses),
        poses,
        poses,
        background=image,
        object_name="nothing",
        sensor=SensorModel.load("digit_tacto"),
        noise={"sig_t": 0.0, "sig_r": 0.0},
    )
    return {"source": str(tmp_path / "00"), "clock": True, "ack_topic": "filter_status"}

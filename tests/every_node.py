"""Makes every node that users start, with stand-ins for networks, object and hardware."""

from __future__ import annotations

import importlib
from pathlib import Path
from unittest.mock import MagicMock

import numpy as np
import rclpy
from rclpy.node import Node
from rclpy.parameter import Parameter
from sequences import write_slide

from midastouch_perception.objects import bundled_objects
from midastouch_perception.tdn.background_store import BackgroundStore


class FakeNet:
    """Stands for a network or a stage: the nodes are only asked for their interfaces."""

    network_id, dim = "fake", 4


def _no_arm(robot_ip, rate):
    raise ConnectionError("no arm")


_PERCEPTION, _MOTION = "midastouch_perception.nodes", "midastouch_motion.nodes"
_SIMULATION, _TOOLS = "midastouch_simulation.nodes", "midastouch_tools.nodes"
_NODES = {
    "digit_driver": ("digit_driver.nodes.digit_driver", "DigitDriver", {}),
    "digit_sim": (f"{_SIMULATION}.digit_sim", "DigitSim", {}),
    "explorer": (f"{_MOTION}.explorer", "Explorer", {}),
    "simulated_finger": (f"{_SIMULATION}.simulated_finger", "SimulatedFingerNode", {}),
    "simulated_gripper": (f"{_SIMULATION}.simulated_gripper", "SimulatedGripperNode", {}),
    "tdn": (f"{_PERCEPTION}.tdn", "TdnNode", {"depth": FakeNet()}),
    "tcn": (f"{_PERCEPTION}.tcn", "TcnNode", {"tcn": FakeNet()}),
    "particle_filter": ("midastouch_filter.nodes.particle_filter", "ParticleFilterNode", {}),
    "contact_controller": (f"{_MOTION}.contact_controller", "ContactController", {}),
    "mujoco_arm": (f"{_SIMULATION}.mujoco_arm", "MujocoArmNode", {}),
    "ur_speed": (f"{_MOTION}.ur_speed", "UrSpeed", {"make_follower": MagicMock()}),
    "ur_tf": (f"{_MOTION}.ur_tf", "UrTf", {"connect": _no_arm}),
    "detection_prior": ("midastouch_filter.nodes.detection_prior", "DetectionPrior", {}),
    "mount_tf": (f"{_MOTION}.mount_tf", "MountTf", {}),
    "view": (f"{_TOOLS}.view", "View", {"scene": MagicMock()}),
    "calibrate": (f"{_PERCEPTION}.calibrate", "CalibrateNode", {}),
    "recorder": (f"{_TOOLS}.recorder", "Recorder", {}),
    "replay": (f"{_TOOLS}.replay", "Replay", {}),
}
"""Module and class of each node, and what stands for hardware and networks."""


def make_node(name: str, context: rclpy.Context, tmp_path: Path, **parameters) -> Node:
    """The node of that name, with parameter values as from a YAML file."""
    module, node_class, stand_ins = _NODES[name]
    overrides = [Parameter(key, value=value) for key, value in {**_needed(name, tmp_path), **parameters}.items()]
    make = getattr(importlib.import_module(module), node_class)
    return make(**stand_ins, context=context, parameter_overrides=overrides)


def _needed(name: str, tmp_path: Path) -> dict:
    """Parameters without which the node does not start here."""
    if name == "digit_driver":
        return {"autostart": False}
    if name in ("digit_sim", "simulated_finger", "simulated_gripper", "mujoco_arm"):
        return {"mesh": str(bundled_objects()["handle_tool" if name == "simulated_gripper" else "ball"])}
    if name in ("ur_speed", "ur_tf"):
        return {"robot_ip": "the.arm"}
    if name == "recorder":
        return {"path": str(tmp_path / "recorded.mcap")}
    if name == "calibrate":
        BackgroundStore(tmp_path, "D20123").save(np.full((320, 240, 3), 100, np.uint8))
        return {"serial": "D20123", "ball_diameter": 0.006, "background_folder": str(tmp_path)}
    if name != "replay":
        return {}
    image, poses = np.zeros((320, 240, 3), np.uint8), np.tile(np.eye(4), (2, 1, 1))
    slide = write_slide(tmp_path / "00", [image] * 2, poses)
    return {"source": str(slide.path), "clock": True, "ack_topic": "filter_status"}

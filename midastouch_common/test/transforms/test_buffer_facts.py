"""The imported tf2_ros against what the real tf2 answers: recorded of Jazzy's, and asked of the one of python3-tf2."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest
from geometry_msgs.msg import TransformStamped
from rclpy.duration import Duration
from rclpy.time import Time
from tf2_ros import Buffer

from midastouch_common.ros.conversions import stamp_from_ns

FACTS = Path(__file__).parent.parent / "facts"
SCENARIOS = json.loads((FACTS / "tf2_jazzy.json").read_text())["scenarios"]
SYSTEM_PYTHON = "/usr/bin/python3"
SECOND = 1_000_000_000


def message(step: dict) -> TransformStamped:
    """A step's transform."""
    out = TransformStamped(child_frame_id=step["child"])
    out.header.stamp, out.header.frame_id = stamp_from_ns(step["stamp"]), step["parent"]
    p, q = out.transform.translation, out.transform.rotation
    p.x, p.y, p.z, q.x, q.y, q.z, q.w = map(float, step["pose"])
    return out


def answer(buffer: Buffer, step: dict):
    """What a buffer says to a step, stamps in ns: a pose, nanoseconds, whether, an exception's name, or None."""
    try:
        if step["do"] == "set":
            buffer.set_transform(message(step), "facts")
        elif step["do"] == "static":
            buffer.set_transform_static(message(step), "facts")
        elif step["do"] == "clear":
            buffer.clear()
        elif step["do"] == "latest":
            return buffer.get_latest_common_time(step["target"], step["source"]).nanoseconds
        else:
            asked = step["target"], step["source"], Time(nanoseconds=step["stamp"])
            found = buffer.lookup_transform(*asked).transform
            if step["do"] == "can":
                return True
            p, q = found.translation, found.rotation
            return [p.x, p.y, p.z, q.x, q.y, q.z, q.w]
    except Exception as error:
        return False if step["do"] == "can" else type(error).__name__
    return None


def same(one, other) -> bool:
    """Whether two answers are the same; both quaternions of a rotation are."""
    if not isinstance(one, list) or not isinstance(other, list):
        return one == other
    one, other = np.array(one), np.array(other)
    turned = other * [1, 1, 1, -1, -1, -1, -1]
    return any(np.allclose(one, each, rtol=0, atol=1e-9, equal_nan=True) for each in (other, turned))


def in_ns(step: dict) -> dict:
    return {**step, "stamp": round(step["stamp"] * SECOND)} if "stamp" in step else step


@pytest.mark.parametrize("name", SCENARIOS)
def test_answers_are_those_recorded_of_jazzy(name):
    buffer = Buffer(cache_time=Duration(seconds=10))
    for step in SCENARIOS[name]:
        expected = step.get("raises", step.get("pose", step.get("can")))
        if step["do"] == "latest" and "seconds" in step:
            expected = round(step["seconds"] * SECOND)
        found = answer(buffer, in_ns(step))
        assert found is None or same(found, expected), step


def random_scenario(rng: np.random.Generator) -> list[dict]:
    """Steps on a tree that grows, is cut and joined: gaps, late and too old stamps, jumps, invalid ones, questions."""
    frames = [f"f{i}" for i in range(int(rng.integers(2, 8)))]
    static = {frame: rng.random() < 0.25 for frame in frames}
    used, steps, now = set(), [], int(rng.integers(1, 60)) * SECOND
    for _ in range(int(rng.integers(10, 100))):
        now = max(1, now + int(rng.choice([10, 100, 1000, -300, -2000, 8000, 15_000, -15_000], p=P_STEP)) * 1_000_000)
        target, source = (str(frame) for frame in rng.choice(frames, 2))
        kind = rng.choice(["set", "lookup", "can", "latest", "clear", "invalid"], p=[0.5, 0.3, 0.07, 0.1, 0.01, 0.02])
        step = {"do": str(kind), "target": target, "source": source, "stamp": now}
        if kind in ("lookup", "can"):
            step["stamp"] = 0 if rng.random() < 0.1 else max(1, now - int(rng.integers(-50, 400)) * 10_000_000)
            steps.append(step)
        elif kind in ("set", "invalid"):
            # mostly a chain, so that many questions have an answer
            at = int(rng.integers(1, len(frames)))
            child, parent = frames[at], frames[at - 1] if rng.random() < 0.9 else target
            if (child, now) in used:  # which ROS 1 refuses and ROS 2 takes
                continue
            used.add((child, now))
            quaternion = rng.normal(size=4)
            pose = [*rng.uniform(-1, 1, 3).tolist(), *(quaternion / np.linalg.norm(quaternion)).tolist()]
            if kind == "invalid":
                pose, parent, child = [
                    ([0.0] * 7, parent, child),
                    ([float("nan"), *pose[1:]], parent, child),
                    (pose, child, child),
                    (pose, "", child),
                    (pose, parent, ""),
                ][int(rng.integers(5))]
            do = "static" if static.get(child) else "set"
            steps.append({"do": do, "parent": parent, "child": child, "stamp": now, "pose": pose})
        else:
            steps.append(step)
    return steps


P_STEP = [0.35, 0.25, 0.15, 0.1, 0.05, 0.04, 0.03, 0.03]


@pytest.mark.parametrize("trees", [200, pytest.param(4000, marks=pytest.mark.slow)])
def test_answers_are_those_of_the_core_of_python3_tf2(trees):
    """Of ROS 1, which drops old transforms when it stores one, Jazzy before: so each is stored twice here."""
    asked = subprocess.run([SYSTEM_PYTHON, "-c", "import tf2_py, rospy"], capture_output=True)
    if asked.returncode:
        pytest.skip(f"{SYSTEM_PYTHON} has no tf2_py: apt-get install python3-tf2")
    rng = np.random.default_rng(5)
    scenarios = [random_scenario(rng) for _ in range(trees)]
    command = [SYSTEM_PYTHON, FACTS / "ask_python3_tf2.py"]
    told = subprocess.run(command, input=json.dumps(scenarios), capture_output=True, text=True, check=True).stdout
    kinds: dict[str, int] = {}
    for number, (steps, answers) in enumerate(zip(scenarios, json.loads(told), strict=True)):
        buffer = Buffer()
        for i, (step, expected) in enumerate(zip(steps, answers, strict=True)):
            if step["do"] == "set":
                answer(buffer, step)
            found = answer(buffer, step)
            assert same(found, expected), (number, i, step, expected, found)
            kind = expected if isinstance(expected, str) else f"{step['do']} {type(expected).__name__}"
            kinds[kind] = kinds.get(kind, 0) + 1
    refusals = {"LookupException", "ConnectivityException", "ExtrapolationException", "TransformException"}
    assert set(kinds) >= {"lookup list", "latest int", "can bool", *refusals}
    assert min(kinds.values()) > trees // 10, kinds

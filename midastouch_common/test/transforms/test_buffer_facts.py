"""Our buffer against what the real tf2 answered."""

from __future__ import annotations

import contextlib
import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from midastouch_common import se3
from midastouch_common.transforms import (
    DisconnectedError,
    FutureExtrapolationError,
    InvalidTransformError,
    PastExtrapolationError,
    TransformBuffer,
    UnknownFrameError,
)

FACTS = Path(__file__).parent.parent / "facts"
RECORDED = json.loads((FACTS / "tf2_jazzy.json").read_text())
SCENARIOS = RECORDED["scenarios"]
# What we do otherwise than tf2, on purpose.
OURS = {
    "clear": "a frame that was forgotten is not known: it may never come again",
    "time back by more than the history": "time that runs back is a looped bag, not a late message",
    "time back inside the history": "the same",
    "older than the history": "the same",
    "a little more than ten seconds": "tf2 forgets only with the transform after next",
    "another pose at the newest stamp": "one stamp, one pose: the first",
    "another pose at the oldest stamp": "the same",
    "another parent": "a new history, in which no stamp has two parents",
    "a loop": "refused, so that the tree stays usable",
    "slashes": "names of ROS 1 are understood in look-ups, too",
    "no frame": "no such frame is known",
    "what is no transform": "a quaternion far from unit length is a mistake of its publisher",
    "an infinite position": "not finite",
}


@pytest.fixture
def buffer():
    return TransformBuffer()


def expected_error(step: dict, samples: list[float]) -> type[Exception]:
    """Our name for an exception of tf2; `samples`: seconds of all transforms before."""
    if step["raises"] == "ExtrapolationException":
        future = "future" in step["words"] or ("only time" in step["words"] and step["stamp"] > max(samples))
        return FutureExtrapolationError if future else PastExtrapolationError
    return {"LookupException": UnknownFrameError, "ConnectivityException": DisconnectedError}[step["raises"]]


@pytest.mark.parametrize("name", [name for name in SCENARIOS if name not in OURS and "epoch" not in name])
def test_the_buffer_answers_as_tf2(buffer, name):
    samples = []
    for step in SCENARIOS[name]:
        if step["do"] in ("set", "static"):
            samples.append(step["stamp"])
            stamp = round(step["stamp"] * 1e9)
            buffer.insert(step["parent"], step["child"], stamp, step["pose"], static=step["do"] == "static")
        elif step["do"] == "clear":
            buffer.clear()
        elif step["do"] == "lookup" and step["stamp"]:  # 0 means the newest, to tf2 only
            asked = step["target"], step["source"], round(step["stamp"] * 1e9)
            if "raises" in step:
                with pytest.raises(expected_error(step, samples)):
                    buffer.lookup(*asked)
            else:
                pose = np.array(step["pose"])
                expected = se3.make(Rotation.from_quat(pose[3:]).as_matrix(), pose[:3])
                np.testing.assert_allclose(buffer.lookup(*asked), expected, atol=1e-9)


def replayed(buffer, name: str) -> None:
    """Put the transforms of a scenario into a buffer."""
    for step in SCENARIOS[name]:
        if step["do"] in ("set", "static"):
            with contextlib.suppress(InvalidTransformError):
                buffer.insert(step["parent"], step["child"], round(step["stamp"] * 1e9), step["pose"])


@pytest.mark.parametrize("name", [name for name in OURS if name.startswith("time back")])
def test_time_that_runs_back_begins_anew(buffer, name):
    replayed(buffer, name)
    last = [step for step in SCENARIOS[name] if step["do"] == "set"][-1]
    np.testing.assert_allclose(buffer.lookup("base", "gel", round(last["stamp"] * 1e9))[0, 3], last["pose"][0])
    with pytest.raises(FutureExtrapolationError):
        buffer.lookup("base", "gel", 11_000_000_000)


@pytest.mark.parametrize(("name", "stamp"), [("another pose at the newest stamp", 11), ("the same once more", 11)])
def test_the_first_pose_at_a_stamp_counts(buffer, name, stamp):
    replayed(buffer, name)
    assert buffer.lookup("base", "gel", stamp * 1_000_000_000)[0, 3] == pytest.approx(0.3)


def test_another_parent_begins_anew(buffer):
    replayed(buffer, "another parent")
    assert buffer.lookup("tool", "gel", 12_000_000_000)[0, 3] == pytest.approx(0.5)
    with pytest.raises(PastExtrapolationError):
        buffer.lookup("tool", "gel", 10_500_000_000)
    with pytest.raises(UnknownFrameError):
        buffer.lookup("base", "gel", 10_500_000_000)


def test_what_is_no_transform_leaves_no_trace(buffer):
    for name in ("what is no transform", "an infinite position"):
        replayed(buffer, name)
    with pytest.raises(UnknownFrameError):
        buffer.lookup("base", "gel", 10_000_000_000)


def test_no_stamp_is_taken_for_the_newest(buffer):
    """To tf2, 0 means the newest transform, and a negative time is an error of its own."""
    replayed(buffer, "inside the history")
    for stamp in (0, -1_000_000_000):
        with pytest.raises(PastExtrapolationError):
            buffer.lookup("base", "gel", stamp)


@pytest.mark.parametrize("names", [("", "gel"), ("base", ""), ("base", "/"), ("ba\0se", "gel"), ("base", "g\0el")])
def test_no_name_of_a_frame_is_fatal(buffer, names):
    replayed(buffer, "inside the history")
    with pytest.raises(UnknownFrameError):
        buffer.lookup(*names, 10_000_000_000)


def test_names_may_begin_with_a_slash(buffer):
    replayed(buffer, "slashes")
    assert buffer.lookup("/base", "/gel", 10_000_000_000)[0, 3] == pytest.approx(0.1)

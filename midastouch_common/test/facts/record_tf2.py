"""What tf2 answers: asks an installed tf2_py and writes tf2_jazzy.json beside this file.

    source /opt/ros/jazzy/setup.bash && python3 midastouch_common/test/facts/record_tf2.py VERSION

A scenario is a list of steps on one buffer of 10 s. `set` and `static` are transforms, seconds and [x y z qx qy qz qw];
`clear` forgets; what is asked holds the answer: `lookup` a pose or an exception's class and words, `can` true or false,
`latest` seconds or an exception.
"""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path

FILE = Path(__file__).with_name("tf2_jazzy.json")
SECOND = 1_000_000_000


def at(x: float, yaw: float = 0.0, sign: int = 1) -> list[float]:
    """A pose at x, turned by yaw [rad] about z; sign -1: the other quaternion of the same rotation."""
    return [x, 0.0, 0.0, 0.0, 0.0, sign * math.sin(yaw / 2), sign * math.cos(yaw / 2)]


def put(stamp: float, pose: list[float], parent: str = "base", child: str = "gel", static: bool = False) -> dict:
    return {"do": "static" if static else "set", "parent": parent, "child": child, "stamp": stamp, "pose": pose}


def ask(stamp: float, target: str = "base", source: str = "gel", do: str = "lookup") -> dict:
    return {"do": do, "target": target, "source": source, "stamp": stamp}


def latest(target: str = "base", source: str = "gel") -> dict:
    return {"do": "latest", "target": target, "source": source}


CLEAR = {"do": "clear"}
TWO = [put(10, at(0.1)), put(11, at(0.3, 0.4))]

SCENARIOS = {
    "nothing is known": [ask(10), ask(0), latest(), ask(10, do="can")],
    "an unknown frame": [*TWO, ask(10.5, source="cup"), ask(10.5, target="cup"), latest(source="cup")],
    "two trees": [*TWO, put(10, at(0.5), "map", "camera"), ask(10, source="camera"), latest(source="camera")],
    "a frame in itself": [ask(10, "gel", "gel"), *TWO, ask(99, "gel", "gel"), ask(99, "base", "base")],
    "one sample": [put(10, at(0.1)), ask(10), ask(9.5), ask(10.5), ask(0), latest()],
    "inside the history": [*TWO, ask(10), ask(10.25), ask(10.5), ask(11), latest()],
    "upwards": [*TWO, ask(10.25, "gel", "base")],
    "before and after the history": [*TWO, ask(9.999), ask(11.001), ask(11.001, do="can")],
    "the newest": [*TWO, ask(0)],
    "the other sign of a quaternion": [put(10, at(0.1, 0.2)), put(11, at(0.1, 1.0, -1)), ask(10.5)],
    "half a turn and more": [put(10, at(0, 0.1)), put(11, at(0, 5.5)), ask(10.5)],
    "hardly turned": [put(10, at(0, 0.3)), put(11, at(0, 0.3 + 1e-9)), ask(10.5)],
    "a chain": [
        *TWO,
        put(10, at(0, 0.5), "gel", "tip"),
        put(10.8, at(0.2, 1.0), "gel", "tip"),
        put(0, [0, 0.1, 0, 0, 0.6, 0, 0.8], "base", "camera", static=True),
        ask(10.4, source="tip"),
        ask(10.4, "tip", "camera"),
        ask(0, source="tip"),
        ask(10.9, source="tip"),
        latest(source="tip"),
    ],
    "links that never overlap": [
        *TWO,
        put(20, at(0), "gel", "tip"),
        put(21, at(0), "gel", "tip"),
        ask(15, source="tip"),
        ask(0, source="tip"),
        latest(source="tip"),
    ],
    "static": [put(5, at(0.7), static=True), ask(1), ask(5), ask(1000), ask(0), latest()],
    "static again": [put(5, at(0.7), static=True), put(4, at(0.8), static=True), ask(1)],
    "moving, then static": [*TWO, put(10, at(0.7), static=True), ask(10.5), ask(50)],
    "static, then moving": [put(5, at(0.7), static=True), *TWO, ask(9), ask(10.5)],
    "clear": [
        *TWO,
        put(0, at(0.7), "gel", "tip", static=True),
        CLEAR,
        ask(10.5),
        ask(0),
        latest(),
        ask(9, "gel", "tip"),
    ],
    "clear, then later": [*TWO, CLEAR, put(1, at(0.2)), put(2, at(0.4)), ask(1.5), ask(10.5)],
    "time back by more than the history": [*TWO, put(0.5, at(0.2)), ask(0.5), ask(10.5), latest()],
    "time back inside the history": [*TWO, put(5, at(0.2)), ask(5), ask(7.5), latest()],
    "forget one frame by making it static": [
        *TWO,
        put(10, at(0.7), "base", "camera"),
        put(5, at(0.2), static=True),
        put(5, at(0.2)),
        put(6, at(0.4)),
        ask(5.5),
        ask(10.5),
        ask(10, source="camera"),
    ],
    "late": [put(10, at(0.1)), put(12, at(0.5)), put(11, at(0.9)), ask(10.5), ask(11), ask(11.5)],
    "older than the history": [put(20, at(0.1)), put(9.9, at(0.5)), ask(9.9), ask(20)],
    "ten seconds": [put(9.5, at(0)), put(10, at(0.1)), put(15, at(0.2)), put(20, at(0.3)), ask(10), ask(12.5)],
    "a little more than ten seconds": [put(9.5, at(0)), put(10, at(0.1)), put(20, at(0.3)), ask(9.5)],
    "pruned": [*(put(stamp, at(0.1 * i)) for i, stamp in enumerate((9, 10, 20, 21, 22))), ask(9.5), ask(20)],
    "the same once more": [*TWO, TWO[1], TWO[0], ask(10), ask(10.5), ask(11)],
    "another pose at the newest stamp": [*TWO, put(11, at(0.9)), ask(11), ask(10.5)],
    "another pose at the oldest stamp": [*TWO, put(10, at(0.9)), ask(10), ask(10.5)],
    "another parent": [*TWO, put(12, at(0.5), "tool", "gel"), ask(10.5), ask(12, "tool"), ask(0, "tool"), ask(11.5)],
    "a loop": [put(10, at(0)), put(10, at(0), "gel", "base"), put(10, at(0), "x", "y"), ask(10), ask(10, "x", "gel")],
    "slashes": [put(10, at(0.1), "/base", "/gel"), ask(10), ask(10, "/base", "gel"), ask(10, "base", "/gel")],
    "no frame": [*TWO, ask(10, ""), ask(10, source=""), ask(10, "ba\0se")],
    "what is no transform": [
        put(10, [math.nan, 0, 0, 0, 0, 0, 1]),
        put(10, [0, 0, 0, 0, 0, 0, 0]),
        put(10, [0, 0, 0, 0, 0, 0, 1.1]),
        put(10, at(0), "gel", "gel"),
        put(10, at(0), "", "gel"),
        put(10, at(0), "base", ""),
        ask(10),
    ],
    "an almost unit quaternion": [put(10, [0, 0, 0, 0, 0, 0.6, 0.801]), ask(10)],
    "an infinite position": [put(10, [math.inf, 0, 0, 0, 0, 0, 1]), ask(10)],
    "before the epoch": [put(-2, at(0.1)), put(-1, at(0.2)), ask(-1.5), ask(-3), latest()],
    "at the epoch": [put(0, at(0.1)), put(1, at(0.2)), ask(0), ask(0.5), latest()],
}


def message(step: dict):
    """A step's transform as TransformStamped."""
    from geometry_msgs.msg import TransformStamped

    out = TransformStamped(child_frame_id=step["child"])
    nanoseconds = round(step["stamp"] * SECOND)
    out.header.stamp.sec, out.header.stamp.nanosec = nanoseconds // SECOND, nanoseconds % SECOND
    out.header.frame_id = step["parent"]
    p, q = out.transform.translation, out.transform.rotation
    p.x, p.y, p.z, q.x, q.y, q.z, q.w = map(float, step["pose"])
    return out


def answer(core, step: dict) -> dict:
    """What a BufferCore says to a step; empty for one that asks nothing."""
    from rclpy.time import Time

    try:
        if step["do"] == "set":
            core.set_transform(message(step), "facts")
        elif step["do"] == "static":
            core.set_transform_static(message(step), "facts")
        elif step["do"] == "clear":
            core.clear()
        elif step["do"] == "latest":
            return {"seconds": core.get_latest_common_time(step["target"], step["source"]).nanoseconds / SECOND}
        else:
            frames, time = (step["target"], step["source"]), Time(nanoseconds=round(step["stamp"] * SECOND))
            if step["do"] == "can":
                return {"can": bool(core.can_transform_core(*frames, time)[0])}
            found = core.lookup_transform_core(*frames, time).transform
            p, q = found.translation, found.rotation
            return {"pose": [p.x, p.y, p.z, q.x, q.y, q.z, q.w]}
    except Exception as error:
        return {"raises": type(error).__name__, "words": str(error)}
    return {}


def main() -> None:
    import tf2_py
    from rclpy.duration import Duration

    bases = {name: getattr(tf2_py, name).__base__.__name__ for name in dir(tf2_py) if name.endswith("Exception")}
    scenarios = {}
    for name, steps in SCENARIOS.items():
        core = tf2_py.BufferCore(Duration(seconds=10))
        scenarios[name] = [{**step, **answer(core, step)} for step in steps]
    lines = [
        f"  {json.dumps(name)}: [\n    " + ",\n    ".join(map(json.dumps, steps)) + "\n  ]"
        for name, steps in scenarios.items()
    ]
    head = f'"of": {json.dumps(sys.argv[1])},\n"exceptions": {json.dumps(bases)},\n'
    FILE.write_text("{\n" + head + '"scenarios": {\n' + ",\n".join(lines) + "\n}\n}\n")


if __name__ == "__main__":
    main()

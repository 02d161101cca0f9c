"""What tf2 answers: asks an installed tf2_py the steps of tf2_jazzy.json beside this file and writes its answers there.

    source /opt/ros/jazzy/setup.bash && python3 midastouch_common/test/facts/record_tf2.py VERSION

A scenario is a list of steps on one buffer of 10 s. `set` and `static` are transforms, seconds and [x y z qx qy qz qw];
`clear` forgets; what is asked holds the answer: `lookup` a pose or an exception's class and words, `can` true or false,
`latest` seconds or an exception. Add further ones without answers.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

FILE = Path(__file__).with_name("tf2_jazzy.json")
SECOND = 1_000_000_000


def asked(step: dict) -> dict:
    """A step without its answer."""
    kept = {"do", "parent", "child", "target", "source", "stamp"} | ({"pose"} if "parent" in step else set())
    return {key: value for key, value in step.items() if key in kept}


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
    scenarios = json.loads(FILE.read_text())["scenarios"]
    for name, steps in scenarios.items():
        core = tf2_py.BufferCore(Duration(seconds=10))
        scenarios[name] = [{**step, **answer(core, step)} for step in map(asked, steps)]
    lines = [
        f"  {json.dumps(name)}: [\n    " + ",\n    ".join(map(json.dumps, steps)) + "\n  ]"
        for name, steps in scenarios.items()
    ]
    head = f'"of": {json.dumps(sys.argv[1])},\n"exceptions": {json.dumps(bases)},\n'
    FILE.write_text("{\n" + head + '"scenarios": {\n' + ",\n".join(lines) + "\n}\n}\n")


if __name__ == "__main__":
    main()

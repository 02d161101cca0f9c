"""What tf2's own C++ core answers: asks the tf2_py of Debian's python3-tf2, of ROS 1 and for the system's Python.

    /usr/bin/python3 ask_python3_tf2.py < scenarios > answers

Scenarios are lists of steps as in record_tf2.py, with stamps in ns; answers are lists of what each step gave, or None.
"""

import json
import sys

import tf2_py
from geometry_msgs.msg import TransformStamped
from rospy import Duration, Time


def answer(core, step):
    try:
        if step["do"] == "clear":
            core.clear()
        elif step["do"] in ("set", "static"):
            out = TransformStamped(child_frame_id=step["child"])
            out.header.stamp, out.header.frame_id = Time(0, step["stamp"]), step["parent"]
            p, q = out.transform.translation, out.transform.rotation
            p.x, p.y, p.z, q.x, q.y, q.z, q.w = step["pose"]
            (core.set_transform_static if step["do"] == "static" else core.set_transform)(out, "facts")
        elif step["do"] == "latest":
            return core.get_latest_common_time(step["target"], step["source"]).to_nsec()
        else:
            asked = step["target"], step["source"], Time(0, step["stamp"])
            if step["do"] == "can":
                return bool(core.can_transform_core(*asked)[0])
            found = core.lookup_transform_core(*asked).transform
            p, q = found.translation, found.rotation
            return [p.x, p.y, p.z, q.x, q.y, q.z, q.w]
    except tf2_py.TransformException as error:
        return type(error).__name__
    return None


answers = []
for steps in json.load(sys.stdin):
    core = tf2_py.BufferCore(Duration(10))
    answers.append([answer(core, step) for step in steps])
json.dump(answers, sys.stdout)

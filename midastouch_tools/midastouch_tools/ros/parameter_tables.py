"""docs/parameters.md from the tables that the nodes declare.

python -m midastouch_tools.ros.parameter_tables > docs/parameters.md
"""

from __future__ import annotations

from digit_driver.nodes.parameters import PARAMETERS as DIGIT_DRIVER
from midastouch_filter.nodes.detection_prior import PARAMETERS as DETECTION_PRIOR
from midastouch_filter.nodes.filter_parameters import PARAMETERS as PARTICLE_FILTER
from midastouch_motion.nodes.contact_controller_parameters import PARAMETERS as CONTACT_CONTROLLER
from midastouch_motion.nodes.explorer_parameters import PARAMETERS as EXPLORER
from midastouch_motion.nodes.mount_tf import PARAMETERS as MOUNT_TF
from midastouch_motion.nodes.ur_speed import PARAMETERS as UR_SPEED
from midastouch_motion.nodes.ur_tf import PARAMETERS as UR_TF
from midastouch_perception.nodes.calibrate import PARAMETERS as CALIBRATE
from midastouch_perception.nodes.tcn import PARAMETERS as TCN
from midastouch_perception.nodes.tdn import PARAMETERS as TDN
from midastouch_simulation.nodes.digit_sim import PARAMETERS as DIGIT_SIM
from midastouch_simulation.nodes.mujoco_arm import PARAMETERS as MUJOCO_ARM
from midastouch_simulation.nodes.simulated_finger import PARAMETERS as SIMULATED_FINGER
from midastouch_simulation.nodes.simulated_gripper import PARAMETERS as SIMULATED_GRIPPER

from ..nodes.recorder import PARAMETERS as RECORDER
from ..nodes.replay import PARAMETERS as REPLAY
from ..nodes.view import PARAMETERS as VIEW

TABLES = {
    "digit_driver": DIGIT_DRIVER,
    "digit_sim": DIGIT_SIM,
    "tdn": TDN,
    "tcn": TCN,
    "particle_filter": PARTICLE_FILTER,
    "explorer": EXPLORER,
    "simulated_finger": SIMULATED_FINGER,
    "simulated_gripper": SIMULATED_GRIPPER,
    "contact_controller": CONTACT_CONTROLLER,
    "mujoco_arm": MUJOCO_ARM,
    "ur_speed": UR_SPEED,
    "replay": REPLAY,
    "recorder": RECORDER,
    "ur_tf": UR_TF,
    "mount_tf": MOUNT_TF,
    "detection_prior": DETECTION_PRIOR,
    "calibrate": CALIBRATE,
    "view": VIEW,
}

_HEADER = """# Parameters

Written by `python -m midastouch_tools.ros.parameter_tables` from what the nodes declare; a test compares.
Types follow from the defaults. An illegal value or a misspelt name ends the node at its start with a message
that says so. Parameters marked *run time* may be changed while the node runs; the others of the lifecycle nodes
`digit_driver`, `digit_sim`, `tdn`, `tcn`, `particle_filter`, `contact_controller` and `ur_speed`, but for
`queue_depth`, `reliable`, `rate`, `autostart`, `diagnostics_period` and `preset`, while the node is unconfigured.

The QoS of each topic is a parameter, too, at start: `qos_overrides.TOPIC.publisher.POLICY` or
`qos_overrides.TOPIC.subscription.POLICY` with the topic's full name and `history`, `depth` or `reliability`.
"""


def markdown() -> str:
    """Return one table per node: name, default, range or choices, description."""
    sections = [_HEADER]
    for node, table in TABLES.items():
        rows = [f"| `{p.name}` | `{_text(p.default)}` | {_range(p)} | {_description(p)} |" for p in table]
        sections.append(f"## {node}\n\n| name | default | range | meaning |\n| --- | --- | --- | --- |\n")
        sections[-1] += "\n".join(rows) + "\n"
    return "\n".join(sections)


def _text(value) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:.6g}" if value != int(value) else f"{value:.1f}"
    if isinstance(value, list):
        return f"[{', '.join(map(_text, value))}]"
    return str(value) if value != "" else '""'


def _range(parameter) -> str:
    if parameter.choices:
        return ", ".join(f"`{_text(choice)}`" for choice in parameter.choices)
    low, high = parameter.minimum, parameter.maximum
    if low is None and high is None:
        return ""
    return f"{'' if low is None else f'{low:.6g}'} ... {'' if high is None else f'{high:.6g}'}".strip()


def _description(parameter) -> str:
    text = f"{parameter.description} [{parameter.unit}]" if parameter.unit else parameter.description
    return text if parameter.read_only else f"{text}, *run time*"


if __name__ == "__main__":
    print(markdown(), end="")

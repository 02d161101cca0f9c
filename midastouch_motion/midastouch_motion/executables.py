"""The executables of this package."""

from midastouch_common.executables import executable

mujoco_arm = executable("midastouch_motion.nodes.mujoco_arm")
slider = executable("midastouch_motion.nodes.slider")
twist_arm = executable("midastouch_motion.nodes.twist_arm")

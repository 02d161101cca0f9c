"""The executables of this package."""

from midastouch_common.executables import executable

mujoco_arm = executable("midastouch_motion.nodes.mujoco_arm")
slider = executable("midastouch_motion.nodes.slider")
ur_speed = executable("midastouch_motion.nodes.ur_speed")

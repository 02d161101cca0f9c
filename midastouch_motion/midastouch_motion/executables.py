"""The executables of this package."""

from midastouch_common.executables import executable

slider = executable("midastouch_motion.nodes.slider")
twist_arm = executable("midastouch_motion.nodes.twist_arm")
ur_speed = executable("midastouch_motion.nodes.ur_speed")

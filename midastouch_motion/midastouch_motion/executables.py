"""The executables of this package."""

from midastouch_common.executables import executable

explorer = executable("midastouch_motion.nodes.explorer")
mount_tf = executable("midastouch_motion.nodes.mount_tf")
slider = executable("midastouch_motion.nodes.slider")
ur_speed = executable("midastouch_motion.nodes.ur_speed")
ur_tf = executable("midastouch_motion.nodes.ur_tf")

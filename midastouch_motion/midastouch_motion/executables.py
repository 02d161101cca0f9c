"""The executables of this package."""

from midastouch_common.executables import executable

explorer = executable("midastouch_motion.nodes.explorer")
mount_tf = executable("midastouch_motion.nodes.mount_tf")
contact_controller = executable("midastouch_motion.nodes.contact_controller")
ur_speed = executable("midastouch_motion.nodes.ur_speed")
ur_tf = executable("midastouch_motion.nodes.ur_tf")

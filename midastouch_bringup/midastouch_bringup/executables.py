"""The executables of this package that are nodes."""

from midastouch_common.executables import executable

all_in_one = executable("midastouch_bringup.nodes.all_in_one")
detection_prior = executable("midastouch_bringup.nodes.detection_prior")
digit_sim = executable("midastouch_bringup.nodes.digit_sim")
explorer = executable("midastouch_bringup.nodes.explorer")
finger = executable("midastouch_bringup.nodes.finger")
mount_tf = executable("midastouch_bringup.nodes.mount_tf")
recorder = executable("midastouch_bringup.nodes.recorder")
replay = executable("midastouch_bringup.nodes.replay")
ur_tf = executable("midastouch_bringup.nodes.ur_tf")

"""The executables of this package."""

from midastouch_common.executables import executable

digit_sim = executable("midastouch_simulation.nodes.digit_sim")
finger = executable("midastouch_simulation.nodes.finger")
mujoco_arm = executable("midastouch_simulation.nodes.mujoco_arm")

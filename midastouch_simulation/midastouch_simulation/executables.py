"""The executables of this package."""

from midastouch_common.executables import executable

digit_sim = executable("midastouch_simulation.nodes.digit_sim")
simulated_finger = executable("midastouch_simulation.nodes.simulated_finger")
mujoco_arm = executable("midastouch_simulation.nodes.mujoco_arm")
simulated_gripper = executable("midastouch_simulation.nodes.simulated_gripper")

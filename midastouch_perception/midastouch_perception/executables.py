"""The executables of this package."""

from digit_driver.executables import executable

tdn = executable("midastouch_perception.nodes.tdn")
tcn = executable("midastouch_perception.nodes.tcn")
calibrate = executable("midastouch_perception.nodes.calibrate")

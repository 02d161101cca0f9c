"""Executables of this package."""

from midastouch_common.executables import executable

tdn = executable("midastouch_perception.nodes.tdn")
tcn = executable("midastouch_perception.nodes.tcn")
calibrate = executable("midastouch_perception.nodes.calibrate")

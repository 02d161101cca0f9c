"""The executables of this package."""

from midastouch_common.executables import executable

recorder = executable("midastouch_tools.nodes.recorder")
replay = executable("midastouch_tools.nodes.replay")

"""The executables of this package."""

from midastouch_common.executables import executable

all_in_one = executable("midastouch_bringup.nodes.all_in_one")

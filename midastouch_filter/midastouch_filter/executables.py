"""The executables of this package."""

from midastouch_common.executables import executable

particle_filter = executable("midastouch_filter.nodes.particle_filter")

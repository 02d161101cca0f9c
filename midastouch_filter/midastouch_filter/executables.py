"""The executables of this package."""

from midastouch_common.executables import executable

detection_prior = executable("midastouch_filter.nodes.detection_prior")
particle_filter = executable("midastouch_filter.nodes.particle_filter")

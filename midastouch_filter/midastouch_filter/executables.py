"""The executables of this package."""

from digit_driver.executables import executable

particle_filter = executable("midastouch_filter.nodes.particle_filter")

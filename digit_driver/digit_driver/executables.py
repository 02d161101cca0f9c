"""The executable of this package."""

from midastouch_common.executables import executable

digit_driver = executable("digit_driver.nodes.digit_driver")

"""The sub-commands of `midastouch` that measure, one module each, as those of `midastouch_bringup.commands`."""

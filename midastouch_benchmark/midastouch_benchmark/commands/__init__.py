"""The sub-commands of `midastouch` that measure, one module each, like those of `midastouch_tools.commands`."""

"""The executables of this package."""

import signal

from midastouch_common.executables import executable

recorder = executable("midastouch_tools.nodes.recorder")
replay = executable("midastouch_tools.nodes.replay")


def midastouch() -> int:
    """Run the command `midastouch`; Ctrl-C while its modules are imported ends it as later, without a traceback."""
    try:
        from .cli import main

        return main()
    except KeyboardInterrupt:
        return 128 + signal.SIGINT

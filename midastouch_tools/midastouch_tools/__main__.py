"""The program `midastouch`: Ctrl-C while its modules are imported ends it as later, without a traceback."""

import signal
import sys


def main() -> int:
    """Run the command; returns the exit status."""
    try:
        from .cli import main

        return main()
    except KeyboardInterrupt:
        return 128 + signal.SIGINT


if __name__ == "__main__":
    sys.exit(main())

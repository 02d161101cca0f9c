"""Run a command while every core is kept busy: `tools/load.py make test-all`. Its exit code is the command's.

Runs on the standard library of any Python 3.
"""

import os
import subprocess
import sys


def keep_busy(parent):
    """Compute until the parent is gone, however it ended."""
    while os.getppid() == parent:
        sum(range(100_000))


def main(command):
    """Run the command while one process per core computes."""
    if not command:
        sys.exit("usage: tools/load.py COMMAND [ARGUMENT...]")
    parent = os.getpid()
    for _ in os.sched_getaffinity(0):
        if os.fork() == 0:
            try:
                keep_busy(parent)
            finally:
                os._exit(0)
    return subprocess.call(command)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

"""Events of processes."""

from typing import NamedTuple


class ProcessExited(NamedTuple):
    """A process has ended. returncode: -N after signal N."""

    process_name: str
    pid: int
    returncode: int

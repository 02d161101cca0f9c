"""Count the functions of our packages that `midastouch ARGS` enters before its work starts.

.venv/bin/python tests/stays.py run replay bag:=out/slide object:=handle_tool

Each counts once, in the order of the first call, until the function of `WORK` is called; then the command is ended.
Not counted: lambdas, comprehensions, generated methods, what an import calls, and what `build_parser` calls, as that
adds the options of every other command, too.
"""

from __future__ import annotations

import inspect
import sys
from types import CodeType, FrameType

WORK = {
    "run": "launch.service:run",
    "benchmark": "midastouch_benchmark.trials.campaign:run_campaign",
    "evaluate": "midastouch_benchmark.trials.sequence_trials:run_sequence",
}
"""Function with which the work starts, by command: the launch, the trials, the first sequence."""
OURS = ("midastouch_", "digit_driver.")


class Reached(BaseException):
    """The work would start now."""


def stays(arguments: list[str]) -> list[str]:
    """Return the functions, each as `module:name`. RuntimeError if the command ends before its work starts."""
    from midastouch_tools.cli import main

    entered: dict[CodeType, str] = {}
    skipped: list[FrameType] = []

    def watch(frame: FrameType, event: str, _argument: object) -> None:
        if skipped and event == "return" and frame is skipped[0]:
            skipped.clear()
        if skipped or event != "call":
            return
        code = frame.f_code
        name = f"{frame.f_globals.get('__name__')}:{code.co_name}"
        if name == WORK[arguments[0]]:
            raise Reached
        if (
            name.startswith(OURS)
            and code.co_flags & inspect.CO_OPTIMIZED
            and "<" not in code.co_name + code.co_filename
        ):
            entered[code] = name
        if code.co_name in ("<module>", "build_parser"):
            skipped.append(frame)

    sys.setprofile(watch)
    try:
        code = main(arguments)
    except Reached:
        return list(entered.values())
    finally:
        sys.setprofile(None)
    raise RuntimeError(f"ended with code {code} before {WORK[arguments[0]]}")


if __name__ == "__main__":
    found = stays(sys.argv[1:])
    print("\n".join([*found, f"{len(found)} functions"]))

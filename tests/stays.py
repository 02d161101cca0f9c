"""Count the functions of our packages that a reader meets from `midastouch ARGS` to where its work starts.

.venv/bin/python tests/stays.py run replay bag:=out/slide object:=handle_tool

These are the functions that wait for their call to return when that of `WORK` is called, printed with an arrow, and
those that they have called before: to read arguments, choose what comes next or load an input. Each counts once. What
the latter call in turn does not count: it has returned, and the work can be found without reading it. The command is
ended where the work would start. Not counted: lambdas, comprehensions, generated methods, and what an import calls.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Iterator
from types import CodeType, FrameType

WORK = {
    "run": "launch.service:run",
    "benchmark": "midastouch_benchmark.trials.campaign:run",
    "evaluate": "midastouch_benchmark.trials.sequence_trials:run_sequence",
}
"""Function with which the work starts, by command: the launch, the trials, the first sequence."""
OURS = ("midastouch_", "digit_driver.")


class Reached(BaseException):
    """The work would start now."""


def stays(arguments: list[str]) -> dict[str, bool]:
    """Return the functions, each as `module:name`, in the order of their first calls, and whether each waits for the
    work. RuntimeError if the command ends before its work starts."""
    from midastouch_tools.cli import main

    callers: dict[CodeType, set[CodeType | None]] = {}
    names: dict[CodeType, str] = {}
    waiting: set[CodeType] = set()
    imports: list[FrameType] = []

    def watch(frame: FrameType, event: str, _argument: object) -> None:
        if imports and event == "return" and frame is imports[0]:
            imports.clear()
        if imports or event != "call":
            return
        if _name(frame) == WORK[arguments[0]]:
            waiting.update(each.f_code for each in _ours_above(frame))
            raise Reached
        if frame.f_code.co_name == "<module>":
            imports.append(frame)
        elif _is_ours(frame):
            names[frame.f_code] = _name(frame)
            caller = next(_ours_above(frame), None)
            callers.setdefault(frame.f_code, set()).add(caller and caller.f_code)

    sys.setprofile(watch)
    try:
        status = main(arguments)
    except Reached:
        return {name: code in waiting for code, name in names.items() if code in waiting or callers[code] & waiting}
    finally:
        sys.setprofile(None)
    raise RuntimeError(f"ended with status {status} before {WORK[arguments[0]]}")


def _ours_above(frame: FrameType) -> Iterator[FrameType]:
    """Yield the calls of our functions that wait for this one to return, the last first."""
    while (frame := frame.f_back) is not None:
        if _is_ours(frame):
            yield frame


def _is_ours(frame: FrameType) -> bool:
    code = frame.f_code
    named = code.co_flags & inspect.CO_OPTIMIZED and "<" not in code.co_name + code.co_filename
    return bool(named) and _name(frame).startswith(OURS)


def _name(frame: FrameType) -> str:
    return f"{frame.f_globals.get('__name__')}:{frame.f_code.co_name}"


if __name__ == "__main__":
    found = stays(sys.argv[1:])
    print("\n".join(f"{'->' if waits else '  '} {name}" for name, waits in found.items()))
    print(len(found), "functions,", sum(found.values()), "of them on the way")

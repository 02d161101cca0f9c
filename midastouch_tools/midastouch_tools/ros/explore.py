"""`midastouch run explore`: the nodes as processes, a recording of the run, keys for a person, and a page."""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from rclpy.executors import SingleThreadedExecutor

from midastouch_common.errors import InputError
from midastouch_common.files import atomic_path
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.codebook import Codebook

from ..bags.messages import IMAGE_TOPIC, TF_TOPIC, Topic
from ..bags.run_record import MODES, OBJECTS, PARTICLES, NoResults, read_run
from ..demo.preparation import explored, prepare_codebooks, quick_codebooks
from ..exploration_result import ending, exploration_result, result_rows, write_page, write_words
from ..processes.foreground import Wait, await_ends, woken_by_signals
from ..processes.process import Process, Program
from ..processes.supervisor import NodeFailed
from ..progress import close_bars
from ..replay.keyboard import Keyboard
from ..result_file import read_json, write_json
from ..text_table import text_table
from .exploration_console import Console, file_of, keys_help
from .recorded_run import RESULTS, await_recorder, hear_the_last, recorder_of_run, supervised_run

_LAST_WORDS_S = 2.0  # for messages of the explorer that are on their way when it has ended
_AFTER_A_TOUCH = (MODES, PARTICLES)  # before the first one, the filter of several objects has no pose to publish
RECORDING = "run.mcap"


def run_exploration(programs: Sequence[Program], given: Mapping[str, str], out: Path, domain: int) -> int:
    """Let the finger explore until it is over or a person ends it, then draw; returns the exit status.

    programs: the nodes, including `explorer`, which is held back until the recorder hears all; given: the arguments of
    explore.launch.py. domain: ROS_DOMAIN_ID, on this machine alone. The status is 0 if object and pose are known and
    right, or if a person ended it, by key or signal; otherwise 1. Raises KeyboardInterrupt for a further signal while
    the nodes end; one after that leaves out what is not finished.
    """
    what = explored(given)
    touched, objects = file_of(what["mesh"]), what["objects"]
    bag, started = out / RECORDING, time.monotonic()
    unknown = f", for the filter one of {len(objects.split(','))} objects" if objects else ""
    finger = given["arm"] == "finger"
    print(f"{'a simulated finger' if finger else 'an arm in MuJoCo'} explores '{Path(touched).stem}'{unknown}")
    print(f"live in a browser, from another terminal: ROS_DOMAIN_ID={domain} midastouch view", flush=True)
    # Ctrl-C is one more key that ends the exploration
    with woken_by_signals() as wait, atomic_path(bag) as temporary:
        console = _explore(programs, touched, not objects, finger, temporary, out / "log", domain, wait)
        if wait(0.0):
            raise KeyboardInterrupt
    seconds = time.monotonic() - started
    try:
        result = _conclude(console, what, bag, out, seconds)
    except KeyboardInterrupt:  # the run is over, and what it found so far is kept
        close_bars()
        found = out / "result.json"
        if not found.is_file():
            write_json(found, ending(console.ended, Path(console.mesh).stem, seconds))
        result = read_json(found)
        write_words(result, "the reading of the recording, or the drawing, was interrupted", out)
        print("interrupted: the recording is kept, the page has no pictures", flush=True)
    return 0 if result["right"] or console.ended["by_hand"] else 1


def _conclude(console: Console, what: Mapping[str, str], bag: Path, out: Path, seconds: float) -> dict:
    """Read the recording and write result and page; return the result. what: as of `explored`."""
    touched, codebook = file_of(what["mesh"]), what["codebook"]
    print(f"\nreading the recording, {bag.stat().st_size / 1e6:.0f} MB", flush=True)
    changed = console.mesh != touched  # by key: the earlier part is about another object
    try:
        if changed and console.since_change_ns is None:
            raise NoResults
        record = read_run(bag)
    except InputError as error:
        early = "the run ended before the filter had an answer" + " about the new object" * changed
        why = early if isinstance(error, NoResults) else str(error)
        result = ending(console.ended, Path(console.mesh).stem, seconds)
        _tell(result, out)
        write_words(result, why, out)
        print(f"nothing to draw: {why}", flush=True)
        return result
    if changed:
        record = record.since_change(1e-9 * console.since_change_ns)
        new = {"mesh": console.mesh, "codebook": "", "objects": ""}
        prepare_codebooks(quick_codebooks(new))
        touched, codebook = console.mesh, explored(new)["codebook"]
    mesh = ObjectMesh.load(touched)
    result = exploration_result(record, mesh.name, console.ended, console.answering, seconds)
    _tell(result, out)
    print("drawing the pictures", flush=True)
    write_page(record.snapshots, mesh, Codebook.load(codebook, mesh), result, out)
    return result


def _tell(result: dict, out: Path) -> None:
    write_json(out / "result.json", result)
    print(f"\n{text_table(*result_rows(result))}\n", flush=True)


def _explore(
    programs: Sequence[Program], mesh: str, given: bool, finger: bool, bag: Path, logs: Path, domain: int, wait: Wait
) -> Console:
    """Let the finger move once the recorder hears everything, until it is over; return the console, which knows how it
    ended. given: True if the filter is given the object, and has a pose to publish before the first touch."""
    topics = (TF_TOPIC, IMAGE_TOPIC, *RESULTS)
    later = () if given else _AFTER_A_TOUCH

    def turn() -> bool:
        executor.spin_once(timeout_sec=0.1)
        console.carry_out_keys()
        if wait(0.0):
            console.quit()
        supervisor.look_after()
        return console.ended is None

    def still_to_come() -> str:
        # the recorder may know a publisher that does not know it yet; a message from it proves both
        return ", ".join(topic for topic in topics if topic not in later and not recorder.counts[topic])

    def end_at_once(left: list[Process], seconds: float) -> None:
        if await_ends(wait, left, seconds):
            raise KeyboardInterrupt

    with supervised_run(domain, logs, end_at_once) as (supervisor, executor):
        objects = Topic(OBJECTS, "vision_msgs/msg/Detection3DArray", latched=True)
        executor.add_node(recorder := recorder_of_run(bag, {"object": Path(mesh).stem}, executor.context, [objects]))
        executor.add_node(console := Console(mesh, given, executor.context))
        for program in programs:
            supervisor.start(program)
        with Keyboard(console.keys()) as keyboard:
            if keyboard.active:
                print(keys_help(finger), flush=True)
            try:
                if await_recorder(recorder, topics, turn, still_to_come):
                    while turn():
                        console.let_begin()
            except NodeFailed as error:
                _hear_why(executor, console, error)
            hear_the_last(executor)
        if console.mesh != mesh:  # by key: the bag is about two objects
            recorder.metadata["object"] = ""
        return console


def _hear_why(executor: SingleThreadedExecutor, console: Console, error: NodeFailed) -> None:
    """Wait for the explorer's last words, as it also ends with an error when it gives up; without any it has failed."""
    deadline = time.monotonic() + _LAST_WORDS_S
    while console.ended is None and time.monotonic() < deadline:
        executor.spin_once(timeout_sec=0.1)
    if console.ended is None:
        close_bars()
        print(f"midastouch: error: {error}", file=sys.stderr)
        console.fail(error.cause)

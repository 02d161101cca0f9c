"""The examples, run as their readers run them."""

import re
import runpy
import signal
import subprocess
import sys
import types
from pathlib import Path

import numpy as np
import pytest
import yaml
from geometry_msgs.msg import PoseWithCovarianceStamped
from ros_graph import open_graph
from std_msgs.msg import Header

from midastouch_msgs.msg import FilterStatus
from midastouch_perception import ObjectMesh, bundled_objects
from midastouch_tools.cli import main
from midastouch_tools.processes.process import find_executable

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
POSES = "4000"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A short slide and its codebook, where the examples look for them."""
    folder = tmp_path_factory.mktemp("examples")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert main(["simulate", "handle_tool", "--seed", "3", "--length", "0.25", "--out", "out/slide"]) == 0
        assert main(["build-codebook", "handle_tool", "--size", POSES]) == 0
    return folder


ARGUMENTS = {"localise_offline": [], "own_network": ["out/slide", POSES, str(bundled_objects()["handle_tool"])]}


ENGINES = {"simulated_finger": "rclpy", "mujoco_arm": "mujoco"}
"""Those that move a simulated sensor, beside the nodes that look for it, and what they need."""


def lines_of(name, arguments, folder):
    """What the example prints, until it ends."""
    command = [sys.executable, str(EXAMPLES / f"{name}.py"), *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def error_mm(line):
    return float(re.search(r"([\d.]+|nan) mm", line)[1])


@pytest.mark.slow
@pytest.mark.parametrize("name", ARGUMENTS)
def test_an_example_finds_the_sensor(name, folder):
    last = lines_of(name, ARGUMENTS[name], folder)[-1]
    # ambiguous, if the last frame falls between two comparisons of hypotheses
    assert re.search("converged|ambiguous", last)
    assert error_mm(last) < 5


@pytest.mark.parametrize("name", ARGUMENTS)
def test_an_example_without_its_slide_says_how_to_make_it(name, tmp_path):
    done = subprocess.run([sys.executable, str(EXAMPLES / f"{name}.py")], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr.startswith("out/slide: ")
    assert "\nmidastouch simulate handle_tool --seed 3 --out out/slide\n" in done.stderr


@pytest.fixture
def nodes(name, folder):
    """A simulated sensor and the localisation on the bundled tool."""
    pytest.importorskip(ENGINES[name], reason="not installed: tools/requirements/mujoco.txt")
    setups = [["midastouch", "run", setup, "object:=handle_tool"] for setup in ("digit_sim", "localization")]
    running = [subprocess.Popen([find_executable(program), *words], cwd=folder) for program, *words in setups]
    with open_graph() as graph:
        for topic in ("image_raw", "filter_status"):
            graph.spin_until(lambda topic=topic: graph.companion.count_publishers(topic) > 0, topic)
    yield
    for process in running:
        process.send_signal(signal.SIGINT)
    assert [process.wait(timeout=60) for process in running] == [0, 0]


@pytest.mark.slow
@pytest.mark.dds
@pytest.mark.usefixtures("nodes")
@pytest.mark.parametrize("name", ENGINES)
def test_an_engine_moves_a_sensor_that_is_found(name, folder):
    # which images a live filter sees depends on the load, and so does the state in which the path happens to end
    lines = lines_of(name, [], folder)
    sure = [error_mm(line) for line in lines if line.startswith("converged")]
    assert sure, lines
    assert max(sure) < 5, lines
    assert error_mm(lines[-1]) < 5, lines


@pytest.mark.dds
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_example_is_ended_by_a_signal_without_a_traceback(number):
    command = [sys.executable, "-u", str(EXAMPLES / "simulated_finger.py")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert "no filter_status yet" in process.stdout.readline()
        process.send_signal(number)
        assert process.stderr.read() == ""
    assert process.returncode == 128 + number


@pytest.mark.slow
@pytest.mark.dds
@pytest.mark.parametrize("name", ENGINES)
def test_an_engine_without_nodes_says_which_to_start(name, tmp_path):
    pytest.importorskip(ENGINES[name], reason="not installed: tools/requirements/mujoco.txt")
    done = subprocess.run([sys.executable, str(EXAMPLES / f"{name}.py")], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr.startswith("nothing publishes image_raw and filter_status; start first:\n")
    assert "\nmidastouch run localization object:=handle_tool\n" in done.stderr


def stand_in(name, fields, made):
    """A class of messages that takes the fields of a fact only, each of its type; `made`: those there are."""

    def check(kind, value):
        item, array, count = kind.partition("[")
        if array:
            assert isinstance(value, list)
            assert count == "]" or len(value) == int(count[:-1])
            return all(check(item, each) for each in value)
        types = {"string": str, "byte": bytes, "float64": float, "uint32": int, **made}
        return isinstance(value, types[item]) if item in types else type(value).__name__ == item

    def start(self, **given):
        for key, value in given.items():
            assert check(fields[key], value), (name, key)
        vars(self).update(given)

    constants = {key: bytes([value]) for key, value in fields.items() if isinstance(value, int)}
    return type(name, (), {"__init__": start, **constants})


@pytest.mark.dds
def test_moveit_is_told_what_the_gripper_holds(monkeypatch, graph):
    facts, made = yaml.safe_load((EXAMPLES.parent / "tests/facts/moveit_msgs.yaml").read_text()), {}
    for package in ("moveit_msgs", "shape_msgs"):
        made |= {name: stand_in(name, fields, made) for name, fields in facts[package].items()}
        monkeypatch.setitem(sys.modules, package, types.ModuleType(package))
        monkeypatch.setitem(sys.modules, f"{package}.msg", types.SimpleNamespace(**made))
    Attacher, sent, heard = runpy.run_path(str(EXAMPLES / "attach_to_moveit.py"))["Attacher"], [], []

    class Watched(Attacher):
        def create_publisher(self, kind, topic, *options, **more):
            if kind is made["AttachedCollisionObject"]:
                assert topic == "attached_collision_object"
                return types.SimpleNamespace(publish=sent.append)
            return super().create_publisher(kind, topic, *options, **more)

        def on_pose(self, message):
            super().on_pose(message)
            heard.append(message)

    mesh = ObjectMesh.load(bundled_objects()["eyebolt"])
    node = graph.add(lambda: Watched(mesh, ["left_finger"]))
    states = graph.publisher(FilterStatus, "left/filter_status", latched=True)
    poses = graph.publisher(PoseWithCovarianceStamped, "left/object_pose", latched=True)
    pose = PoseWithCovarianceStamped(header=Header(frame_id="tool0"))
    pose.pose.pose.position.x = 0.25
    for number, state in enumerate(("ambiguous", "converged", "converged", "no_contact", "converged"), 1):
        states.publish(FilterStatus(state=state))
        graph.spin_until(lambda state=state: node.state == state, state)
        poses.publish(pose)
        graph.spin_until(lambda number=number: len(heard) == number, "the pose")
    assert [one.object.operation for one in sent] == [b"\0", b"\1", b"\0"]
    assert {(one.link_name, one.object.id, *one.touch_links) for one in sent} == {("tool0", "eyebolt", "left_finger")}
    assert (sent[0].object.pose, sent[0].object.header.frame_id) == (pose.pose.pose, "tool0")
    (shape,) = sent[0].object.meshes
    corners = np.array(
        [[[shape.vertices[k].x, shape.vertices[k].y] for k in t.vertex_indices] for t in shape.triangles]
    )
    np.testing.assert_allclose(corners, mesh.vertices[mesh.faces][..., :2])


def test_every_example_is_run():
    assert {*ARGUMENTS, *ENGINES, "attach_to_moveit"} == {path.stem for path in EXAMPLES.glob("*.py")}


@pytest.mark.parametrize(("words", "code"), [(["--help"], 0), (["a", "b", "c", "d"], 1)])
def test_an_example_with_other_arguments_shows_its_manual(words, code):
    command = [sys.executable, str(EXAMPLES / "localise_offline.py"), *words]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == code
    assert (done.stderr if code else done.stdout).startswith("Localise a recorded slide")

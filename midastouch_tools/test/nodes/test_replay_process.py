"""The replay's executable: how it ends, and what it says then."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import foreign_bags as bags
import pytest
from rcl_interfaces.msg import Log
from sensor_msgs.msg import Image

from midastouch_tools.nodes.replay import main
from midastouch_tools.replay.player import Player

pytestmark = pytest.mark.dds


def process(*parameters):
    """The executable, on the graph's DDS domain, which is that of the environment."""
    arguments = [part for parameter in parameters for part in ("-p", parameter)]
    command = [sys.executable, "-m", "midastouch_tools.nodes.replay", "--ros-args", *arguments]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


@pytest.mark.slow
def test_the_executable_ends_with_0_and_on_bad_input_with_2(simulated_sequence):
    sequence = simulated_sequence(n=3)
    good = process(f"source:={sequence.path}", "rate:=0.0")
    bad = process("source:=/nowhere/slide")
    out, err = good.communicate(timeout=120)
    assert good.returncode == 0, err
    assert "sent 3 frames, 0 repeated, 0 lost" in out + err
    out, err = bad.communicate(timeout=120)
    assert bad.returncode == 2
    assert err.startswith("/nowhere/slide: ")
    assert len(err.splitlines()) == 1
    sequence.image_paths[1].write_bytes(b"")
    damaged = process(f"source:={sequence.path}", "rate:=0.0")
    out, err = damaged.communicate(timeout=120)
    assert damaged.returncode == 2
    assert err.strip().endswith("1.jpg: not a readable image; get the file again")


@pytest.mark.slow
def test_a_foreign_bag_is_played_as_the_pipeline_takes_it(graph, tmp_path):
    """The command hands topics and turn on to the node."""
    bag = bags.plain(tmp_path / "a bag", bags.images_as(bags.raw(bags.RAW, "bgr8", bags.landscape)))
    words = ["replay", str(bag), "--remap", f"{bags.RAW}:=/image_raw", "--rotation", "90", "--loop", "--rate", "10"]
    command = [sys.executable, "-m", "midastouch_tools.cli", *words]
    with subprocess.Popen(command) as running:
        try:
            images = graph.listen(Image, "image_raw")
            graph.spin_until(lambda: images, "a first frame")
        finally:
            running.send_signal(signal.SIGINT)
    assert running.returncode == 0
    assert (images[0].width, images[0].height, images[0].encoding) == (240, 320, "rgb8")


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_an_error_nobody_expected_is_no_good_end(monkeypatch, capsys, simulated_sequence):
    def surprise(*_):
        raise ZeroDivisionError("surprise")

    monkeypatch.setattr(Player, "play", surprise)
    source = simulated_sequence(n=1).path
    with Path(os.devnull).open() as nothing:
        monkeypatch.setattr(sys, "stdin", nothing)
        assert main(["replay", "--ros-args", "-p", f"source:={source}"]) == 1
    assert "surprise" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("waits", [True, False])
def test_an_interrupt_ends_it_cleanly_waiting_or_playing(graph, simulated_sequence, waits):
    settings = ["wait_for_subscribers:=9"] if waits else ["loop:=true", "rate:=2.0"]
    running = process(f"source:={simulated_sequence(n=3).path}", *settings)
    if waits:
        heard = graph.listen(Log, "/rosout", latched=True)
        graph.spin_until(lambda: any("waiting for" in entry.msg for entry in heard), "its wait")
    else:
        images = graph.listen(Image, "image_raw")
        graph.spin_until(lambda: images, "a first frame")
    running.send_signal(signal.SIGINT)
    _, err = running.communicate(timeout=120)
    assert running.returncode == 0, err
    assert "Traceback" not in err

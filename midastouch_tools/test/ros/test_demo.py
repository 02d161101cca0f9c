"""The demo at a small size: real nodes as processes, over DDS."""

import json
import os
import shutil

import pytest
from PIL import Image

from midastouch_tools import cli
from midastouch_tools.drawing import run_pictures
from midastouch_tools.ros import demo

pytestmark = [pytest.mark.dds, pytest.mark.slow]
DOMAIN = "--domain", os.environ["ROS_DOMAIN_ID"]


@pytest.fixture(autouse=True)
def small(tmp_path, monkeypatch):
    """A short slide and a small codebook, in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(demo, "CODEBOOK_SIZES", (400, 400))
    monkeypatch.setattr(demo, "SLIDE_LENGTH", 0.015)
    monkeypatch.setattr(run_pictures, "GIF_FRAMES", 3)


def test_the_demo_leaves_a_table_a_bag_and_pictures(tmp_path, capsys):
    assert cli.main(["demo", "--object", "eyebolt", "--headless", "--out", "result", *DOMAIN]) == 0
    output = capsys.readouterr().out
    for text in ("particles, final error", "closest mode, final error", "image to penetration map", "state"):
        assert text in output
    out = tmp_path / "result"
    result = json.loads((out / "result.json").read_text())
    assert result["frames"] == 10
    assert set(result["stage_ms"]) >= {"particle_filter"}
    assert result["n_particles"] > 0
    for name in ("run.png", "final.png", "run.gif"):
        with Image.open(out / name) as picture:
            assert picture.width > 300
        assert name in (out / "index.html").read_text()
    assert (out / "run.mcap").stat().st_size > 100_000
    # slide and codebook are kept: nothing is simulated twice
    assert (tmp_path / "out" / "cache" / "codebooks" / "eyebolt_400.npz").is_file()


def test_a_node_that_dies_fails_the_demo_with_the_end_of_its_log(tmp_path, monkeypatch, capsys):
    shutil.copytree(demo.SHARE / "config", tmp_path / "config")
    parameters = tmp_path / "config" / "midastouch.yaml"
    parameters.write_text(parameters.read_text().replace("tdn: fast", "tdn: no_such_network"))
    monkeypatch.setattr(demo, "SHARE", tmp_path)
    assert cli.main(["demo", "--object", "eyebolt", "--headless", *DOMAIN]) == 1
    error = capsys.readouterr().err
    assert "tdn died: exit code 2" in error
    assert "no_such_network" in error
    assert not (tmp_path / "out" / "demo" / "index.html").exists()

import argparse
import dataclasses
import json
import math
import shlex
import time
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from midastouch_benchmark.commands import options
from midastouch_benchmark.evidence import fingerprint
from midastouch_benchmark.tables.experiments import EXPERIMENTS
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_common.output_paths import codebook_path
from midastouch_perception.codebook import FORMAT, Codebook
from midastouch_tools.cli import build_parser

NETWORKS = SimpleNamespace(
    tcn=SimpleNamespace(network_id="net-1"), sensor=SimpleNamespace(content_id="id-1", name="digit_tacto")
)


@pytest.fixture
def box(tmp_path, monkeypatch) -> ObjectMesh:
    """A mesh file with its codebook where `build-codebook` puts it."""
    monkeypatch.chdir(tmp_path)
    trimesh.creation.box((0.1, 0.05, 0.03)).export(tmp_path / "box.ply")
    mesh = ObjectMesh.load("box.ply")
    save_book(mesh)
    return mesh


def save_book(mesh: ObjectMesh, name: str = "box", **changes) -> None:
    meta = {
        "format": FORMAT,
        "mesh_name": "box",
        "mesh_sha256": mesh.sha256,
        "mesh_path": str(mesh.path),
        "sensor": "digit_tacto",
        "sensor_id": "id-1",
        "tcn": "net-1",
    }
    Codebook(np.eye(4)[None].repeat(3, 0), np.eye(3), meta | changes).save(codebook_path(name))


def test_mesh_and_codebook_are_found_by_the_objects_name(box):
    mesh, codebook = options.load_object("box", None, None, NETWORKS)
    assert mesh.sha256 == box.sha256
    assert len(codebook.poses) == 3


def test_without_a_codebook_the_error_names_the_command(box):
    with pytest.raises(InputError, match=r"cup\.npz: .*midastouch build-codebook MESH --out .*cup\.npz"):
        options.load_object("cup", None, None, NETWORKS)


def test_a_given_mesh_leads_to_its_own_codebook(box, tmp_path):
    """What the error tells to build is what is looked for."""
    box.path.rename(tmp_path / "aligned.ply")
    codebook_path("box").unlink()
    with pytest.raises(InputError, match=r"aligned\.npz: .*midastouch build-codebook aligned\.ply"):
        options.load_object("avocado", "aligned.ply", None, NETWORKS)
    save_book(ObjectMesh.load("aligned.ply"), name="aligned")
    assert options.load_object("avocado", "aligned.ply", None, NETWORKS)[0].name == "aligned"


def test_the_command_names_sensor_and_network_as_they_were_given(box):
    sensor = SimpleNamespace(content_id="id-1", name="my_touch")
    networks = SimpleNamespace(tcn=NETWORKS.tcn, sensor=sensor)
    with pytest.raises(InputError, match=r"my cup\.ply: no such mesh file"):
        options.load_object("cup", "my cup.ply", None, networks)
    box.save("my cup.ply")
    with pytest.raises(InputError) as error:
        options.load_object("cup", "my cup.ply", None, networks, "gels/my_touch.yaml", "out/tcn.onnx")
    words = shlex.split(str(error.value).partition("build it: ")[2])
    args = build_parser().parse_args(words[1:])
    assert (words[0], args.mesh, args.sensor, args.tcn) == (
        "midastouch",
        ["my cup.ply"],
        "gels/my_touch.yaml",
        "out/tcn.onnx",
    )
    assert args.out == codebook_path("my cup", sensor.name)


def test_a_mesh_that_has_moved_must_be_given(box, tmp_path):
    box.path.rename(tmp_path / "moved.ply")
    with pytest.raises(InputError, match=r"box\.ply' .*--mesh"):
        options.load_object("box", None, None, NETWORKS)
    assert options.load_object("box", "moved.ply", None, NETWORKS)[0].name == "moved"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mesh_sha256": "0" * 64}, r"box\.npz"),
        ({"tcn": "net-2"}, "net-2"),
        ({"sensor_id": "id-2", "sensor": "other"}, r"box\.npz: .*other"),
    ],
)
def test_what_does_not_belong_together_is_refused(box, changes, message):
    save_book(box, **changes)
    with pytest.raises(InputError, match=message):
        options.load_object("box", None, None, NETWORKS)


@pytest.mark.parametrize(
    ("kind", "also", "parts"),
    [
        ("evaluate-start", (), ["estimates"]),
        ("evaluate-perception checks", (), ["real_gel"]),
        ("evaluate-start", ("real_gel",), ["estimates", "real_gel"]),
    ],
)
def test_a_result_is_kept_with_command_fingerprint_and_machine(tmp_path, capsys, monkeypatch, kind, also, parts):
    shown = dataclasses.replace(EXPERIMENTS[kind], tables=lambda content: (), notes=lambda content: ["a line"])
    monkeypatch.setitem(EXPERIMENTS, kind, shown)
    parser = argparse.ArgumentParser()
    options.add_json_option(parser)
    args = parser.parse_args(["--json", str(tmp_path / "r.json")])
    args.command_line = "midastouch measure"
    assert options.conclude(args, kind, {"mm": 1 / 3, "missing_slides": 3}, "another", also=also) == 0
    assert capsys.readouterr().out.splitlines()[:2] == ["a line", "another"]
    made_by = "+".join(fingerprint.today()[part] for part in parts)
    kept = {"command": "midastouch measure", "fingerprint": made_by, "mm": 0.3333, "missing_slides": 3}
    written = json.loads((tmp_path / "r.json").read_text())
    assert written.pop("machine")["cores"] > 0
    assert written == kept


def test_without_json_nothing_is_written(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    start = {"trials": 1, "objects": 1, "first_pose_s": {"value": 1.0, "max": 2.0}}
    result = {"start": start, "missing_trials": 3}
    assert options.conclude(argparse.Namespace(json=None), "evaluate-start", result) == 0
    assert capsys.readouterr().out.splitlines()[-1].startswith("trials left: 3")
    assert list(tmp_path.iterdir()) == []


def parsed(*given: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    options.add_campaign_options(parser, "trial")
    return parser.parse_args(["--jobs", "1", *given])


class Squares:
    """A campaign of two trials, which keeps its deadline."""

    UNIT = "trial"

    def describe(self) -> dict:
        return {"power": 2}

    def run(self, meshes, workers, deadline) -> tuple[list[dict], int]:
        self.deadline = deadline
        return [{"square": square} for square in workers.map(pow, [(1, 2), (3, 2)], deadline)], 0


def test_a_campaign_has_workers_and_a_deadline_that_counts_from_its_start():
    plan, before = Squares(), time.monotonic()
    trials, result = options.run_campaign(parsed("--minutes", "2"), plan, [])
    assert before + 120 <= plan.deadline <= time.monotonic() + 120
    assert trials == [{"square": 1}, {"square": 9}]
    assert result["config"] == {"power": 2, "jobs": 1, "cluster": None}
    assert result["missing_trials"] == 0
    options.run_campaign(parsed(), plan, [])
    assert plan.deadline == math.inf

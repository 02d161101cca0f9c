import json
import re
import signal

import numpy as np
import pytest
import trimesh

from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.filter import ParticleFilter
from midastouch_perception import codebook_build
from midastouch_perception.codebook import Codebook, codebook_poses
from midastouch_perception.objects import bundled_objects
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.symmetry.search import object_symmetry
from midastouch_tools import cli, codebooks

pytestmark = pytest.mark.usefixtures("no_symmetry_search")
CHUNK = 32  # poses; a smaller one than in earnest
SIZE = 4 * CHUNK


class FlatTcn:
    """Encodes a map by its mean depth in eight strips; presses Ctrl-C in the `stop`th batch."""

    network_id, dim, calibration = "flat", 8, {"temperature": 0.1, "outlier": 0.05}

    def __init__(self, stop: int = 0):
        self.batches, self._stop = 0, stop

    def encode(self, maps: np.ndarray) -> np.ndarray:
        self.batches += 1
        if self.batches == self._stop:
            signal.raise_signal(signal.SIGINT)
        strips = maps.reshape(len(maps), 8, -1).mean(axis=2) + 1e-6
        return (strips / np.linalg.norm(strips, axis=1, keepdims=True)).astype(np.float32)


@pytest.fixture(autouse=True)
def _quick(monkeypatch):
    monkeypatch.setattr(codebook_build, "CHUNK", CHUNK)
    monkeypatch.setattr(codebooks, "derived_arrays", lambda *_: {})


@pytest.fixture(autouse=True)
def _pythons_own_handler():
    """Earlier tests may have left rclpy's handler, which keeps Ctrl-C to itself."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="module")
def ball():
    """A coarse ball."""
    sphere = trimesh.creation.icosphere(subdivisions=3, radius=0.03)
    return ObjectMesh.from_arrays(sphere.vertices, sphere.faces, "ball")


@pytest.fixture
def build(ball, tmp_path):
    """Function (tcn, seed=0) -> codebook of the ball, in `tmp_path`."""

    def build(tcn: FlatTcn, seed: int = 0) -> Codebook:
        sensor = SensorModel.load("digit_tacto")
        return codebooks.build_and_save(ball, tcn, sensor, SIZE, seed, tmp_path / "ball.npz", jobs=1)[0]

    return build


def test_no_file_but_a_codebook_is_replaced(tmp_path, capsys):
    mesh = tmp_path / "eyebolt.ply"
    mesh.write_bytes(bundled_objects()["eyebolt"].read_bytes())
    assert cli.main(["build-codebook", str(mesh), "--size", "32", "--out", str(mesh)]) == 2
    assert f"{mesh}: exists and is no codebook" in capsys.readouterr().err
    assert mesh.read_bytes() == bundled_objects()["eyebolt"].read_bytes()


def test_a_mesh_s_faults_are_said_before_its_codebook_is_built(tmp_path, capsys):
    sphere, cavity = (trimesh.creation.icosphere(subdivisions=3, radius=radius) for radius in (0.03, 0.02))
    cavity.invert()
    hollow = trimesh.util.concatenate(sphere, cavity)
    mesh, sensor = ObjectMesh.from_arrays(hollow.vertices, hollow.faces, "hollow"), SensorModel.load("digit_tacto")
    codebooks.build_and_save(mesh, FlatTcn(), sensor, SIZE, 0, tmp_path / "hollow.npz", jobs=1)
    said = capsys.readouterr().err
    assert "hollow: 60 x 60 x 60 mm; faces: 2560; shells: 2, of them inside: 1" in said
    assert "warning: hollow: 31% of the surface lies inside" in said


def test_every_step_of_a_build_shows_how_far_it_is(build, capsys, monkeypatch):
    monkeypatch.setattr("midastouch_tools.progress.SOON_S", 0.0)
    monkeypatch.setattr(codebook_build, "object_symmetry", object_symmetry)
    build(FlatTcn())
    said = capsys.readouterr().err
    assert f"poses that reach ball: 100%|██████████| {SIZE}/{SIZE}" in said
    assert int(re.findall(r"symmetry of ball: (\d+) motions", said)[-1]) > 10
    assert f"codebook of ball: 100%|██████████| {SIZE}/{SIZE}" in said


def test_a_search_that_begins_again_has_a_bar_of_its_own(build, capsys, monkeypatch):
    def repeated(*arguments):
        for found in (SIZE // 2, SIZE // 4):
            arguments[-1](found)
        return codebook_poses(*arguments)

    monkeypatch.setattr("midastouch_tools.progress.SOON_S", 0.0)
    monkeypatch.setattr(codebook_build, "codebook_poses", repeated)
    build(FlatTcn())
    said = capsys.readouterr().err
    shown = re.findall(r"poses that reach ball(.*?): +(\d+)%", said)
    assert {words for words, _ in shown} == {"", ", of more places"}
    for words in ("", ", of more places"):
        percent = [int(number) for each, number in shown if each == words]
        assert percent == sorted(percent)


def test_nothing_is_lost_by_ctrl_c_at_the_end(build, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(codebooks, "derived_arrays", lambda *_: signal.raise_signal(signal.SIGINT))
        with pytest.raises(KeyboardInterrupt):
            build(FlatTcn())
    rest = FlatTcn()
    build(rest)
    assert rest.batches == 0


def test_an_interrupted_build_goes_on_where_it_stopped(build, tmp_path, capsys):
    with pytest.raises(KeyboardInterrupt):
        build(FlatTcn(stop=3))
    assert [path.name for path in tmp_path.iterdir()] == ["ball.unfinished.npz"]
    assert f"of {SIZE} poses; run it again" in capsys.readouterr().err

    rest = FlatTcn()
    resumed = build(rest)
    assert 0 < rest.batches < 4
    assert [path.name for path in tmp_path.iterdir()] == ["ball.npz"]
    assert f"{SIZE - rest.batches * CHUNK} of {SIZE} poses" in capsys.readouterr().err
    whole = build(FlatTcn())
    np.testing.assert_array_equal(resumed.codes, whole.codes)
    np.testing.assert_array_equal(resumed.poses, whole.poses)


def test_what_another_build_left_is_passed_over(build, tmp_path, capsys):
    with pytest.raises(KeyboardInterrupt):
        build(FlatTcn(stop=3), seed=1)
    tcn = FlatTcn()
    build(tcn, seed=0)
    assert tcn.batches == 4
    assert "another seed; remove it" in capsys.readouterr().err


def test_a_running_build_is_kept_now_and_then(build, tmp_path, monkeypatch):
    """A kill leaves no time to save."""
    monkeypatch.setattr(codebooks, "SAVE_INTERVAL_S", 0.0)
    kept = []
    saving = codebooks.CodebookBuild.save
    monkeypatch.setattr(
        codebooks.CodebookBuild, "save", lambda self, path: (saving(self, path), kept.append(self.done))
    )
    build(FlatTcn())
    assert kept == [CHUNK, 2 * CHUNK, 3 * CHUNK, 4 * CHUNK]
    assert [path.name for path in tmp_path.iterdir()] == ["ball.npz"]


def test_a_book_of_one_pose_is_built_and_refused_by_the_filter(tmp_path):
    out = tmp_path / "one.npz"
    assert cli.main(["build-codebook", "ball", "--size", "1", "--jobs", "2", "--out", str(out)]) == 0
    book = Codebook.load(out, mesh=ObjectMesh.load(bundled_objects()["ball"]))
    assert len(book.poses) == 1
    with pytest.raises(InputError, match="1 poses; build"):
        ParticleFilter(ObjectMesh.load(bundled_objects()["ball"]), book)


def test_a_book_that_fits_is_not_built_again(build, ball, tmp_path):
    sensor, out = SensorModel.load("digit_tacto"), tmp_path / "ball.npz"
    first = build(FlatTcn())
    again = FlatTcn()
    kept = codebooks.ensure_codebook(out, ball, again, sensor, SIZE)
    assert again.batches == 0
    np.testing.assert_array_equal(kept.codes, first.codes)
    np.testing.assert_array_equal(kept.poses, first.poses)
    other = FlatTcn()
    other.network_id = "other"
    assert codebooks.ensure_codebook(out, ball, other, sensor, SIZE).meta["tcn"] == "other"
    assert other.batches > 0


def test_a_codebook_of_another_sensor_is_not_taken_for_it(ball, tmp_path):
    sensors = [SensorModel.load(name) for name in ("digit_real", "digit_tacto", "digit_tacto")]
    books = [codebooks.ensure_codebook(tmp_path / "book.npz", ball, FlatTcn(), sensor, CHUNK) for sensor in sensors]
    assert [book.meta["sensor"] for book in books] == ["digit_real", "digit_tacto", "digit_tacto"]


def test_codebooks_of_many_are_built_and_kept(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    options = ["build-codebook", "eyebolt", "ball", "--size", "20", "--out", "catalogue", "--jobs", "1"]
    assert cli.main(options) == 0
    assert sorted(path.name for path in (tmp_path / "catalogue").iterdir()) == ["ball.npz", "eyebolt.npz"]
    built = capsys.readouterr().out.splitlines()
    assert ["20 poses of ball" in one or "20 poses of eyebolt" in one for one in built] == [True, True]
    assert cli.main(options) == 0
    assert ["is up to date; --force" in line for line in capsys.readouterr().out.splitlines()] == [True, True]
    assert cli.main(["build-codebook", "ball", *options[3:], "--force"]) == 0
    assert "20 poses of ball" in capsys.readouterr().out


def test_a_codebook_is_built_again_after_changes_or_by_force(tmp_path, capsys):
    out, info = tmp_path / "ball.npz", tmp_path / "models_info.json"
    info.write_text(json.dumps({"1": {"symmetries_continuous": [{"axis": [0, 0, 1], "offset": [0, 0, 0]}]}}))
    built = []
    for options in (
        [],
        [],
        ["--seed", "1", "--symmetries", str(info)],
        ["--seed", "1", "--symmetries", str(info)],
        ["--seed", "1"],
        ["--seed", "1", "--force"],
    ):
        before = out.stat().st_mtime_ns if out.exists() else None
        assert cli.main(["build-codebook", "ball", "--size", "20", "--jobs", "1", "--out", str(out), *options]) == 0
        built.append(out.stat().st_mtime_ns != before)
        said = capsys.readouterr().out
        assert ("is up to date" in said) != built[-1]
        assert ("in place of one of 20 poses" in said) == (built[-1] and before is not None)
    assert built == [True, False, True, False, True, True]

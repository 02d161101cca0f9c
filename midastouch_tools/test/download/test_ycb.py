"""YCB meshes and YCB-Slide, from servers of our own in their layout."""

import io
import stat
import tarfile
import zipfile

import pytest
import trimesh

from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_tools import cli
from midastouch_tools.download.ycb import FOLDERS, download_mesh, download_part

MESH = trimesh.creation.icosphere(radius=0.04).export(file_type="ply")


def archive_of(member: str, kind: bytes = tarfile.REGTYPE) -> bytes:
    """A YCB archive of a mug with another file and this one, a link unless it is regular."""
    out = io.BytesIO()
    with tarfile.open(fileobj=out, mode="w:gz") as packed:
        own = MESH if kind == tarfile.REGTYPE else b""
        for path, content, of_kind in (("textured.obj", b"o", tarfile.REGTYPE), (member, own, kind)):
            info = tarfile.TarInfo(f"025_mug/google_16k/{path}")
            info.size, info.type, info.linkname = len(content), of_kind, "/etc/passwd"
            packed.addfile(info, io.BytesIO(content))
    return out.getvalue()


@pytest.fixture
def mug(server):
    server.files["/google/025_mug_google_16k.tgz"] = archive_of("nontextured.ply")
    return server


def test_a_mesh_arrives_by_name(mug, tmp_path):
    path = download_mesh("025_mug", tmp_path / "ycb", mug.url)
    assert path == tmp_path / "ycb" / "025_mug.ply"
    assert ObjectMesh.load(path).diagonal == pytest.approx(0.08 * 3**0.5, rel=0.05)
    assert [p.name for p in path.parent.iterdir()] == ["025_mug.ply"]


def test_what_is_there_is_not_fetched_again(mug, tmp_path):
    for _ in range(2):
        download_mesh("025_mug", tmp_path, mug.url)
    assert len(mug.requests) == 1


@pytest.mark.parametrize("member", [("poisson.ply",), ("nontextured.ply", tarfile.SYMTYPE)], ids=["layout", "link"])
def test_an_archive_without_the_mesh_itself_is_said(mug, tmp_path, member):
    mug.files["/google/025_mug_google_16k.tgz"] = archive_of(*member)
    with pytest.raises(InputError, match=r"tgz.*google_16k/nontextured\.ply"):
        download_mesh("025_mug", tmp_path, mug.url)


def test_a_damaged_archive_leaves_no_mesh(mug, tmp_path):
    whole = mug.files["/google/025_mug_google_16k.tgz"]
    for damaged in (whole[: len(whole) // 2], b"nonsense"):
        mug.files["/google/025_mug_google_16k.tgz"] = damaged
        with pytest.raises(InputError, match=r"(?s)025_mug_google_16k\.tgz.*download it again"):
            download_mesh("025_mug", tmp_path, mug.url)
        assert not (tmp_path / "025_mug.ply").exists()
        (tmp_path / "025_mug_google_16k.tgz").unlink()


@pytest.mark.parametrize("name", ["../secret", "025_mug/../x", "mug", "", "025_mug?x=1"])
def test_names_that_are_no_objects_ask_nobody(mug, tmp_path, name):
    with pytest.raises(InputError, match=r"YCB object.*025_mug"):
        download_mesh(name, tmp_path, mug.url)
    assert mug.requests == []


def test_the_command(mug, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["download", "ycb-mesh", "025_mug", "--mirror", mug.url]) == 0
    assert capsys.readouterr().out == "out/ycb/025_mug.ply\n"
    assert cli.main(["download", "ycb-mesh", "001_nothing", "--mirror", mug.url]) == 2
    assert "404" in capsys.readouterr().err
    assert cli.main(["download", "ycb-slide", "all"]) == 2
    assert "there are sim, real, backgrounds" in capsys.readouterr().err


# --- YCB-Slide, with a program in the place of gdown


def gdown(folder, archives: dict[str, dict[str, bytes]], status: int = 0) -> str:
    """A program that is called as gdown is and "downloads" these archives."""
    store = folder / "drive"
    store.mkdir(exist_ok=True)
    for name, files in archives.items():
        with zipfile.ZipFile(store / name, "w") as out:
            for path, content in files.items():
                out.writestr(path, content)
    program = folder / "gdown"
    program.write_text(
        f'#!/bin/sh\necho "$@" > {folder}/called\n[ {status} = 0 ] && mkdir -p "$5" && cp -p {store}/* "$5"\n'
    )
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    return str(program)


def test_a_part_is_fetched_and_unpacked(tmp_path):
    program = gdown(
        tmp_path,
        {"025_mug.zip": {"025_mug/00/tactile_data.pkl": b"1"}, "048_hammer.zip": {"00/tactile_data.pkl": b"2"}},
    )
    out = tmp_path / "slides"
    assert download_part("sim", out, program) == [out / "sim/025_mug", out / "sim/048_hammer"]
    assert (out / "sim/025_mug/00/tactile_data.pkl").read_bytes() == b"1"
    assert (out / "sim/048_hammer/00/tactile_data.pkl").read_bytes() == b"2"
    called = (tmp_path / "called").read_text().split()
    assert called == ["--folder", FOLDERS["sim"], "--continue", "--output", str(out / "sim")]
    assert download_part("sim", out, program) == []


def test_what_a_call_left_nested_when_it_was_killed_is_put_right(tmp_path):
    program = gdown(tmp_path, {"025_mug.zip": {"025_mug/00/0.jpg": b"1"}})
    nested = tmp_path / "slides" / "sim" / "025_mug" / "025_mug" / "00"
    nested.mkdir(parents=True)
    assert download_part("sim", tmp_path / "slides", program) == []
    assert [path.name for path in (tmp_path / "slides" / "sim" / "025_mug").iterdir()] == ["00"]


def test_an_archive_that_would_escape_is_refused(tmp_path):
    program = gdown(tmp_path, {"025_mug.zip": {"../../evil": b"1"}})
    with pytest.raises(InputError, match=r"025_mug\.zip.*evil"):
        download_part("sim", tmp_path / "slides", program)
    assert not (tmp_path / "evil").exists()


def test_a_failing_gdown_and_none_at_all_are_said(tmp_path, monkeypatch):
    with pytest.raises(InputError, match=r"gdown.*call again"):
        download_part("sim", tmp_path / "slides", gdown(tmp_path, {}, status=1))
    assert not (tmp_path / "slides").exists()
    monkeypatch.setenv("PATH", str(tmp_path / "empty"))
    with pytest.raises(InputError, match="pip install gdown"):
        download_part("sim", tmp_path / "slides")


def test_it_is_said_where_the_recordings_of_a_gelsight_mini_are(capsys):
    assert cli.main(["download", "tactile-tracking"]) == 0
    said = capsys.readouterr().out
    assert "https://huggingface.co/datasets/joehjhuang/TactileTracking" in said
    assert "--sensor gelsight_mini" in said

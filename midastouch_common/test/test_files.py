import contextlib
import errno
import hashlib
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from midastouch_common.errors import InputError
from midastouch_common.files import (
    atomic_path,
    next_new_folder,
    read_yaml,
    require_file,
    require_folder,
    require_new_folder,
    require_place,
    sha256,
    sole_use,
    temporary_folder,
    whole_folder,
)


def test_atomic_path_leaves_nothing_after_a_failure(tmp_path):
    target = tmp_path / "deep" / "book.npz"

    def fail():
        with atomic_path(target) as temporary:
            temporary.write_text("half")
            assert temporary.suffix == ".npz"
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert list(target.parent.iterdir()) == []


KILLED = """
import os, signal, sys
from midastouch_common.files import atomic_path, temporary_folder
with atomic_path(sys.argv[1]) as file, atomic_path(sys.argv[2]) as folder, temporary_folder("test") as other:
    file.touch()
    folder.mkdir()
    (folder / "a").touch()
    (other / "a").touch()
    print("written", flush=True)
    if sys.argv[3] == "killed":
        os.kill(os.getpid(), signal.SIGKILL)
    sys.stdin.read()
"""


def test_what_a_killed_process_left_is_removed_by_the_next_and_no_other(tmp_path, monkeypatch):
    monkeypatch.setenv("TMPDIR", str(tmp_path / "tmp"))
    monkeypatch.setattr(tempfile, "tempdir", None)  # asked once
    (tmp_path / "tmp").mkdir()
    (tmp_path / ".slide.notes").touch()
    (tmp_path / ".slide.0123456g").touch()
    kept = sorted(tmp_path.iterdir())
    paths = [tmp_path / "book.npz", tmp_path / "slide"]

    def start(how: str) -> subprocess.Popen:
        command = [sys.executable, "-c", KILLED, *map(str, paths), how]
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert process.stdout.readline() == "written\n"
        return process

    def left() -> list[Path]:
        return sorted({*tmp_path.iterdir(), *tmp_path.glob("tmp/*/.*")} - {*kept})

    def use() -> None:
        for path in paths:
            with contextlib.suppress(RuntimeError), atomic_path(path):
                raise RuntimeError
        with temporary_folder("test"):
            pass

    with start("killed") as process:
        process.wait()
    assert len(left()) == 3
    use()
    assert left() == []
    with start("lives") as process:
        there = left()
        assert len(there) == 3
        use()
        assert left() == there
        process.communicate("")
    assert left() == paths


def test_a_temporary_folder_of_another_user_is_not_taken(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(os, "getuid", lambda: 12345)
    with pytest.raises(InputError, match="midastouch_a_12345: belongs to another user; set TMPDIR"):
        temporary_folder("a").__enter__()


def test_a_new_folder_is_numbered_where_its_name_holds_something(tmp_path):
    folder = tmp_path / "presses"
    assert next_new_folder(folder) == folder
    folder.mkdir()
    assert next_new_folder(folder) == folder
    (folder / "a.png").touch()
    (tmp_path / "presses_2").touch()
    assert next_new_folder(folder) == tmp_path / "presses_3"


def test_a_place_where_nothing_can_be_written_is_refused_before(tmp_path):
    require_place(tmp_path / "new" / "deep" / "page.html")
    require_place(tmp_path / "new" / "deep", "folder")
    require_place(tmp_path, "folder")
    (tmp_path / "file").touch()
    require_place(tmp_path / "file")
    for path in (tmp_path, tmp_path / "file" / "page.html", tmp_path / ("x" * 300), "/proc/page.html"):
        with pytest.raises(InputError, match=rf"{path}: no file can be written there \(.*name another"):
            require_place(path)
    with pytest.raises(InputError, match="no folder can be written there"):
        require_place(tmp_path / "file", "folder")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_atomic_path_replaces_files_and_folders(tmp_path):
    file, folder = tmp_path / "a.txt", tmp_path / "slide"
    file.write_text("old")
    folder.mkdir()
    (folder / "stale").touch()
    with atomic_path(file) as temporary:
        temporary.write_text("new")
        assert file.read_text() == "old"
    with atomic_path(folder) as temporary:
        temporary.mkdir()
        (temporary / "fresh").touch()
    assert file.read_text() == "new"
    assert [p.name for p in folder.iterdir()] == ["fresh"]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.txt", "slide"]


def test_sha256(tmp_path):
    path = tmp_path / "x"
    path.write_bytes(b"midas" * 500_000)
    assert sha256(path) == hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.mark.parametrize("content", [b"a: [", b"k\xe4se: 1", b"a:\n\t- b", 1000 * b"[", b"\0"])
def test_yaml_that_is_none_is_bad_input(tmp_path, content):
    path = tmp_path / "settings.yaml"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"settings\.yaml.*correct the parameter file"):
        read_yaml(path, "parameter")


def test_a_path_of_nothing_or_of_another_kind_is_named(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=r"gone\.ply.*mesh.*check the path"):
        require_file(tmp_path / "gone.ply", "mesh")
    with pytest.raises(InputError, match=f"{tmp_path}: is a folder; give the mesh file"):
        require_file(tmp_path, "mesh")
    for name, fault in (("gone", "no such folder"), ("file", "is a file, not a folder")):
        with pytest.raises(InputError, match=f"{name}: {fault}; give a folder of meshes"):
            require_folder(tmp_path / name, "of meshes")


def test_a_full_disk_names_the_file(tmp_path):
    """What the system calls raise does not say which file it was."""
    with pytest.raises(OSError, match="No space") as caught, atomic_path(tmp_path / "book.npz"):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    assert caught.value.filename == str(tmp_path / "book.npz")
    with pytest.raises(OSError, match="other") as caught, atomic_path(tmp_path / "book.npz"):
        (tmp_path / "other" / "x").write_text("")
    assert caught.value.filename == str(tmp_path / "other" / "x")


def test_no_error_names_the_temporary_path(tmp_path):
    wanted = tmp_path / "slide"
    with pytest.raises(FileNotFoundError) as caught, atomic_path(wanted) as temporary:
        (temporary / "0.png").write_text("")  # its folder was not made
    assert caught.value.filename == str(wanted / "0.png")
    with pytest.raises(InputError) as refused, atomic_path(wanted) as temporary:
        raise InputError(f"{temporary}: holds nothing")
    assert str(refused.value) == f"{wanted}: holds nothing"
    wanted.mkdir()
    with pytest.raises(OSError, match="slide") as caught, atomic_path(wanted) as temporary:
        temporary.touch()  # a file, which cannot take the place of a folder
    assert caught.value.filename == str(wanted)
    assert [path.name for path in tmp_path.iterdir()] == ["slide"]


def test_a_path_that_cannot_be_looked_at_is_bad_input():
    with pytest.raises(InputError, match="check the path of the mesh file"):
        require_file("x" * 300 + ".ply", "mesh")


def test_a_new_folder_takes_the_place_of_nothing(tmp_path, monkeypatch):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.txt").touch()
    (tmp_path / "empty").mkdir()
    (tmp_path / "link").symlink_to("full")
    assert require_new_folder(tmp_path / "none") == tmp_path / "none"
    assert require_new_folder(tmp_path / "empty") == tmp_path / "empty"
    monkeypatch.chdir(tmp_path)
    for taken in ("full", "link", "full/thesis.txt", "."):
        with pytest.raises(InputError, match="name another folder"):
            require_new_folder(taken)


def test_a_folder_is_for_one_process_until_that_ends(tmp_path):
    program = "import sys\nfrom midastouch_common.files import sole_use\nwith sole_use(sys.argv[1]): input('in\\n')"
    command = [sys.executable, "-u", "-c", program, tmp_path / "out"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as killed:
        assert killed.stdout.readline() == b"in\n"
        with pytest.raises(InputError, match="out: another run"), sole_use(tmp_path / "out"):
            pass
        killed.kill()
    with sole_use(tmp_path / "out"):
        pass


def test_whole_files_of_a_run_replace_those_of_the_run_before(tmp_path):
    def names() -> list[str]:
        return sorted(path.name for path in tmp_path.iterdir() if not path.name.startswith("."))

    (tmp_path / "thesis.txt").touch()
    (tmp_path / ".made").write_text("\n..\nanother.png")  # of somebody else: leads to nothing here
    with whole_folder(tmp_path) as fresh:
        (fresh / "log").mkdir()
        (fresh / "result.json").write_text("1")
        assert names() == ["thesis.txt"]
    assert names() == ["log", "result.json", "thesis.txt"]
    for number, (error, kept) in enumerate([(KeyboardInterrupt, True), (ValueError, True), (ValueError, False)], 2):
        with contextlib.suppress(error), whole_folder(tmp_path, keep_failed=kept) as fresh:
            (fresh / "result.json").write_text(str(number))
            raise error
    assert names() == ["failed", "log", "result.json", "thesis.txt"]
    assert [(tmp_path / name / "result.json").read_text() for name in ("", "failed")] == ["1", "3"]
    with whole_folder(tmp_path) as fresh:
        (fresh / "page.html").touch()
    assert names() == ["page.html", "thesis.txt"]

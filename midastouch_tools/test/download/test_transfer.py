"""Transfers from a server with faults: what arrives is right or does not arrive."""

import errno
import socket
from pathlib import Path

import numpy as np
import pytest

from midastouch_common.errors import InputError
from midastouch_tools.download import transfer
from midastouch_tools.download.transfer import fetch

DATA = np.random.default_rng(0).bytes(700_001)


@pytest.fixture
def url(server):
    server.files["/drill.tgz"] = DATA
    return f"{server.url}/drill.tgz"


@pytest.fixture
def path(tmp_path):
    return tmp_path / "new folder" / "drill.tgz"


def left(path: Path) -> list[str]:
    return sorted(p.name for p in path.parent.iterdir())


def test_a_whole_file_with_its_progress(url, path, monkeypatch, capsys):
    monkeypatch.setattr("midastouch_tools.progress.SOON_S", 0.0)
    fetch(url, path)
    assert path.read_bytes() == DATA
    assert left(path) == ["drill.tgz"]
    assert "drill.tgz: 100%" in capsys.readouterr().err


@pytest.mark.parametrize("faults", [{"break_after": [100_000, 250_000]}, {"fail": [503, 429]}], ids=str)
def test_what_breaks_off_or_is_busy_is_tried_again(server, url, path, faults):
    vars(server).update(faults)
    fetch(url, path, pause_s=0)
    assert path.read_bytes() == DATA
    assert len(server.requests) == 3


def test_a_transfer_that_breaks_off_each_time_leaves_nothing(server, url, path):
    server.break_after = [100_000]
    with pytest.raises(InputError, match=r"drill\.tgz.*100000 of 700001.*call again"):
        fetch(url, path, attempts=1)
    assert left(path) == []


def test_what_is_not_there_fails_at_once_by_name(server, url, path):
    with pytest.raises(InputError, match=r"/mug\.tgz.*404"):
        fetch(f"{server.url}/mug.tgz", path)
    assert len(server.requests) == 1
    assert not path.parent.exists()


def test_nobody_there_is_said_after_some_attempts(path):
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    with pytest.raises(InputError, match=rf":{port}/drill\.tgz.*2 attempts.*call again"):
        fetch(f"http://127.0.0.1:{port}/drill.tgz", path, attempts=2, pause_s=0)


@pytest.mark.parametrize("address", ["file:///etc/passwd", "ftp://host/x", "/etc/passwd"])
def test_other_kinds_of_addresses_are_refused(address, path):
    with pytest.raises(InputError, match=f"{address}.*https"):
        fetch(address, path)


def test_a_disk_that_is_too_small_is_noticed_before(server, url, path, monkeypatch):
    monkeypatch.setattr(transfer, "RESERVE", 1 << 60)
    with pytest.raises(InputError, match=r"new folder.*make room"):
        fetch(url, path)
    assert not path.exists()


def test_a_disk_that_fills_up_is_left_as_it_was(url, path, monkeypatch):
    opened = Path.open

    def full(self, mode="r", *arguments, **options):
        file = opened(self, mode, *arguments, **options)
        if self.suffix != ".tgz":
            return file

        class Full:
            def __enter__(self):
                return self

            def __exit__(self, *_):
                file.close()

            def write(self, block):
                file.write(block[:10])
                raise OSError(errno.ENOSPC, "No space left on device")

        return Full()

    monkeypatch.setattr(Path, "open", full)
    with pytest.raises(InputError, match=r"new folder.*make room"):
        fetch(url, path)
    monkeypatch.undo()
    assert left(path) == []

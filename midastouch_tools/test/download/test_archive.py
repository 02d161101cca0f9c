"""Archives: plain files come out, everything else is refused as a whole."""

import re
import stat
import zipfile

import pytest

from midastouch_common.errors import InputError
from midastouch_tools.download import archive
from midastouch_tools.download.archive import extract


def zipped(path, *members):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as out:
        for name, content in members:
            out.writestr(name, content)
    return path


def test_files_and_folders_come_out(tmp_path):
    packed = zipped(tmp_path / "a.zip", ("mug/mesh.ply", b"ply"), ("mug/deep/er/note.txt", b"hello"), ("top", b""))
    assert extract(packed, tmp_path / "out") == 3
    found = {str(p.relative_to(tmp_path / "out")): p.read_bytes() for p in (tmp_path / "out").rglob("*") if p.is_file()}
    assert found == {"mug/mesh.ply": b"ply", "mug/deep/er/note.txt": b"hello", "top": b""}


def link() -> zipfile.ZipInfo:
    info = zipfile.ZipInfo("link")
    info.external_attr = (stat.S_IFLNK | 0o777) << 16
    return info


@pytest.mark.parametrize(
    ("member", "reason"),
    [(name, re.escape(name)) for name in ("../evil", "a/../../evil", "/evil", "a/..", "..\\evil", "C:\\evil")]
    + [("good", "'good'.*twice"), (link(), "link")],
)
def test_one_evil_member_condemns_the_archive(tmp_path, member, reason):
    packed = zipped(tmp_path / "a.zip", ("good", b"x"), (member, b"/etc"))
    with pytest.raises(InputError, match=rf"a\.zip.*{reason}"):
        extract(packed, tmp_path / "out")
    assert [p.name for p in tmp_path.iterdir()] == ["a.zip"]


def test_damage_leaves_nothing(tmp_path):
    packed = zipped(tmp_path / "a.zip", ("good", b"x" * 50_000), ("more", bytes(range(256)) * 100))
    whole = packed.read_bytes()
    listed, end = whole.index(b"PK\x01\x02"), whole.index(b"PK\x05\x06")
    # an unknown compression, a member without a name, one that begins before the file
    changed = [
        whole[:at] + value + whole[at + len(value) :]
        for at, value in ((listed + 10, b"\x63"), (listed + 28, b"\0"), (end + 16, b"\xff\xff\xff\x7f"))
    ]
    for damaged in (whole[: len(whole) // 2], b"nonsense", b"", *changed):
        packed.write_bytes(damaged)
        with pytest.raises(InputError, match=r"a\.zip.*download it again"):
            extract(packed, tmp_path / "out")
        assert [p.name for p in tmp_path.iterdir()] == ["a.zip"]


def test_more_than_the_disk_holds_is_noticed_before(tmp_path, monkeypatch):
    monkeypatch.setattr(archive, "RESERVE", 1 << 60)
    packed = zipped(tmp_path / "a.zip", ("x", b"1"))
    with pytest.raises(InputError, match=r"a\.zip.*make room"):
        extract(packed, tmp_path / "out")
    assert [p.name for p in tmp_path.iterdir()] == ["a.zip"]

import sys

import numpy as np
import pytest

from midastouch_tools.cli import main
from midastouch_tools.export.recording import Recording


def test_the_files_hold_what_the_recordings_do(runs, h5py, tmp_path):
    out = tmp_path / "exported"
    assert main(["export", *map(str, runs), "--format", "hdf5", "--out", str(out)]) == 0
    assert sorted(file.name for file in out.iterdir()) == ["episode_000000.hdf5", "episode_000001.hdf5"]
    for path, name, file_name in zip(runs, ("cup", "can"), sorted(out.iterdir()), strict=True):
        recording = Recording(path)
        rows = list(recording.rows())
        with h5py.File(file_name) as file:
            assert dict(file.attrs)["object"] == name
            assert file.attrs["source"] == f"{path.parent.name}/{path.name}"
            assert (file.attrs["format"], file.attrs["version"]) == ("midastouch recording", 1)
            assert set(file) == {column.name for column in recording.columns}
            for column in recording.columns:
                expected = np.stack([row[column.name] for row in rows])
                found = file[column.name]
                assert (found[()].reshape(expected.shape) == expected).all()
                assert found.dtype == column.dtype
                assert found.attrs["description"] == column.description
                assert list(found.attrs["names"]) == list(column.names)
            assert file["filter_state"].shape == (len(rows),)
            assert file.attrs["filter_states"][file["filter_state"][3]] == "converged"


def test_what_fails_leaves_nothing_behind(runs, h5py, tmp_path, capsys):
    whole = runs[0].read_bytes()
    path = tmp_path / "half.mcap"
    path.write_bytes(whole[: len(whole) // 2])
    assert main(["export", str(path), "--format", "hdf5", "--out", str(tmp_path / "exported")]) == 2
    assert "half.mcap" in capsys.readouterr().err
    assert not list(tmp_path.glob("*exported*"))


@pytest.mark.parametrize(("kind", "module"), [("hdf5", "h5py"), ("lerobot", "pyarrow")])
def test_without_the_extra_the_mend_is_said(runs, tmp_path, monkeypatch, capsys, kind, module):
    monkeypatch.delitem(sys.modules, f"midastouch_tools.export.{kind}", raising=False)
    monkeypatch.setitem(sys.modules, module, None)
    assert main(["export", str(runs[0]), "--format", kind, "--out", str(tmp_path / "exported")]) == 2
    assert "tools/requirements/export.txt" in capsys.readouterr().err

import numpy as np
import pytest

from midastouch_perception.state_dict import random_state
from midastouch_perception.tcn import load_tcn, minkloc3d_network
from midastouch_tools import cli


@pytest.fixture
def checkpoint(tmp_path):
    path = tmp_path / "tcn_weights.npz"
    np.savez(path, **random_state(minkloc3d_network.expected_shapes(), np.random.default_rng(0)))
    return path


def test_the_printed_option_names_a_usable_network(checkpoint, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["import-weights", "tcn_weights.npz", "--voxel-size", "0.01"]) == 0
    option, path = capsys.readouterr().out.split()[-2:]
    assert option == "--tcn"
    assert load_tcn(path).dim == 256


def test_a_failed_import_leaves_nothing_behind(checkpoint, tmp_path, capsys):
    checkpoint.write_bytes(checkpoint.read_bytes()[:-100])
    assert cli.main(["import-weights", str(checkpoint), "--out", str(tmp_path / "out")]) == 2
    assert "tcn_weights.npz: not a complete" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()

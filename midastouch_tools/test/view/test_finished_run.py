"""Runs read from a bag and from a result of evaluate."""

import json

import numpy as np
import pytest
from recorded import write

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_tools.bags.messages import sequence_messages
from midastouch_tools.view.finished_run import load

from .conftest import POSES, evaluation


@pytest.fixture
def result(tmp_path):
    def write(content) -> str:
        path = tmp_path / "result.json"
        path.write_text(json.dumps(content))
        return str(path)

    return write


def test_trials_of_an_evaluation_are_estimates_side_by_side(result):
    run = load(result(evaluation("box/00")))
    assert (run.name, run.mesh) == ("box/00", "box.ply")
    assert [m.label for m in run.moments][1] == "frame 5, converged in 1 of 2 trials"
    first, second, _ = run.moments
    assert first.estimates[1] is None
    np.testing.assert_array_equal(second.estimates[1], se3.from_xyzquat(POSES[1]))
    np.testing.assert_array_equal(second.truth, se3.from_xyzquat(POSES[1]))
    assert len(first.particles) == len(first.modes) == len(first.contact) == 0


def test_one_of_several_sequences_is_asked_for(result):
    path = result(evaluation("box/00", "cup/01"))
    with pytest.raises(InputError, match=r"--sequence.*box/00, cup/01"):
        load(path)
    assert load(path, "cup/01").name == "cup/01"


@pytest.mark.parametrize("content", [{}, {"sequences": [], "trials": []}, {"sequences": [{}], "trials": [{}]}])
def test_other_results_are_refused(result, content):
    with pytest.raises(InputError, match=r"result.json: "):
        load(result(content))


@pytest.mark.parametrize("name", ["run.txt", "."])
def test_what_is_no_run_is_said(tmp_path, name):
    (tmp_path / "run.txt").touch()
    with pytest.raises(InputError, match="neither a bag"):
        load(tmp_path / name)
    with pytest.raises(InputError, match=r"missing\.mcap: no such bag or result file"):
        load(tmp_path / "missing.mcap")


def test_a_bag_without_results_is_said(simulated_sequence, tmp_path):
    path = tmp_path / "inputs.mcap"
    write(path, *sequence_messages(simulated_sequence(2)))
    with pytest.raises(InputError, match="no results; replay it, and record that with the node recorder"):
        load(path)

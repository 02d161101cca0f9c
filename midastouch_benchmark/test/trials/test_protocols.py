import dataclasses

import numpy as np
import pytest

from midastouch_benchmark.statistics.accuracy import grasp_summary
from midastouch_benchmark.trials.disturbances import UndisturbedSlide
from midastouch_benchmark.trials.grasps import HOLDS, PINCHED, GraspRecord, grasp, pinch
from midastouch_benchmark.trials.protocols import PROTOCOLS, chosen_protocol
from midastouch_benchmark.trials.trial import TrialFrame, run_trial
from midastouch_benchmark.trials.variants import DEFAULT, VARIANTS
from midastouch_benchmark.trials.yardstick import Yardstick
from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.pose_metric import pose_errors
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.touch import Measurement
from midastouch_filter.filter import ParticleFilter
from midastouch_perception.sensor_model import SensorModel
from midastouch_simulation.grasp import CONTACTS
from midastouch_tools.cli import build_parser
from midastouch_tools.datasets import load_sequence
from midastouch_tools.datasets.slide_simulation import simulate_grasp_sequence


def test_help_names_every_protocol(capsys):
    with pytest.raises(SystemExit):
        build_parser().parse_args(["benchmark", "--help"])
    listed = capsys.readouterr().out.partition("--protocol takes one of:")[2].split()
    assert set(PROTOCOLS) <= set(listed)


def test_an_unknown_one_is_refused():
    with pytest.raises(InputError, match=r"--protocol stormy: .*plain, uniform"):
        chosen_protocol("stormy")


@pytest.mark.parametrize("name", ["lift", "kidnap", "jump"])
def test_what_needs_a_leap_has_one(name):
    assert PROTOCOLS[name].slides.leap is not None


NOISE = se3.exp(np.array([2e-4, -3e-4, 1e-4, 0.01, 0, -0.01]))


@pytest.fixture
def contacts(draw_contacts) -> list[TrialFrame]:
    """A grasp, as a sequence has it."""
    poses, codes = draw_contacts(CONTACTS, np.random.default_rng(0))
    pairs = zip(poses, codes, strict=True)
    return [
        TrialFrame(i, Measurement(True, code), {}, pose @ NOISE, pose, 0.05) for i, (pose, code) in enumerate(pairs)
    ]


@pytest.fixture
def frames(contacts) -> list[TrialFrame]:
    return grasp(UndisturbedSlide(contacts, np.random.default_rng(0))).frames


def test_a_grasp_is_held_still_for_five_seconds(frames, contacts):
    assert sum(frame.seconds for frame in frames) == pytest.approx(5.0)
    moved = pose_errors(np.stack([frame.measured for frame in frames]), contacts[0].measured)
    assert 0 < np.median(moved[0]) < 1e-4
    assert len({frame.measurement.code.tobytes() for frame in frames}) == len(frames)


def test_pinches_are_held_still_and_opened_between_without_touching(contacts):
    others = {"finger_2": dataclasses.replace(contacts[2].measurement, T_gel_finger=se3.translation([0, 0, -0.05]))}
    hand = [dataclasses.replace(frame, others=others) for frame in contacts]
    frames = pinch(UndisturbedSlide(hand, np.random.default_rng(0))).frames
    touching = np.array([frame.measurement.in_contact for frame in frames])
    assert (touching == [frame.others["finger_2"].in_contact for frame in frames]).all()
    ends = [round(time / 0.05) for time in PINCHED]
    assert np.flatnonzero(np.diff([*touching, False]) & touching).tolist() == [end - 1 for end in ends]
    for end, contact in zip(ends, contacts, strict=True):
        np.testing.assert_allclose(frames[end - 1].truth, contact.truth)
    air = frames[ends[0] + 4]
    assert np.linalg.norm(air.measured[:3, 3] - contacts[0].measured[:3, 3]) == pytest.approx(0.03)
    assert air.others["finger_2"].T_gel_finger[2, 3] == pytest.approx(-0.05)


def test_further_fingers_are_known_relative_to_the_first(frames, contacts):
    for k, name in enumerate(("finger_2", "finger_3"), 1):
        touch = frames[12].others[name]
        assert touch.code @ contacts[k].measurement.code > 0.99
        there = contacts[0].truth @ touch.T_gel_finger
        np.testing.assert_allclose(there, contacts[k].truth @ NOISE, atol=1e-9)


@pytest.mark.parametrize(("name", "heard"), [(DEFAULT, 2), ("contact_1", 0), ("contacts_2", 1), ("paper", 0)])
def test_a_variant_hears_fewer_fingers(frames, name, heard):
    assert list(VARIANTS[name].frame(frames[0]).others) == ["finger_2", "finger_3"][:heard]


def test_more_contacts_put_more_probability_at_the_true_place(frames, mesh, codebook):
    particle_filter = ParticleFilter(mesh, codebook, FilterConfig(max_particles=5000, threads=1))
    shares = []
    for name in ("contact_1", DEFAULT):
        particle_filter.reset(0)
        particle_filter.initialise_uniform()
        record = GraspRecord(Yardstick(), HOLDS)
        run_trial([VARIANTS[name].frame(f) for f in frames], particle_filter, record, series=False)
        _, row = record.result()["held"]
        shares.append(row["share"])
    assert shares[1] > shares[0] + 0.05


def test_the_summary_is_by_the_time_a_grasp_was_held(make_trial):
    good = {"found": True, "share": 0.9, "right": True, "converged": True}
    bad = {"found": False, "share": 0.1, "right": False, "converged": True}
    trials = [make_trial("default", 0, 1.0, {}) | {"slide": k, "held": [bad, good]} for k in range(4)]
    first, second = grasp_summary(trials)
    assert (first["found"]["share"], first["share"]["share"], first["converged_wrong"]["share"]) == (0, 0.1, 1)
    assert (second["trials"], second["right"]["share"], second["converged_wrong"]["share"]) == (4, 1, 0)
    assert second["found"]["interval"][0] < 1
    assert grasp_summary([make_trial("default", 0, 1.0, {})]) is None


@pytest.mark.slow
def test_a_grasp_is_a_sequence_with_a_frame_for_each_contact(tmp_path, tool):
    sensor = SensorModel.load("digit_tacto")
    for folder in ("a", "b"):
        simulate_grasp_sequence(tool, sensor, 5, tmp_path / folder, False)
    one, again = (load_sequence(tmp_path / folder) for folder in ("a", "b"))
    assert one.n_frames == CONTACTS
    np.testing.assert_array_equal(one.poses_true, again.poses_true)
    assert all(one.penetration_truth(k).max() > 1e-4 for k in range(CONTACTS))

import numpy as np
import pytest

from midastouch_benchmark.trials.trial import TrialFrame
from midastouch_benchmark.trials.variants import DEFAULT, PAPER, SETS, VARIANTS, chosen_variants
from midastouch_common import se3
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.presets import PRESETS
from midastouch_filter.core.touch import Measurement


@pytest.mark.parametrize("name", VARIANTS)
def test_every_variant_is_valid_and_differs_from_the_default(name):
    variant = VARIANTS[name]
    if variant.method:
        assert (variant.method == "paper") == (variant.group == PAPER)
        assert variant.settings == {}
    else:
        config = variant.config(FilterConfig(), threads=1)
        assert config.threads == 1
        same = config == FilterConfig(threads=1) and set(variant.describe()) == {"summary", "group"}
        assert same == (name == DEFAULT)


def test_a_variant_says_what_differs():
    assert VARIANTS["5k"].describe() == {
        "summary": "at most 5,000 poses at the start and after a lift", "group": "budget", "max_particles": 5000,
    }  # fmt: skip
    assert VARIANTS["no_codes"].describe()["codes"] is False
    assert VARIANTS["book_5k"].describe()["codebook_size"] == 5000


@pytest.mark.slow
@pytest.mark.parametrize("name", ["no_rest_gate", "no_repeat_gate"])
def test_a_gate_is_opened_by_its_name_in_the_status(mesh, codebook, name):
    def skipped(variant):
        particle_filter = variant.filter(mesh, codebook, FilterConfig(), threads=1)
        particle_filter.initialise_uniform()
        measurement = Measurement(True, codebook.codes[0], 1e-4)
        step = se3.translation([1e-3, 0, 0])
        for odometry in (None, np.eye(4), step, np.eye(4)):
            status = particle_filter.step(odometry, measurement).status
        return [status.skipped[gate] for gate in VARIANTS[name].open_gates]

    assert all(count > 0 for count in skipped(VARIANTS[DEFAULT]))
    assert skipped(VARIANTS[name]) == [0]


def test_a_variant_is_laid_over_the_settings_given():
    config = VARIANTS["5k"].config(FilterConfig(tested_poses=200, keyframe_spacing=0.03), threads=0)
    assert (config.tested_poses, config.max_particles, config.keyframe_spacing) == (200, 5000, 0.03)


def test_presets_are_variants_whatever_the_settings_given():
    for base in PRESETS.values():
        config = VARIANTS["fast"].config(FilterConfig(**base), threads=0)
        assert config == FilterConfig(**PRESETS["fast"])


def test_names_and_sets_are_chosen_once_the_default_first():
    assert chosen_variants([]) == [DEFAULT]
    assert chosen_variants(["paper", "gates", "no_repeat_gate"]) == [DEFAULT, "paper", "no_rest_gate", "no_repeat_gate"]
    assert chosen_variants(["all"]) == list(VARIANTS)
    assert {"no_maps", "no_codes", "no_drift", "no_lift", "no_rest_gate"} < set(SETS["ablation"])
    assert {"fast", "5k", "work_360", "align_1", "book_10k"} <= set(SETS["front"])


def test_the_front_goes_down_to_a_tenth_of_the_work_and_up():
    values = [VARIANTS[name].settings.get("alignments_per_second", 3_600) for name in SETS["front"]]
    assert min(values) == FilterConfig.alignments_per_second / 10
    assert max(values) > FilterConfig.alignments_per_second


def test_without_codes_every_touch_fits_every_pose_alike(codebook):
    variant = VARIANTS["no_codes"]
    first, second = codebook.codes[:2]
    others = {"finger_2": Measurement(True, second, 1e-4, "t"), "finger_3": Measurement(False)}
    frame = TrialFrame(4, Measurement(True, first, 1e-4, "t"), {}, np.eye(4), np.eye(4), others=others)
    seen, book = variant.frame(frame), variant.codebook(codebook)
    np.testing.assert_allclose(book.codes @ seen.measurement.code, 1.0, atol=1e-3)
    np.testing.assert_array_equal(seen.others["finger_2"].code, seen.measurement.code)
    assert seen.others["finger_3"].code is None
    assert (book.meta, seen.index, seen.measurement.network_id) == (codebook.meta, 4, "t")


def test_other_variants_are_given_what_there_is(codebook):
    frame = TrialFrame(0, Measurement(True, codebook.codes[0]), {}, np.eye(4), np.eye(4))
    assert VARIANTS[DEFAULT].frame(frame).measurement is frame.measurement
    assert VARIANTS[DEFAULT].codebook(codebook) is codebook

import numpy as np
import pytest

from midastouch_benchmark.trials.trial import TrialFrame
from midastouch_benchmark.trials.variants import DEFAULT, PAPER, SETS, VARIANTS, ShortCodes, chosen_variants
from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.presets import PRESETS
from midastouch_filter.core.touch import Measurement
from midastouch_filter.paper_filter import PaperConfig
from midastouch_perception.codebook import Codebook


@pytest.mark.parametrize("name", VARIANTS)
def test_every_variant_is_a_valid_setting_that_differs_from_the_default(name):
    variant = VARIANTS[name]
    config = variant.config(FilterConfig(), threads=1)
    if variant.method:
        assert not isinstance(config, FilterConfig)
        assert isinstance(config, PaperConfig) == (variant.group == PAPER)
    else:
        assert config.threads == 1
        same = config == FilterConfig(threads=1) and set(variant.describe()) == {"summary", "group"}
        assert same == (name == DEFAULT)


def test_a_variant_says_what_differs():
    assert VARIANTS["1k"].describe() == {
        "summary": "at most 1,000 poses at the start and after a lift", "group": "poses", "max_particles": 1000,
    }  # fmt: skip
    assert VARIANTS["code_16"].describe()["code_length"] == 16
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
    config = VARIANTS["1k"].config(FilterConfig(tested_poses=200, correlation_length=0.03), threads=0)
    assert (config.tested_poses, config.max_particles, config.correlation_length) == (200, 1000, 0.03)


def test_presets_are_variants_whatever_the_settings_given():
    for base in PRESETS.values():
        config = VARIANTS["fast"].config(FilterConfig(**base), threads=0)
        assert config == FilterConfig(**PRESETS["fast"])


def test_names_and_sets_are_chosen_once_each_with_the_default_first():
    assert chosen_variants([]) == [DEFAULT]
    assert chosen_variants(["paper", "gates", "no_repeat_gate"]) == [DEFAULT, "paper", "no_rest_gate", "no_repeat_gate"]
    assert chosen_variants(["all"]) == list(VARIANTS)
    assert {"no_refinement", "no_drift", "no_lift", "no_push", "no_rest_gate"} < set(SETS["ablation"])
    assert {"fast", "1k", "work_180", "work_all", "align_8", "code_16", "book_10k"} <= set(SETS["front"])


def test_work_is_varied_around_the_default():
    values = {name: VARIANTS[name].settings.get("alignments_per_second") for name in SETS["front"]}
    assert 0 in values.values()
    assert FilterConfig.alignments_per_second not in values.values()


def test_an_unknown_name_is_refused():
    with pytest.raises(InputError, match=r"--variant best: .*default, fast"):
        chosen_variants(["best"])


@pytest.fixture
def codes() -> np.ndarray:
    """500 unit codes of 12 numbers of which only 3 directions, hidden by a turn, hold anything."""
    rng = np.random.default_rng(0)
    flat = rng.standard_normal((500, 3)) @ np.linalg.qr(rng.standard_normal((12, 12)))[0][:3]
    return flat / np.linalg.norm(flat, axis=1, keepdims=True)


def test_cosines_stay_where_nothing_is_lost(codes):
    short = ShortCodes(codes, 3).shorten(codes)
    assert short.shape == (500, 3)
    np.testing.assert_allclose(short @ short.T, codes @ codes.T, atol=1e-5)


def test_what_is_lost_is_the_least(codes):
    rng = np.random.default_rng(1)
    noisy = codes + 1e-3 * rng.standard_normal(codes.shape)
    kept = ShortCodes(noisy, 3).shorten(noisy)
    np.testing.assert_allclose(kept @ kept.T, codes @ codes.T, atol=0.02)
    two = ShortCodes(noisy, 2).shorten(noisy)
    assert np.linalg.norm(two, axis=1) == pytest.approx(1, abs=1e-5)
    assert np.abs(two @ two.T - codes @ codes.T).max() > 0.5


def test_book_and_touch_are_cut_alike(codes):
    short = ShortCodes(codes, 3)
    book = short.codebook(Codebook(np.repeat(np.eye(4)[None], 500, axis=0), codes, {"tcn": "t"}))
    frame = TrialFrame(4, Measurement(True, codes[7].astype(np.float32), 1e-4, "t"), {}, np.eye(4), np.eye(4))
    cut = short.frame(frame)
    np.testing.assert_allclose(book.codes[7], cut.measurement.code, atol=1e-6)
    assert (book.meta, cut.index, cut.measurement.network_id) == ({"tcn": "t"}, 4, "t")


def test_a_frame_without_contact_stays_as_it_is(codes):
    frame = TrialFrame(0, Measurement(False), {}, np.eye(4), np.eye(4))
    assert ShortCodes(codes, 3).frame(frame).measurement is frame.measurement

import numpy as np
import pytest

from midastouch_benchmark.baselines.paper_filter import PaperConfig
from midastouch_benchmark.trials.variants import DEFAULT, PAPER, SETS, VARIANTS, chosen_variants
from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.presets import BALANCED, PRESETS
from midastouch_filter.core.touch import Measurement


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
        "summary": "at most 1,000 particles", "group": "particles", "max_particles": 1000,
    }  # fmt: skip
    assert VARIANTS["code_16"].describe()["code_length"] == 16
    assert VARIANTS["book_5k"].describe()["codebook_size"] == 5000


@pytest.mark.slow
@pytest.mark.parametrize("name", ["no_rest_gate", "no_repeat_gate", "no_book_gate", "no_modes_gate"])
def test_a_gate_is_opened_by_its_name_in_the_status(mesh, codebook, name):
    def skipped(variant):
        config = FilterConfig(min_particles=10, max_particles=20)
        particle_filter = variant.filter(mesh, codebook, config, threads=1)
        particle_filter.initialise_uniform()
        felt = Measurement(True, codebook.codes[0], 1e-4)
        step = se3.make(np.eye(3), np.array([1e-3, 0, 0]))
        for odometry in (None, np.eye(4), step, np.eye(4)):
            status = particle_filter.step(odometry, felt).status
        return [status.skipped[gate] for gate in VARIANTS[name].open_gates]

    assert all(count > 0 for count in skipped(VARIANTS[DEFAULT]))
    assert skipped(VARIANTS[name]) == [0]


def test_a_variant_is_laid_over_the_settings_given():
    base = FilterConfig(min_particles=200, correlation_length=0.02)
    config = VARIANTS["1k"].config(base, threads=0)
    assert (config.min_particles, config.max_particles, config.correlation_length) == (200, 1000, 0.02)


@pytest.mark.parametrize("name", ["fast", "accurate"])
def test_presets_are_variants_whatever_the_settings_given(name):
    for base in PRESETS.values():
        config = VARIANTS[name].config(FilterConfig(**base), threads=0)
        assert config == FilterConfig(**PRESETS[name])


def test_names_and_sets_are_chosen_once_each_with_the_default_first():
    assert chosen_variants([]) == [DEFAULT]
    assert chosen_variants(["paper", "counts", "20k"]) == [DEFAULT, "paper", "1k", "20k", "50k"]
    assert chosen_variants(["all"]) == list(VARIANTS)
    assert {"no_refinement", "no_recovery", "no_kld", "no_rest_gate"} < set(SETS["ablation"])
    assert {*PRESETS, "1k", "align_8", "code_16", "book_10k"} - {BALANCED} <= set(SETS["front"])


def test_an_unknown_name_is_refused():
    with pytest.raises(InputError, match="--variant best: not known; there are default, fast"):
        chosen_variants(["best"])

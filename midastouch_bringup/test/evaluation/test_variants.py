import pytest

from midastouch_bringup.evaluation.variants import DEFAULT, SETS, VARIANTS, chosen_variants
from midastouch_filter.config import FilterConfig
from midastouch_filter.paper_filter import PaperConfig
from midastouch_perception.errors import InputError


@pytest.mark.parametrize("name", VARIANTS)
def test_every_variant_is_a_valid_setting_that_differs_from_the_default(name):
    config = VARIANTS[name].config(FilterConfig(), threads=1)
    if VARIANTS[name].paper:
        assert isinstance(config, PaperConfig)
    else:
        assert config.threads == 1
        assert (config == FilterConfig(threads=1)) == (name == DEFAULT)


def test_a_variant_is_laid_over_the_settings_given():
    base = FilterConfig(min_particles=200, correlation_length=0.02)
    config = VARIANTS["1k"].config(base, threads=0)
    assert (config.min_particles, config.max_particles, config.correlation_length) == (200, 1000, 0.02)


def test_names_and_sets_are_chosen_once_each_with_the_default_first():
    assert chosen_variants([]) == [DEFAULT]
    assert chosen_variants(["paper", "counts", "5k"]) == [DEFAULT, "paper", "1k", "5k", "10k"]
    assert chosen_variants(["all"]) == list(VARIANTS)
    assert {"no_refinement", "no_recovery", "no_kld"} < set(SETS["ablation"])


def test_an_unknown_name_is_refused():
    with pytest.raises(InputError, match="--variant best: not known; there are default, paper"):
        chosen_variants(["best"])

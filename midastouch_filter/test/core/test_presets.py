import pytest

from midastouch_common.errors import InputError
from midastouch_filter import FilterConfig, preset
from midastouch_filter.core.presets import BALANCED, PRESETS, preset_in_words


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_is_valid_and_says_what_it_changes(name):
    config, default = FilterConfig(**preset(name)), FilterConfig()
    assert (config == default) == (name == BALANCED)
    for key, value in preset(name).items():
        assert value != getattr(default, key)
        assert f"{key} {value}" in preset_in_words(name)


def test_presets_turn_the_same_knobs_each_to_its_side():
    """So that one laid over another is that one alone."""
    fast, accurate = preset("fast"), preset("accurate")
    assert set(fast) == set(accurate)
    for key, value in vars(FilterConfig()).items():
        if key in fast:
            assert fast[key] < value < accurate[key]


@pytest.mark.parametrize("name", ["quick", ["fast"]])
def test_an_unknown_name_is_refused(name):
    with pytest.raises(InputError, match="not known; there are fast, balanced, accurate"):
        preset(name)

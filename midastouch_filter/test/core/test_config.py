import dataclasses

import pytest

from midastouch_common.errors import InputError
from midastouch_filter import preset
from midastouch_filter.core.config import FilterConfig, by_present_names
from midastouch_filter.core.presets import BALANCED, PRESETS, preset_in_words


def test_every_field_says_what_it_means_and_its_default_is_in_range():
    config = FilterConfig()
    for item in dataclasses.fields(FilterConfig):
        assert len(item.metadata["doc"]) > 10
        assert "unit" in item.metadata
        if item.type != "bool":
            assert item.metadata["low"] <= getattr(config, item.name) <= item.metadata["high"]


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"max_particles": 0}, "max_particles.* 0"),
        ({"max_particles": 1000.5}, "max_particles.*1000.5"),
        ({"min_particles": 600, "max_particles": 500}, "min_particles.*max_particles"),
        ({"temperature": -1.0}, "temperature"),
        ({"temperature": float("nan")}, "temperature.*nan"),
        ({"refinement": 1}, "refinement.*true"),
        ({"pf_err": "small"}, "pf_err.*small"),
        ({"threads": True}, "threads"),
    ],
)
def test_wrong_values_are_named(change, complaint):
    with pytest.raises(InputError, match=complaint):
        FilterConfig(**change)


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_is_valid_and_says_what_it_changes(name):
    config, default = FilterConfig(**preset(name)), FilterConfig()
    assert (config == default) == (name == BALANCED)
    for key, value in preset(name).items():
        assert value != getattr(default, key)
        assert f"{key} {value}" in preset_in_words(name)


@pytest.mark.parametrize("name", ["quick", ["fast"]])
def test_an_unknown_name_is_refused(name):
    with pytest.raises(InputError, match=r"preset.*fast, balanced"):
        preset(name)


def test_a_field_that_is_gone_names_what_is_in_its_place():
    with pytest.raises(InputError, match=r"recovery is gone: .*recovery_fraction"):
        by_present_names({"recovery": True, "max_particles": 7})
    assert by_present_names({"max_particles": 7}) == {"max_particles": 7}

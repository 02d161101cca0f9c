import dataclasses

import pytest

from midastouch_common.errors import InputError
from midastouch_filter import preset
from midastouch_filter.core.config import GONE, FilterConfig, by_present_names
from midastouch_filter.core.presets import BALANCED, PAPER, PRESETS, preset_in_words


def test_every_field_is_explained_and_its_default_in_range():
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
        ({"temperature": -1.0}, "temperature"),
        ({"temperature": float("nan")}, "temperature.*nan"),
        ({"refinement": 1}, "refinement.*true"),
        ({"keyframe_spacing": "small"}, "keyframe_spacing.*small"),
        ({"threads": True}, "threads"),
    ],
)
def test_wrong_values_are_named(change, complaint):
    with pytest.raises(InputError, match=complaint):
        FilterConfig(**change)


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_is_valid_and_says_what_it_changes(name):
    config, default = FilterConfig(**preset(name)), FilterConfig()
    assert (config == default) == (name in (BALANCED, PAPER))
    for key, value in preset(name).items():
        assert value != getattr(default, key)
        assert f"{key} {value}" in preset_in_words(name)


@pytest.mark.parametrize("name", GONE)
def test_a_field_that_is_gone_names_what_is_in_its_place(name):
    assert name not in {item.name for item in dataclasses.fields(FilterConfig)}
    with pytest.raises(InputError, match=f"{name} is gone: "):
        by_present_names({name: 1.0, "max_particles": 7})


def test_a_former_name_warns_and_is_refused_beside_the_new_one():
    with pytest.warns(FutureWarning, match="relief_fit is now penetration_fit"):
        assert by_present_names({"relief_fit": 0.7, "threads": 1}) == {"penetration_fit": 0.7, "threads": 1}
    with pytest.raises(InputError, match="both are given"):
        by_present_names({"relief_fit": 0.7, "penetration_fit": 0.6})

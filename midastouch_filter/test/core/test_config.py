import dataclasses

import pytest

from midastouch_common.errors import InputError
from midastouch_filter.core.config import FilterConfig


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
        ({"max_particles": 0}, "max_particles: 0 is outside"),
        ({"max_particles": 1000.5}, "max_particles: 1000.5 is not a whole number"),
        ({"min_particles": 600, "max_particles": 500}, "min_particles: 600 is more than"),
        ({"temperature": -1.0}, "temperature"),
        ({"temperature": float("nan")}, "temperature: nan is outside"),
        ({"recovery": 1}, "recovery: 1 is not true or false"),
        ({"pf_err": "small"}, "pf_err: 'small' is not a number"),
        ({"threads": True}, "threads"),
    ],
)
def test_wrong_values_are_named(change, complaint):
    with pytest.raises(InputError, match=complaint):
        FilterConfig(**change)

"""Which settings the filter of the node has."""

import pytest

from midastouch_common.errors import InputError
from midastouch_filter.core.presets import PRESETS
from midastouch_filter.nodes.filter_parameters import config_of
from midastouch_filter.nodes.particle_filter import ParticleFilterNode

pytestmark = pytest.mark.dds


def test_a_preset_gives_defaults_and_what_is_set_goes_over_it(graph):
    node = graph.add(ParticleFilterNode, {"preset": "fast", "max_particles": 1234, "autostart": False})
    config = config_of(node.parameters)
    assert config.max_particles == 1234 != PRESETS["fast"]["max_particles"]
    assert config.refined_modes == PRESETS["fast"]["refined_modes"]
    assert node.get_parameter("refined_modes").value == config.refined_modes


def test_an_unknown_preset_ends_the_node(graph):
    with pytest.raises(InputError, match="'preset' must be one of fast, balanced, accurate, got 'quick'"):
        graph.add(ParticleFilterNode, {"preset": "quick"})

import numpy as np
import pytest

from midastouch_benchmark.trials.setup import load_filter_config, untouched_of
from midastouch_common.errors import InputError
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.presets import PRESETS


def written(tmp_path, text: str) -> str:
    path = tmp_path / "config.yaml"
    path.write_text(text)
    return str(path)


def test_without_a_file_the_defaults_hold():
    assert load_filter_config(None) == FilterConfig()


@pytest.mark.parametrize(
    "text",
    [
        "max_particles: 1234\n",
        "tdn:\n  ros__parameters: {max_particles: 7}\n"
        "particle_filter:\n  ros__parameters: {max_particles: 1234, base_frame_id: base}\n",
        "/left/particle_filter:\n  ros__parameters: {max_particles: 1234}\n",
        "/**:\n  ros__parameters: {max_particles: 1234, use_sim_time: true}\n",
        "/**:\n  ros__parameters: {max_particles: 7}\n/particle_filter:\n  ros__parameters: {max_particles: 1234}\n",
    ],
)
def test_settings_of_the_filter_are_found_in_every_kind_of_file(tmp_path, text):
    assert load_filter_config(written(tmp_path, text)) == FilterConfig(max_particles=1234)


def test_settings_of_a_file_go_over_a_preset(tmp_path):
    fast = PRESETS["fast"]
    assert load_filter_config(None, "fast") == FilterConfig(**fast)
    path = written(tmp_path, "preset: fast\nrefined_modes: 3\n")
    assert load_filter_config(path) == FilterConfig(**(fast | {"refined_modes": 3}))
    assert load_filter_config(path, "balanced") == FilterConfig(refined_modes=3)
    path = written(tmp_path, "particle_filter:\n  ros__parameters: {preset: fast, base_frame_id: base}\n")
    assert load_filter_config(path) == FilterConfig(**fast)


def test_the_papers_filter_is_no_settings_of_ours(tmp_path):
    for path, name in ((None, "paper"), (written(tmp_path, "preset: paper\n"), None)):
        with pytest.raises(InputError, match="--variant paper"):
            load_filter_config(path, name)


@pytest.mark.parametrize("text", ["relief_fit: 0.5\n", "particle_filter:\n  ros__parameters: {relief_fit: 0.5}\n"])
def test_a_former_name_counts_with_a_warning(tmp_path, text):
    with pytest.warns(FutureWarning, match="relief_fit is now penetration_fit"):
        config = load_filter_config(written(tmp_path, text))
    assert config == FilterConfig(penetration_fit=0.5)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("max_partikles: 5", "max_partikles"),
        ("max_particles: -5", "max_particles"),
        ("relief_fit: 0.5\npenetration_fit: 0.5", "give penetration_fit only"),
        ("max_particles: [", "YAML"),
        ("tdn:\n  ros__parameters: {tdn: fast}", "no parameters of particle_filter; there are those of tdn"),
        ("particle_filter:\n  ros__parameters: {max_partikles: 5}", "max_partikles"),
        (
            "/a/particle_filter:\n  ros__parameters: {seed: 1}\n/b/particle_filter:\n  ros__parameters: {seed: 2}",
            "a/particle_filter and of b/particle_filter",
        ),
        ("preset: quick", "quick.*fast, balanced"),
        ("preset: [fast]", "preset"),
        ("- 1", "name: value"),
    ],
)
def test_bad_settings_are_refused_naming_the_file(tmp_path, text, message):
    with pytest.raises(InputError, match=message) as caught:
        load_filter_config(written(tmp_path, text))
    assert "config.yaml" in str(caught.value)


def test_the_background_of_a_sequence_is_taken_or_estimated(simulated_sequence):
    sequence = simulated_sequence()
    free = untouched_of(sequence)
    assert free.source == "background.png"
    assert (free.image == 90).all()
    object.__setattr__(sequence, "background_path", None)
    free = untouched_of(sequence)
    assert free.source == "estimated from 5 frames"
    assert np.abs(free.image.astype(int) - sequence.image(2)).mean() < 5  # the median of the ramp of frames


def test_a_background_that_shows_contacts_is_doubted(simulated_sequence):
    sequence = simulated_sequence()
    object.__setattr__(sequence, "background_path", None)
    same = sequence.image(0)
    object.__setattr__(sequence, "image", lambda i: same)
    assert untouched_of(sequence).doubt == ""
    object.__setattr__(sequence, "image", lambda i: same + np.uint8(20 * i))
    assert "do not show all of the gel untouched; give the sensor's with --background" in untouched_of(sequence).doubt
    given = untouched_of(sequence, str(next((sequence.path / "tactile_images").glob("*.jpg"))))
    assert given.doubt == ""
    assert given.source.endswith(".jpg")

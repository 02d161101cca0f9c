import threading

import pytest
import trimesh

from midastouch_common.errors import InputError
from midastouch_filter import growth, quick_start
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.localiser import load_object
from midastouch_perception.objects import bundled_objects
from midastouch_perception.sensor_model import SensorModel

EYEBOLT = bundled_objects()["eyebolt"]


def test_a_mesh_alone_is_enough_for_a_filter(monkeypatch):
    monkeypatch.setattr(quick_start, "SIZE", 300)
    config = FilterConfig(min_particles=100, max_particles=200)
    loaded = quick_start.build_object(EYEBOLT, "fast", "digit_tacto", config, seed=0)
    assert (loaded.name, loaded.sensor.height) == ("eyebolt", 160)
    assert loaded.network_id.startswith("tcn_fast")
    spacing, gap = loaded.filter.object.lookup.spacing, loaded.filter.object.gap
    assert loaded.density == (
        f"codebook of 300 poses, {1e3 * spacing:.1f} mm apart (codes alone tell a place to {1e3 * gap:.1f} mm)"
    )
    assert 1e-3 < spacing < 20e-3
    loaded.filter.initialise_uniform()
    assert len(loaded.filter.poses) == 200


def test_a_sensor_of_ones_own_is_one_of_the_codebook_too(monkeypatch, tmp_path):
    """It is known by its file alone; a codebook outlives that."""
    monkeypatch.setattr(quick_start, "SIZE", 300)
    own = tmp_path / "my_touch.yaml"
    own.write_text(
        "width: 240\nheight: 320\nfocal: 300\ngel_distance: 0.022\n"
        "dome: {radius_x: 0.03, radius_y: 0.04, semi_axis_z: 0.03}\n"
    )
    config = FilterConfig(min_particles=100, max_particles=200)
    expected = SensorModel.load(own).for_maps.content_id
    _, codebook = quick_start.coarse_codebook(EYEBOLT, "fast", str(own), config)
    codebook.save(tmp_path / "eyebolt.npz")
    own.unlink()
    loaded = load_object(EYEBOLT, tmp_path / "eyebolt.npz", config, seed=0)
    assert loaded.sensor.content_id == expected
    assert loaded.filter.object.alignment is not None


def test_it_grows_once_it_is_localised_on(monkeypatch):
    monkeypatch.setattr(quick_start, "SIZE", 300)
    monkeypatch.setattr(growth, "LEVELS", (400,))
    finished = threading.Event()

    def levels(*arguments):
        yield from growth.levels(*arguments)
        finished.set()

    monkeypatch.setattr(quick_start, "levels", levels)
    config = FilterConfig(min_particles=100, max_particles=200)
    loaded = quick_start.build_object(EYEBOLT, "fast", "digit_tacto", config, seed=0)
    before = loaded.density
    loaded.take_growth()
    assert loaded.density == before
    loaded.growth.start()
    finished.wait()
    loaded.growth.close()
    assert loaded.coarse.endswith("; growing")
    loaded.take_growth()
    assert (len(loaded.filter.object.lookup), loaded.growth.failure, loaded.coarse) == (400, "", "")
    assert loaded.density.startswith("codebook of 400 poses")


def test_what_the_parameters_do_not_name_is_said(tmp_path):
    with pytest.raises(InputError, match="no_such_network"):
        quick_start.build_object(EYEBOLT, "no_such_network", "digit_tacto", FilterConfig(), 0)
    with pytest.raises(InputError, match="no_such_sensor"):
        quick_start.build_object(EYEBOLT, "fast", "no_such_sensor", FilterConfig(), 0)
    trimesh.creation.box((100, 50, 20)).export(tmp_path / "part.stl")
    with pytest.raises(InputError, match=r"part.stl: 100 m across; it looks like millimetres"):
        quick_start.build_object(tmp_path / "part.stl", "fast", "digit_tacto", FilterConfig(), 0)

"""A codebook that grows beside the filter: the thread, the filter that takes a denser one; a mesh alone."""

import threading

import numpy as np
import pytest
import trimesh

from midastouch_common.errors import InputError
from midastouch_filter import loaded_object
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.state import CONVERGED
from midastouch_filter.filter import ParticleFilter
from midastouch_filter.loaded_object import Growth, dense_codebook, load_object
from midastouch_filter.paper_filter import PaperFilter
from midastouch_perception.objects import bundled_objects
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.symmetry.search import ObjectSymmetry

pytestmark = pytest.mark.usefixtures("no_symmetry_search")
EYEBOLT = bundled_objects()["eyebolt"]
CONFIG = FilterConfig(threads=1)


@pytest.fixture
def grown():
    """Function (codebooks, prepare) -> a growth that has begun."""
    begun = []

    def start(build, prepare=lambda codebook: codebook) -> Growth:
        begun.append(Growth(build, prepare))
        begun[-1].start()
        return begun[-1]

    yield start
    for each in begun:
        each.close()


def test_what_was_made_is_given_out_once(grown):
    go_on = threading.Event()

    def build(pause):
        go_on.wait()
        return "dense"

    growth = grown(build, lambda codebook: f"prepared {codebook}")
    assert (growth.take(), growth.done) == (None, False)
    go_on.set()
    growth.close()
    assert (growth.take(), growth.take()) == ("prepared dense", None)
    assert (growth.done, growth.failure) == (True, "")


def test_it_stops_where_it_pauses(grown):
    began = threading.Event()

    def build(pause):
        began.set()
        while True:
            pause()

    growth = grown(build)
    began.wait()
    growth.close()
    assert (growth.done, growth.failure, growth.take()) == (True, "", None)


def test_why_there_is_no_denser_one_is_kept(grown):
    def build(pause):
        raise MemoryError("no room")

    growth = grown(build)
    growth.close()
    assert (growth.failure, growth.take()) == ("MemoryError: no room", None)


def coarse_book(world, **meta):
    codebook = world.make_codebook(world.poses[:1500], world.encode(world.poses[:1500]), world.of_surface)
    codebook.meta |= meta
    codebook.symmetry = ObjectSymmetry()
    return codebook


def test_belief_goes_on_over_a_denser_codebook(world, mapped_slide):
    running = mapped_slide.make_filter(coarse_book(world, sensor="digit_tacto"))
    running.initialise_gaussian(mapped_slide.poses[0], 0.03, 0.3)
    gap, prepared, states = running.object.gap, running.object.with_codebook(mapped_slide.codebook), []
    for k, (motion, touch) in enumerate(zip(mapped_slide.odometry, mapped_slide.touches, strict=True)):
        if k == 20:
            poses = running.poses
            running.take(prepared)
            np.testing.assert_array_equal(running.poses, poses)
            assert running.object.gap < 0.6 * gap
        states.append(running.step(motion, touch).status.state)
        running.deferred_update()
    assert states[-1] == CONVERGED


@pytest.mark.parametrize("started", [False, True])
def test_before_a_touch_it_starts_over_on_the_denser_codebook(world, started):
    running = ParticleFilter(world.mesh, coarse_book(world), CONFIG)
    if started:
        running.initialise_uniform()
    running.take(running.object.with_codebook(world.codebook))
    if not started:
        running.initialise_uniform()
    assert len(running.belief) == 8000


@pytest.fixture
def built(monkeypatch) -> threading.Event:
    """Codebooks have 300 poses, and grow to 400; set once that one is built."""
    monkeypatch.setattr(loaded_object, "SIZE", 300)
    monkeypatch.setattr(loaded_object, "DENSE", 400)
    built = threading.Event()

    def to_the_end(*arguments):
        codebook = dense_codebook(*arguments)
        built.set()
        return codebook

    monkeypatch.setattr(loaded_object, "dense_codebook", to_the_end)
    return built


@pytest.mark.parametrize(("paper", "kind"), [(False, ParticleFilter), (True, PaperFilter)])
def test_a_mesh_is_enough_for_a_filter_whose_codebook_grows(built, paper, kind):
    loaded = loaded_object.build_object(EYEBOLT, "fast", "digit_tacto", CONFIG, 0, paper)
    assert (loaded.name, loaded.sensor.height) == ("eyebolt", 160)
    assert loaded.network_id.startswith("tcn_fast")
    assert isinstance(loaded.filter, kind)
    assert (loaded.advisor is None) == paper
    if paper:
        return
    spacing, gap = loaded.filter.object.lookup.spacing, loaded.filter.object.gap
    assert all(part in loaded.density for part in ("300 poses", f"{1e3 * spacing:.1f} mm", f"{1e3 * gap:.1f} mm"))
    loaded.take_growth()
    assert loaded.density.startswith("codebook of 300 poses")
    loaded.growth.start()
    built.wait()
    loaded.growth.close()
    assert loaded.coarse.endswith("; growing")
    loaded.take_growth()
    assert (loaded.growth.failure, loaded.coarse) == ("", "")
    assert loaded.density.startswith("codebook of 400 poses")


def test_a_sensor_of_ones_own_is_one_of_the_codebook_too(built, tmp_path):
    """It is known by its file alone; a codebook outlives that."""
    own = tmp_path / "my_touch.yaml"
    own.write_text(
        "width: 240\nheight: 320\nfocal: 300\ngel_distance: 0.022\n"
        "dome: {radius_x: 0.03, radius_y: 0.04, semi_axis_z: 0.03}\n"
    )
    expected = SensorModel.load(own).for_maps.content_id
    _, codebook = loaded_object.coarse_codebook(EYEBOLT, "fast", str(own), CONFIG)
    codebook.save(tmp_path / "eyebolt.npz")
    own.unlink()
    loaded = load_object(EYEBOLT, tmp_path / "eyebolt.npz", CONFIG, seed=0)
    assert loaded.sensor.content_id == expected
    assert loaded.filter.object.alignment is not None


def test_what_the_parameters_do_not_name_is_said(tmp_path):
    with pytest.raises(InputError, match="no_such_network"):
        loaded_object.build_object(EYEBOLT, "no_such_network", "digit_tacto", FilterConfig(), 0)
    with pytest.raises(InputError, match="no_such_sensor"):
        loaded_object.build_object(EYEBOLT, "fast", "no_such_sensor", FilterConfig(), 0)
    trimesh.creation.box((100, 50, 20)).export(tmp_path / "part.stl")
    with pytest.raises(InputError, match=r"part.stl: 100 m across; in millimetres"):
        loaded_object.build_object(tmp_path / "part.stl", "fast", "digit_tacto", FilterConfig(), 0)

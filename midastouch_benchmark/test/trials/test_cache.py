import numpy as np
import pytest

from midastouch_benchmark.trials import cache as module
from midastouch_benchmark.trials.cache import Cache, SlideKind, Touches
from midastouch_common.errors import InputError
from midastouch_filter.core.touch import Measurement
from midastouch_perception.sensor_model import SensorModel


@pytest.fixture
def cache(tmp_path, networks, sequence, monkeypatch) -> Cache:
    """A cache whose slides are all the stub sequence and whose networks know the answer."""
    cache = Cache(tmp_path, slides=SlideKind(0.1))
    networks.sensor = SensorModel.load("digit_tacto")
    vars(cache)["networks"] = networks  # in place of those that would be loaded
    monkeypatch.setattr(module, "load_sequence", lambda path: type(sequence)(**vars(sequence) | {"path": path}))
    return cache


def test_a_slide_that_gets_stuck_is_tried_with_other_seeds(cache, mesh, monkeypatch):
    seeds = []

    def simulate(mesh, sensor, length, seed, out, progress, leap):
        seeds.append((length, seed))
        if seed < 2000:
            raise InputError("stuck")
        out.mkdir(parents=True)

    monkeypatch.setattr(module, "simulate_sequence", simulate)
    path = cache.slide(mesh, 3).path
    assert seeds == [(0.1, 3), (0.1, 1003), (0.1, 2003)]
    assert path.parts[-2:] == ("block", "03")
    cache.slide(mesh, 3)
    assert len(seeds) == 3


def test_codebooks_of_several_sizes_are_kept_apart(cache, mesh, codebook, monkeypatch):
    built = []

    def build(mesh, tcn, sensor, size, folder, jobs):
        path = module.cached_codebook_path(mesh.name, size, folder)
        if not path.is_file():
            built.append(size)
            type(codebook)(codebook.poses[:size], codebook.codes[:size], codebook.meta).save(path)
        return codebook

    cache.networks.tcn = None
    monkeypatch.setattr(module, "cached_codebook", build)
    for size in (None, 100, None, 200, 100):
        cache.codebook(mesh, size)
    assert built == [cache.codebook_size, 100, 200]
    assert len({cache.codebook_digest(mesh, size) for size in (None, 100, 200)}) == 3


def test_an_object_without_slides_is_refused(cache, mesh, monkeypatch):
    def stuck(*_, **__):
        raise InputError("stuck after 3 frames")

    monkeypatch.setattr(module, "simulate_sequence", stuck)
    with pytest.raises(InputError, match=r"block: .*0\.1 m.*give a shorter one"):
        cache.slide(mesh, 0)


def test_touches_are_perceived_once_per_networks(cache, mesh, networks, monkeypatch):
    monkeypatch.setattr(module, "simulate_sequence", lambda *a, **_: a[4].mkdir(parents=True))
    sequence, first = cache.touches(mesh, 0)
    monkeypatch.setattr(Touches, "perceive", lambda *_: pytest.fail("perceived again"))
    again = cache.touches(mesh, 0)[1]
    assert (again.ms == first.ms).all()
    assert [m.in_contact for m in again.measurements] == [m.in_contact for m in first.measurements]
    (made_from,) = (Touches.load(path)[1] for path in cache.folder.glob("**/*.npz"))
    assert made_from == {"sequence": "00", "frames": sequence.n_frames} | networks.describe()
    monkeypatch.setattr(networks, "describe", lambda: {"tdn": "newer", "tcn": "pose-code", "sensor": "none"})
    with pytest.raises(pytest.fail.Exception, match="perceived again"):
        cache.touches(mesh, 0)


def test_touches_survive_a_file(tmp_path):
    rng = np.random.default_rng(0)
    measurement = [
        Measurement(True, rng.random(8, np.float32), 1e-4, "net", rng.random((80, 60), np.float32)),
        Measurement(False),
        Measurement(True, rng.random(8, np.float32), 2e-4, "net", rng.random((80, 60), np.float32)),
        None,
    ]
    Touches(measurement, rng.random((4, 2))).save(tmp_path / "t.npz", {"tcn": "net"})
    loaded, made_from = Touches.load(tmp_path / "t.npz")
    assert [m and m.in_contact for m in loaded.measurements] == [True, False, True, None]
    for one, other in ((measurement[0], loaded.measurements[0]), (measurement[2], loaded.measurements[2])):
        assert (one.code == other.code).all()
        assert (one.penetration == other.penetration).all()
        assert (one.contact_area, one.network_id) == (other.contact_area, other.network_id)
    assert made_from == {"tcn": "net"}
    # and those of a slide without any contact
    Touches([Measurement(False)] * 2, np.zeros((2, 2))).save(tmp_path / "t.npz", {"tcn": "net"})
    assert [m.in_contact for m in Touches.load(tmp_path / "t.npz")[0].measurements] == [False, False]


def test_every_frame_is_perceived_once_with_its_time(sequence, networks):
    touches = Touches.perceive(sequence, networks)
    frames = touches.frames(sequence, stride=7)
    assert [frame.index for frame in frames] == [0, 7, 14, 21, 28]
    assert frames[2].ms == {"tdn": 2.0, "tcn": 1.0}
    assert (frames[2].truth == sequence.poses_true[14]).all()


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 no zip"])
def test_another_file_is_refused(tmp_path, content):
    (tmp_path / "t.npz").write_bytes(content)
    with pytest.raises(InputError, match=r"t\.npz"):
        Touches.load(tmp_path / "t.npz")

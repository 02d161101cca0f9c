import numpy as np
import pytest

from midastouch_benchmark.trials.touches import Touches, made_from
from midastouch_common.errors import InputError
from midastouch_filter.core.touch import Measurement


def test_touches_survive_a_file(tmp_path):
    rng = np.random.default_rng(0)
    felt = [
        Measurement(True, rng.random(8, np.float32), 1e-4, "net", rng.random((80, 60), np.float32)),
        Measurement(False),
        Measurement(True, rng.random(8, np.float32), 2e-4, "net", rng.random((80, 60), np.float32)),
    ]
    Touches(felt, rng.random((3, 2)), {"tcn": "net"}).save(tmp_path / "t.npz")
    loaded = Touches.load(tmp_path / "t.npz")
    assert [m.in_contact for m in loaded.felt] == [True, False, True]
    for one, other in ((felt[0], loaded.felt[0]), (felt[2], loaded.felt[2])):
        assert (one.code == other.code).all()
        assert (one.penetration == other.penetration).all()
        assert (one.contact_area, one.network_id) == (other.contact_area, other.network_id)
    assert loaded.made_from == {"tcn": "net"}


def test_a_slide_without_any_contact_survives_too(tmp_path):
    Touches([Measurement(False)] * 2, np.zeros((2, 2)), {"tcn": "net"}).save(tmp_path / "t.npz")
    assert [m.in_contact for m in Touches.load(tmp_path / "t.npz").felt] == [False, False]


def test_every_frame_is_perceived_once_with_its_time(sequence, networks):
    touches = Touches.perceive(sequence, networks)
    frames = touches.frames(sequence, stride=7)
    assert [frame.index for frame in frames] == [0, 7, 14, 21, 28]
    assert frames[2].ms == {"tdn": 2.0, "tcn": 1.0}
    assert (frames[2].truth == sequence.poses_true[14]).all()
    assert made_from(sequence, networks).items() <= touches.made_from.items()


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 no zip"])
def test_another_file_is_refused(tmp_path, content):
    (tmp_path / "t.npz").write_bytes(content)
    with pytest.raises(InputError, match=r"t\.npz"):
        Touches.load(tmp_path / "t.npz")

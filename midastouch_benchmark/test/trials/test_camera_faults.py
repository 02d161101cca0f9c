import numpy as np
import pytest

from midastouch_benchmark.trials.cache import SlideKind
from midastouch_benchmark.trials.camera_faults import FAULTS, CameraFaultCache
from midastouch_benchmark.trials.real_sensor import RealSensorCache

N = 90
OF_STAMPS, LOSSES = "stamps off by up to 50 ms", "a third of the frames is lost, and 1 s"
OF_GELS = "out of focus", "markers on the gel"
SETTINGS = {"sensor": "digit_real", "slides": SlideKind(0.06)}


@pytest.fixture(scope="module")
def images():
    """The no-contact image, then images of a gel that is touched further and further down."""
    rng, (y, x) = np.random.default_rng(0), np.mgrid[:320, :240]
    bumps = [np.exp(-((x - 120) ** 2 + (y - 3 * k) ** 2) / 800) * (k > 0) for k in range(N)]
    gel = np.array([110.0, 100.0, 90.0])
    seen = [gel + 40 * bump[..., None] + rng.normal(0, 1, (320, 240, 3)) for bump in bumps]
    return [image.clip(0, 255).astype(np.uint8) for image in seen]


@pytest.mark.parametrize("fault", FAULTS)
def test_each_fault_changes_a_stream_that_stays_in_step(fault, images):
    before = [image.copy() for image in images]
    seen = FAULTS[fault](images, np.random.default_rng(1))
    assert all(map(np.array_equal, images, before)), "they are another fault's, too"
    assert len(seen) == N
    assert all(image is None or (image.shape, image.dtype) == ((320, 240, 3), np.uint8) for image in seen)
    assert any(image is None for image in seen) == (fault == LOSSES)
    assert np.array_equal(seen[0], images[0]) == (fault not in OF_GELS)
    assert all(map(np.array_equal, seen, images)) == (fault == OF_STAMPS)


@pytest.mark.slow
def test_faults_have_one_path_and_only_frames_that_are_left(tool, tmp_path):
    cache, sound = CameraFaultCache(tmp_path, **SETTINGS), RealSensorCache(tmp_path, **SETTINGS, calibrated=True)
    plain = sound.frames(tool, 0)
    lossy, shifted = (cache.frames(tool, list(FAULTS).index(name)) for name in (LOSSES, OF_STAMPS))
    assert len(lossy) < len(plain) - 20
    assert sum(frame.seconds for frame in lossy) == pytest.approx(0.05 * (lossy[-1].index + 1))
    assert [frame.index for frame in shifted] == [frame.index for frame in plain]
    off = [np.linalg.norm((one.measured - two.measured)[:3, 3]) for one, two in zip(shifted, plain, strict=True)]
    assert 2e-4 < np.median(off) < 3e-3
    np.testing.assert_array_equal(shifted[9].truth, plain[9].truth)

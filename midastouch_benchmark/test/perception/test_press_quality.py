import cv2
import numpy as np
import pytest

from midastouch_benchmark.perception.press_quality import cap_penetration, measure_presses, visible_contact
from midastouch_common.errors import InputError
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn import load_tdn
from midastouch_tools.datasets.ball_presses import BallPresses, load_ball_presses

RADIUS = 4e-3
FREE = np.full((320, 240, 3), 100, np.uint8)


@pytest.fixture(scope="module")
def sensor():
    return SensorModel.load("digit_real").scaled(0.5)


class FakeTdn:
    """Feels a map that is coded in the images: red 1 grey level above the background stands for 10 um."""

    network_id = "fake"

    def __init__(self, sensor, measured=lambda penetration: penetration):
        self.sensor, self._measured = sensor, measured

    def difference(self, image, background):
        return image[::2, ::2].astype(np.float32) - background[::2, ::2]

    def predict(self, image, background, difference=None):
        return self._measured(self.difference(image, background)[..., 0] * np.float32(1e-5))


@pytest.fixture(scope="module")
def presses(sensor):
    """A ball of 4 mm pressed 0.6 ... 1.2 mm deep, without labels."""
    images = {}
    for i in range(7):
        x, y, depth = 1e-3 * (i - 3), 5e-4 * i, 6e-4 + 1e-4 * i
        penetration = cap_penetration([x, y, sensor.sag(x, y) + depth - RADIUS], RADIUS, sensor)
        image = FREE.copy()
        image[..., 0] += np.rint(cv2.resize(penetration, (240, 320), interpolation=cv2.INTER_NEAREST) * 1e5).astype(
            np.uint8
        )
        images[f"{i}.png"] = image
    return BallPresses(images, FREE, None)


@pytest.fixture(scope="module")
def labelled(presses):
    """The same with circles by hand: centre and radius of every contact."""
    circles = {}
    for name, image in presses.images.items():
        rows, columns = np.nonzero(image[..., 0] > 100)
        circles[name] = (columns.mean(), rows.mean(), float(np.sqrt(len(rows) / np.pi)))
    return BallPresses(presses.images, FREE, circles)


def summary_of(sensor, presses, measured):
    return measure_presses(FakeTdn(sensor, measured), presses, RADIUS)[1]


@pytest.mark.parametrize("kind", ["presses", "labelled"])
def test_what_is_right_is_found_right(sensor, kind, request):
    presses = request.getfixturevalue(kind)
    rows, summary = measure_presses(FakeTdn(sensor), presses, RADIUS)
    assert [row["image"] for row in rows] == list(presses.images)
    assert summary["presses"] == 7
    assert summary["labelled"] == (kind == "labelled")
    assert summary["recall"] == summary["bulges_share"] == 1
    assert summary["peak_ratio"] == pytest.approx(1, abs=0.05)
    assert summary["rmse_in_circle_mm"] < 0.05
    assert summary["depth_correlation"] > 0.98
    assert summary["felt_radius_mm"] == pytest.approx(4, rel=0.03)
    assert summary["iou"] > 0.95
    assert summary["iou_ideal"] > 0.9
    assert summary["centre_mm"] < 0.06
    assert summary["roundness"] > 0.85
    assert summary["outside_share"] < 0.02


@pytest.mark.parametrize("factor", [0.4, 1.5])
@pytest.mark.parametrize("kind", ["presses", "labelled"])
def test_a_depth_that_is_scaled_is_reported_so(sensor, kind, factor, request):
    """What a comparison with a sphere fitted to the measured depth cannot see; labels or not."""
    summary = summary_of(sensor, request.getfixturevalue(kind), lambda penetration: factor * penetration)
    assert summary["peak_ratio"] == pytest.approx(factor, rel=0.05)
    # curvatures scale with the depth; what is added to the penetration map of the gel is scaled, the dome itself is not
    dome = np.mean([1 / dict(sensor.dome)[key] for key in ("radius_x", "radius_y")])
    curvature = factor / RADIUS + (factor - 1) * dome
    assert summary["felt_radius_mm"] == pytest.approx(1e3 / curvature, rel=0.1)
    assert summary["rmse_in_circle_mm"] == pytest.approx(0.5 * abs(1 - factor), rel=0.3)
    assert summary["depth_correlation"] > 0.97


def test_a_depth_that_never_changes_or_falls(sensor, labelled):
    def same(penetration):
        return penetration * np.float32(6e-4) / max(penetration.max(), 1e-9)

    def falling(penetration):
        return penetration * np.float32((1.8e-3 - penetration.max()) / max(penetration.max(), 1e-9))

    assert np.isnan(summary_of(sensor, labelled, lambda p: np.where(p > 0, np.float32(5e-4), 0))["depth_correlation"])
    assert summary_of(sensor, labelled, falling)["depth_correlation"] < -0.98
    _, ratio = (summary_of(sensor, labelled, same)[key] for key in ("felt_radius_mm", "peak_ratio"))
    assert ratio == pytest.approx(0.6 / 0.9, rel=0.05)


def test_a_contact_felt_aside(sensor, labelled):
    summary = summary_of(sensor, labelled, lambda penetration: np.roll(penetration, 5, axis=1))
    assert summary["centre_mm"] == pytest.approx(5e3 * sensor.pixel_size, abs=0.1)
    assert summary["iou_ideal"] < 0.85
    assert summary["iou"] > 0.95, "the shape is still right"


def test_a_wrong_size_is_seen_without_labels(sensor, presses):
    _, summary = measure_presses(FakeTdn(sensor), presses, 1.5 * RADIUS)
    assert summary["peak_ratio"] > 1.4
    assert summary["felt_radius_mm"] == pytest.approx(4, rel=0.03)


def test_what_is_felt_elsewhere_is_counted(sensor, presses):
    def haunted(penetration):
        out = penetration.copy()
        out[140:155, 5:40] += 4e-4
        return out

    summary = summary_of(sensor, presses, haunted)
    assert 0.1 < summary["outside_share"] < 0.9
    assert summary["iou"] < 0.8
    assert summary["felt_radius_mm"] == pytest.approx(4, rel=0.05), "the ball itself is still seen"


def test_a_dent_does_not_bulge(sensor, presses):
    """Relief of the wrong sign: deepest at the rim."""

    def inverted(penetration):
        return np.where(penetration > 0, penetration.max() * 1.5 - penetration, 0).astype(np.float32)

    rows, summary = measure_presses(FakeTdn(sensor, inverted), presses, RADIUS)
    assert summary["bulges_share"] < 0.3
    assert all(row["felt_radius_mm"] is None for row in rows if not row["bulges"])


@pytest.mark.parametrize("kind", ["presses", "labelled"])
def test_nothing_felt(sensor, kind, request):
    rows, summary = measure_presses(FakeTdn(sensor, np.zeros_like), request.getfixturevalue(kind), RADIUS)
    assert summary["recall"] == summary["iou"] == 0
    assert rows[0]["roundness"] == 0
    assert np.isnan(summary["felt_radius_mm"])
    if kind == "labelled":
        assert summary["peak_ratio"] == 0, "a press that is not felt counts"
        assert summary["rmse_in_circle_mm"] > 0.3


@pytest.mark.parametrize("radius", [0, -1e-3, 4.4, float("nan")])
def test_a_radius_that_is_none(sensor, presses, radius):
    with pytest.raises(InputError, match="give it in metres"):
        measure_presses(FakeTdn(sensor), presses, radius)


def test_a_ball_too_small_for_its_labels(sensor, labelled):
    with pytest.raises(InputError, match=r"check --ball-diameter"):
        measure_presses(FakeTdn(sensor), labelled, 1.5e-3)


def test_visible_contact_is_the_largest_change(sensor):
    difference = np.zeros((160, 120, 3), np.float32)
    difference[40:80, 40:80] = 40
    difference[120:126, 10:16] = 60
    region = visible_contact(difference, sensor)
    assert region[36:84, 36:84].any(axis=1).all()
    assert region[60, 60]
    assert not region[110:140].any()
    assert not visible_contact(np.zeros_like(difference), sensor).any()


@pytest.mark.parametrize(("name", "radius", "scale"), [("d20641", 4.4e-3, 18680.0), ("vocdex", 3e-3, 18500.0)])
def test_a_ball_on_sensors_never_seen_has_about_its_size(shared, name, radius, scale):
    presses = load_ball_presses(shared / f"data/digit_real/sphere_presses_{name}")
    some = presses.only(sorted(presses.images)[::3])
    tdn = load_tdn("fast", SensorModel.load("digit_real").at_scale(scale))
    rows, summary = measure_presses(tdn, some, radius)
    assert summary["labelled"]
    assert summary["recall"] == summary["bulges_share"] == 1
    assert 0.5 < summary["peak_ratio"] < 1.4
    assert 0.65e3 * radius < summary["felt_radius_mm"] < 1.6e3 * radius
    assert summary["iou"] > 0.75
    assert summary["outside_share"] < 0.05
    for row in rows:
        wide = some.circles[row["image"]][2] / scale
        flat = 1e3 * (radius - np.sqrt(radius**2 - wide**2))
        assert 0.93 < row["ideal_peak_mm"] / flat < 1.1, "dome and perspective change a cap little"

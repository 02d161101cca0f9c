import cv2
import numpy as np
import pytest

from midastouch_bringup.evaluation.press_quality import (
    ball_renderer,
    load_presses,
    measure_presses,
    render_ball,
    visible_contact,
)
from midastouch_perception.errors import InputError
from midastouch_perception.sensor_model import SensorModel

RADIUS = 4e-3
FREE = np.full((320, 240, 3), 100, np.uint8)


@pytest.fixture(scope="module")
def sensor():
    return SensorModel.load("digit_real").scaled(0.5)


class FakeTdn:
    """Feels a map that is coded in the images: red 1 grey level above the background stands for 10 um."""

    network_id = "fake"

    def __init__(self, sensor, felt=lambda penetration: penetration):
        self.sensor, self._felt = sensor, felt

    def difference(self, image, background):
        return image[::2, ::2].astype(np.float32) - background[::2, ::2]

    def predict(self, image, background, difference=None):
        return self._felt(self.difference(image, background)[..., 0] * np.float32(1e-5))


@pytest.fixture(scope="module")
def presses(sensor):
    """Images of a ball of 4 mm pressed 0.6 ... 1.2 mm deep."""
    renderer = ball_renderer(RADIUS, sensor)
    images = {}
    for i in range(7):
        x, y, depth = 1e-3 * (i - 3), 5e-4 * i, 6e-4 + 1e-4 * i
        penetration = render_ball(renderer, np.array([x, y, sensor.sag(x, y) + depth - RADIUS]))
        image = FREE.copy()
        image[..., 0] += np.rint(cv2.resize(penetration, (240, 320), interpolation=cv2.INTER_NEAREST) * 1e5).astype(
            np.uint8
        )
        images[f"{i}.png"] = image
    return images


def test_a_true_ball_is_recognised(sensor, presses):
    rows, summary = measure_presses(FakeTdn(sensor), presses, FREE)
    assert [row["image"] for row in rows] == list(presses)
    assert summary["presses"] == 7
    assert summary["found_share"] == summary["bulges_share"] == 1
    assert summary["radius_mm"] == pytest.approx(4, rel=0.05)
    assert summary["radius_spread"] < 0.05
    assert summary["residual_mm"] < 0.01
    assert summary["curvature_ratio"] > 0.9
    assert summary["roundness"] > 0.85
    assert summary["outside_share"] < 0.02
    assert summary["ball_rmse_mm"] < 0.01
    assert summary["ball_iou"] > 0.95


def test_what_is_felt_elsewhere_is_counted(sensor, presses):
    def haunted(penetration):
        out = penetration.copy()
        out[140:155, 5:40] += 4e-4
        return out

    _, summary = measure_presses(FakeTdn(sensor, haunted), presses, FREE)
    assert 0.1 < summary["outside_share"] < 0.9
    assert summary["ball_iou"] < 0.8
    assert summary["radius_mm"] == pytest.approx(4, rel=0.05), "the ball itself is still seen"


def test_a_dent_does_not_bulge(sensor, presses):
    """Relief of the wrong sign: deepest at the rim."""

    def inverted(penetration):
        return np.where(penetration > 0, penetration.max() * 1.5 - penetration, 0).astype(np.float32)

    rows, summary = measure_presses(FakeTdn(sensor, inverted), presses, FREE)
    assert summary["bulges_share"] < 0.3
    assert all(row["radius_mm"] is None for row in rows if not row["bulges"])


def test_nothing_felt(sensor, presses):
    rows, summary = measure_presses(FakeTdn(sensor, np.zeros_like), presses, FREE)
    assert summary["found_share"] == 0
    assert summary["radius_mm"] is None
    assert rows[0]["roundness"] == 0


def test_visible_contact_is_the_largest_change(sensor):
    difference = np.zeros((160, 120, 3), np.float32)
    difference[40:80, 40:80] = 40
    difference[120:126, 10:16] = 60
    region = visible_contact(difference, sensor)
    assert region[36:84, 36:84].any(axis=1).all()
    assert region[60, 60]
    assert not region[110:140].any()
    assert not visible_contact(np.zeros_like(difference), sensor).any()


def test_folders(tmp_path, presses):
    with pytest.raises(InputError, match=r"no background\.png"):
        load_presses(tmp_path)
    cv2.imwrite(str(tmp_path / "background.png"), FREE)
    with pytest.raises(InputError, match="no presses"):
        load_presses(tmp_path)
    first = presses["0.png"]
    for name in ("a.png", "b.png"):
        cv2.imwrite(str(tmp_path / name), first[:, :, ::-1])
    images, background = load_presses(tmp_path)
    assert list(images) == ["a.png"], "the same image twice is one press"
    np.testing.assert_array_equal(images["a.png"], first)
    np.testing.assert_array_equal(background, FREE)


def test_real_presses(shared):
    """What must hold whatever the network: every press is found, bulges, and is nearly a sphere."""
    from midastouch_perception.tdn import load_tdn

    images, background = load_presses(shared / "data/digit_real/ball_presses")
    assert len(images) == 41
    some = dict(list(images.items())[::6])
    _, summary = measure_presses(load_tdn("fast", SensorModel.load("digit_real")), some, background)
    assert summary["found_share"] == 1
    assert summary["bulges_share"] > 0.8
    assert 2 < summary["radius_mm"] < 12
    assert summary["residual_mm"] < 0.1
    assert summary["explained_share"] > 0.5

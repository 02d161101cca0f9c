import dataclasses
from pathlib import Path

import numpy as np
import pytest

from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_perception import sensor_model
from midastouch_perception.objects import bundled_objects
from midastouch_perception.rendering.contact_poses import ContactSampling, sample_contact_poses
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn import load_tdn
from midastouch_simulation.gel_light import GelLight


def test_tacto_gel_has_the_known_depths(sensor):
    """Depths of the undeformed gel in TACTO: centre, top, left, corner."""
    depth = sensor.gel_depth
    assert depth[160, 120] == pytest.approx(0.0220, abs=1e-6)
    assert depth[0, 120] == pytest.approx(0.01998, abs=1e-5)
    assert depth[160, 0] == pytest.approx(0.02077, abs=1e-5)
    assert depth[0, 0] == pytest.approx(0.01911, abs=1e-5)


def test_the_other_gels_are_as_published(real):
    assert 1e-3 / (real.gel_distance / real.focal) == pytest.approx(18.5, abs=0.1)
    assert real.sag(0.0065, 0.0) == pytest.approx(1e-3, abs=2e-4)
    assert real.sag(0.0, 0.009) == pytest.approx(1e-3, abs=3e-4)
    mini = SensorModel.load("gelsight_mini")
    assert (mini.width, mini.height) == (240, 320)
    assert 1e3 * mini.pixel_size == pytest.approx(0.0634, rel=1e-3)
    assert np.ptp(mini.gel_depth) < 1e-6
    np.testing.assert_allclose(mini.gel_depth, mini.gel_distance, atol=1e-6)


def test_the_network_measures_a_ball_on_a_gelsight_mini():
    """Its geometry is one that the network can use; its light is another matter."""
    mini = SensorModel.load("gelsight_mini")
    mesh = ObjectMesh.load(bundled_objects()["ball"])
    rng = np.random.default_rng(0)
    sampling = ContactSampling(press=(0.6e-3, 1.2e-3), free_fraction=0.0)
    poses = sample_contact_poses(mesh, 3, rng, mini, sampling)
    background = np.full((320, 240, 3), (120, 110, 130), np.uint8)
    light, tdn = GelLight(mini, rng), load_tdn("fast", mini)
    for truth in PenetrationRenderer(mesh, mini).render(poses):
        image = np.clip(background * light.ratio(truth), 0, 255).astype(np.uint8)
        measured = tdn.predict(image, background) > 3e-5
        touched = truth[::2, ::2] > 3e-5
        assert (measured & touched).sum() / (measured | touched).sum() > 0.85


def test_at_scale_sets_what_a_pixel_is(real):
    assert 1 / real.at_scale(18680).pixel_size == pytest.approx(18680)
    assert real.at_scale(18680).gel_distance == real.gel_distance
    for scale in (18.68, 3000, 200_000, float("nan"), float("inf"), 1e-300):
        with pytest.raises(InputError, match=r"px/mm.*pixels per millimetre"):
            real.at_scale(scale)


def test_gel_points_are_those_seen_through_the_pixels(sensor):
    points = sensor.gel_points(np.array([[0.5, 0.5], [120, 160], [-20, 160]]))
    depth, (tangent_x, tangent_y) = sensor.gel_depth, sensor.rays
    expected = [tangent_x[0, 0] * depth[0, 0], tangent_y[0, 0] * depth[0, 0], sensor.gel_distance - depth[0, 0]]
    np.testing.assert_allclose(points[0], expected, atol=1e-12)
    np.testing.assert_allclose(points[1], 0, atol=1e-12)
    assert points[2, 0] < points[0, 0], "beyond the image, too"
    np.testing.assert_allclose(points[:, 2], sensor.sag(points[:, 0], points[:, 1]), atol=1e-9)


def test_scaled_keeps_the_view(sensor):
    half = sensor.scaled(0.5)
    assert (half.height, half.width) == (160, 120)
    np.testing.assert_allclose(half.gel_depth.mean(), sensor.gel_depth.mean(), rtol=1e-4)
    assert half.pixel_area == pytest.approx(4 * sensor.pixel_area)
    assert half.content_id != sensor.content_id


BUT_WIDTH = "height: 320\nfocal: 300\ngel_distance: 0.022\ndome: {radius_x: 0.03, radius_y: 0.04, semi_axis_z: 0.03}\n"


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("width: 240\n", "not a sensor model"),
        (f"width: 0\n{BUT_WIDTH}", "must be positive"),
        (f"width: 240\n{BUT_WIDTH.replace('0.022', '.inf')}", "must be positive"),
        (f"width: 240\n{BUT_WIDTH.replace('0.04', '.nan')}", "must be positive"),
        ("width: 240\nheight: 320\nfocal: 3\ngel_distance: 0.1\ndome: {radius_x: 1}\n", "dome needs"),
        (f"width: 480\n{BUT_WIDTH}", "480 x 320 px, .* 240 x 320: .*camera_model"),
        (f"width: 240.7\n{BUT_WIDTH}", "240.7 is not a whole number"),
        (f"width: 240\nlihgt: additive\n{BUT_WIDTH}", "unknown: lihgt; there are width, .*light"),
        (f"width: 240\nlamps: mine\n{BUT_WIDTH}", "'mine' .*use digit or gelsight_mini"),
        (f"width: 240\nlight: bright\n{BUT_WIDTH}", "bright.*relative.*additive"),
        (f"width: 240\n{BUT_WIDTH.replace('0.022', '22')}", "a pixel of 73.3 mm .* is not a tactile .*in metres"),
    ],
)
def test_broken_models_are_refused(tmp_path, content, said):
    path = tmp_path / "broken.yaml"
    path.write_text(content)
    with pytest.raises(InputError, match=f"broken.yaml: .*{said}"):
        SensorModel.load(path)
    with pytest.raises(InputError, match="digit_real, digit_tacto"):
        SensorModel.load("broken")


def test_light_is_relative_unless_the_model_says_otherwise(tmp_path, real):
    text = (Path(sensor_model.__file__).parent / "sensor_models" / "digit_real.yaml").read_text()
    path = tmp_path / "mine.yaml"
    path.write_text(text.replace("light: relative", "light: additive"))
    assert SensorModel.load(path).light == "additive"
    path.write_text("\n".join(line for line in text.splitlines() if not line.startswith("light")))
    assert SensorModel.load(path).light == "relative"

    assert dataclasses.replace(real, light="additive", lamps="").content_id == real.content_id, "a codebook knows none"

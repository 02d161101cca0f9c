import numpy as np
import pytest

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_calibration.fit import cross_validation
from midastouch_perception.sensor_calibration.object_fit import calibrate_on_object, choose_touches
from midastouch_perception.simulation.slide import measure_poses, simulate_slide
from midastouch_perception.tdn.inputs import ContactLight, reduce_image, without_drift

TOUCHES = 15


@pytest.fixture(scope="module")
def slide(another_digit, real, tool):
    """True and measured poses of some touches on a slide over the tool, and their images."""
    rng, digit = np.random.default_rng(0), another_digit(6)
    poses = simulate_slide(tool, real, 0.15, rng)
    chosen = np.array(choose_touches(poses, tool, real))
    poses = poses[chosen[:: max(1, len(chosen) // TOUCHES)][:TOUCHES]]
    maps = PenetrationRenderer(tool, real).render(poses)
    images = {f"frame {i}": digit.image_of(penetration) for i, penetration in enumerate(maps)}
    return poses, measure_poses(poses, rng, 5e-4, np.radians(1.0)), images


@pytest.fixture(scope="module")
def result(slide, another_digit, real, tool):
    _, measured, images = slide
    return calibrate_on_object(images, measured, another_digit(6).background, tool, real, "D20123")


def test_slopes_of_a_ball_never_seen_are_known(result, digit, real):
    half = real.for_maps
    light = ContactLight(reduce_image(digit.background), real.light)
    contacts = [[(90, 100, 1.5e-3)], [(150, 220, 1.3e-3)], [(120, 160, 1.7e-3)]]
    changes = [without_drift(light.difference(reduce_image(digit.image(each)))) for each in contacts]
    truth = [digit.penetration(each)[::2, ::2] for each in contacts]
    figures = cross_validation(changes, truth, [result.calibration] * 3, half.pixel_size)
    assert figures["explained_after"] > max(0.8, figures["explained_before"])
    assert figures["steepness_after"] == pytest.approx(1, abs=0.25)


def test_it_says_what_it_was_made_with(result, real):
    made = result.calibration
    assert (made.serial, made.ball_diameter, made.object_name) == ("D20123", 0, "handle_tool")
    assert made.touched.endswith("touches of handle_tool")
    assert made.presses == sum(not press.problem for press in result.presses) > TOUCHES / 2
    made.check_sensor(real, "D20123")
    assert result.figures["explained_after"] > 0.6


def turned(poses: np.ndarray, angle: float) -> np.ndarray:
    return poses @ se3.exp(np.array([0, 0, 0, 0, 0, angle]))


def test_a_gel_frame_that_is_turned_is_refused(slide, digit, real, tool):
    poses, _, images = slide
    with pytest.raises(InputError, match=r"touches can be used|do not agree|other way round"):
        calibrate_on_object(images, turned(poses, np.pi / 2), digit.background, tool, real)


def test_poses_that_do_not_press_the_object_are_refused(real, tool):
    away = np.tile(se3.make(np.eye(3), np.array([0, 0, 1.0])), (20, 1, 1))
    with pytest.raises(InputError, match=r"0 of 20 .*handle_tool.*slide over"):
        choose_touches(away, tool, real)


def test_images_of_another_sensor_are_named(slide, digit, another_digit, real, tool):
    poses, _, images = slide
    other = np.roll(another_digit(8).background, 70, axis=1)
    with pytest.raises(InputError, match=r"frame 0.*capture that anew"):
        calibrate_on_object(images, poses, other, tool, real)

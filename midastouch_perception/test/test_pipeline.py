import dataclasses

import cv2
import numpy as np
import pytest
import trimesh

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.contact import ContactState, in_steps
from midastouch_perception.pipeline import CodeStage, DepthStage, TouchPipeline
from midastouch_perception.rendering.contact_poses import ContactSampling, sample_contact_poses
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_calibration.ball import ball_centre, ball_penetration
from midastouch_perception.sensor_calibration.calibration import SensorCalibration
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tcn import load_tcn
from midastouch_perception.tdn import load_tdn
from midastouch_simulation.measured_optics import MeasuredOptics, MeasuredSensor, measured_sensors
from midastouch_simulation.optics import TactoOptics
from midastouch_simulation.simulated_digit import SimulatedDigit


@pytest.fixture(scope="module")
def touches(tool, sensor):
    """Images over a plain background, and their true penetration."""
    rng = np.random.default_rng(0)
    sampling = ContactSampling(press=(0.5e-3, 1.5e-3), free_fraction=0.0)
    penetration, normals = PenetrationRenderer(tool, sensor).render_with_normals(
        sample_contact_poses(tool, 12, rng, sensor, sampling)
    )
    background = np.full((320, 240, 3), (120, 110, 130), np.uint8)
    optics = TactoOptics(sensor)
    images = [optics.image(p, background, rng, n) for p, n in zip(penetration, normals, strict=True)]
    return images, background, penetration


@pytest.fixture
def pipeline():
    ticks = iter(range(10**6))
    return TouchPipeline(load_tdn("fast"), load_tcn("fast"), lambda: float(next(ticks)))


def test_depth_is_recovered(touches, pipeline):
    images, background, truth = touches
    predicted = np.stack([pipeline.process(image, background).contact.penetration for image in images])
    half = truth.reshape(len(truth), 160, 2, 120, 2).mean(axis=(2, 4))
    assert np.sqrt(((predicted - half) ** 2).mean()) < 0.2e-3
    both, either = ((predicted > 0) & (half > 0)).sum(), ((predicted > 0) | (half > 0)).sum()
    assert both / either > 0.85


def test_a_touch_has_a_unit_code_and_an_area(touches, pipeline):
    images, background, truth = touches
    touch = pipeline.process(images[0], background)
    assert touch.contact.in_contact
    assert np.linalg.norm(touch.code) == pytest.approx(1, abs=1e-5)
    tcn = load_tcn("fast")
    assert touch.network_id == tcn.network_id
    area = (truth[0] > 0).sum() * tcn.sensor.pixel_area / 4
    assert touch.contact.area_m2 == pytest.approx(area, rel=0.3)
    assert pipeline.ms == {"tdn": 1000.0, "tcn": 1000.0}


def test_the_background_is_no_contact_and_skips_the_network(touches, pipeline):
    _, background, _ = touches
    rng = np.random.default_rng(1)
    noisy = np.clip(background + rng.normal(0, 2, background.shape), 0, 255).astype(np.uint8)
    stage = DepthStage(load_tdn("fast"))
    contact = stage.process(noisy, background)
    assert (contact.in_contact, contact.area_m2) == (False, 0)
    assert not contact.penetration.any()
    assert stage.skipped == {"image_unchanged": 0, "no_contact": 1}
    assert pipeline.process(noisy, background).code is None


def test_an_unchanged_image_reuses_the_contact(touches):
    images, background, _ = touches
    stage = DepthStage(load_tdn("fast"))
    first = stage.process(images[0], background)
    assert stage.process(images[0].copy(), background) is first
    assert stage.skipped["image_unchanged"] == 1
    assert stage.process(images[1], background) is not first
    assert stage.process(images[1], background.copy()) is not first
    assert stage.skipped["image_unchanged"] == 1, "another image or another background is computed"


def lamps(n, strength):
    """Light (n, 160, 120, 3) of lamps that change slowly, each by `strength` in the end, seen at half the size."""
    rng = np.random.default_rng(3)
    rows, columns = np.mgrid[-1:1:320j, -1:1:240j]
    middles, amounts = rng.uniform(-1, 1, (3, 2)), strength * rng.choice([-1, 1], 3)
    lobes = np.stack([np.exp(-((columns - x) ** 2) - (rows - y) ** 2) for x, y in middles], axis=-1)
    return (1 + fraction * amounts * lobes for fraction in np.linspace(0, 1, n))


def lit(image, light, rng):
    return np.clip(np.rint(image * light + rng.normal(0, 1, image.shape)), 0, 255).astype(np.uint8)


def resting(sensor):
    """A no-contact image (320, 240, 3) of a sensor of this model."""
    if sensor.lamps == "digit":
        return MeasuredSensor(MeasuredOptics.load("d20641"), sensor, np.random.default_rng(0)).background
    small = SensorCalibration.default(sensor).background
    return np.clip(np.rint(cv2.resize(small, (240, 320), interpolation=cv2.INTER_CUBIC)), 0, 255).astype(np.uint8)


def test_light_that_changes_slowly_is_no_contact():
    mini, rng = SensorModel.load("gelsight_mini"), np.random.default_rng(0)
    background = resting(mini)
    stage = DepthStage(load_tdn("fast", mini))
    images = [lit(background, light, rng) for light in lamps(60, 0.3)]
    assert not any(stage.process(image, background).in_contact for image in images)


def test_a_weave_that_the_network_does_not_read_is_not_free():
    mini, rng = SensorModel.load("gelsight_mini"), np.random.default_rng(0)
    background, stage = resting(mini), DepthStage(load_tdn("fast", mini))
    rows, columns = np.mgrid[:320, :240]
    weave = np.sin(np.pi / 4 * rows) * np.sin(np.pi / 4 * columns)
    light = 1 + 0.2 * (np.hypot(rows - 160, columns - 120) < 80) * weave
    assert all(stage.process(lit(background, 1.0, rng), background).state == ContactState.FREE for _ in range(5))
    assert all(
        stage.process(lit(background, light[..., None], rng), background).state != ContactState.FREE for _ in range(30)
    )


@pytest.mark.parametrize("model", ["digit_real", "gelsight_mini"])
def test_gel_that_the_light_makes_white_in_places_is_free(model):
    sensor, rng = SensorModel.load(model), np.random.default_rng(0)
    background, stage = resting(sensor), DepthStage(load_tdn("fast", sensor))
    background = lit(background, 210 / np.percentile(background, 99), rng)
    assert (background * 1.5 > 255).any(axis=2).mean() > 0.05
    for light in (*np.ones(5), 1.2, 1.35, 1.5):
        assert stage.process(lit(background, light, rng), background).state == ContactState.FREE


def test_a_light_touch_begins_while_the_light_changes():
    real, rng = SensorModel.load("digit_real"), np.random.default_rng(0)
    half, radius = real.for_maps, 3e-3
    maps = np.zeros((60, half.height, half.width), np.float32)
    maps[30:] = np.maximum(ball_penetration(ball_centre(60, 80, 1.2e-3, radius, half), radius, half), 0)
    for name in measured_sensors():
        camera, stage = MeasuredSensor(MeasuredOptics.load(name), real, rng), DepthStage(load_tdn("fast", real))
        images = [lit(*each, rng) for each in zip(camera.images(maps), lamps(60, 0.15), strict=True)]
        touched = [stage.process(image, camera.background).in_contact for image in images]
        assert touched == [False] * 30 + [True] * 30


def test_lamps_that_jump_are_no_contact():
    """By 0.7 to 1.5 of each colour, evenly and with a gradient over the image; clipped pixels are part of it."""
    rng, real = np.random.default_rng(2), SensorModel.load("digit_real")
    background = MeasuredSensor(MeasuredOptics.load("d20641"), real, rng).background
    across, down = np.linspace(-1, 1, 240)[None, :, None], np.linspace(-1, 1, 320)[:, None, None]
    for gradient in (0.0, 0.1, 0.2, 0.3):
        stage = DepthStage(load_tdn("fast", real))
        for _ in range(6):
            slope_x, slope_y = rng.uniform(-gradient, gradient, (2, 3))
            light = rng.uniform(0.7, 1.5, 3) * (1 + slope_x * across + slope_y * down)
            assert stage.process(lit(background, light, rng), background).state == ContactState.FREE


# A flat face that is straight on flat gel has no slope anywhere: no image shows it.
@pytest.mark.parametrize(("name", "shape"), [("digit_real", "face"), ("digit_real", "tube"), ("gelsight_mini", "tube")])
def test_what_is_pressed_is_never_free(name, shape):
    """Up to 2.5 mm, far beyond what covers the view, and back."""
    if shape == "face":
        solid, top = trimesh.creation.box((0.12, 0.12, 0.04)), 0.02
    else:
        solid, top = trimesh.creation.cylinder(0.035, 0.2, sections=128), 0.035
        solid.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    mesh, sensor = ObjectMesh.from_arrays(solid.vertices, solid.faces, shape), SensorModel.load(name)
    up = np.arange(0.2e-3, 2.6e-3, 0.2e-3)
    for seed in range(2):
        camera, stage = SimulatedDigit(mesh, sensor, resting(sensor), seed), DepthStage(load_tdn("fast", sensor))
        away = camera.look(se3.translation([0, 0, top + 5e-3])).image

        def reading(depth, camera=camera, stage=stage, away=away):
            return stage.process(camera.look(se3.translation([0, 0, top - depth])).image, away)

        assert reading(-5e-3).state == ContactState.FREE
        rising, falling = [reading(depth) for depth in up], [reading(depth) for depth in up[::-1]]
        assert all(contact.in_contact for contact in rising + falling)
        assert rising[-1].state == falling[0].state == ContactState.SATURATED
        assert rising[0].state == falling[-1].state == ContactState.CONTACT
        covered = [contact.depth_m for contact in rising if contact.state == ContactState.SATURATED]
        assert covered == sorted(covered), "depth does not fall while the press grows"
        assert reading(-5e-3).state == ContactState.FREE


@pytest.mark.parametrize("lamps", ["gelsight_mini", ""])
@pytest.mark.parametrize(
    ("camera", "tilt"),
    [
        pytest.param(236826611, (0.046, 0.026), id="much contrast, outline in view at first"),
        pytest.param(2242647589, (0.006, 0.032), id="nothing that the network finds"),
        pytest.param(2991032210, (0.005, -0.009), id="faint, covers the view at once"),
    ],
)
def test_a_flat_face_tilted_on_flat_gel_leaves_it_as_it_was(camera, tilt, lamps):
    """No image of the press is free, or becomes part of the free gel's light."""
    mini, solid = SensorModel.load("gelsight_mini"), trimesh.creation.box((0.12, 0.12, 0.04))
    look = SimulatedDigit(ObjectMesh.from_arrays(solid.vertices, solid.faces, "face"), mini, resting(mini), camera).look
    turn = se3.exp(np.array([0, 0, 0, *tilt, 0]))
    stage = DepthStage(load_tdn("fast", dataclasses.replace(mini, lamps=lamps)))
    away = look(se3.translation([0, 0, 0.025])).image

    def reading(depth):
        return stage.process(look(se3.translation([0, 0, 0.02 - depth]) @ turn).image, away)

    assert all(reading(-5e-3).state == ContactState.FREE for _ in range(5))
    up = np.arange(0.2e-3, 2.5e-3, 0.1e-3)
    pressed = [reading(depth) for depth in (*up, *up[::-1])]
    assert all(contact.state != ContactState.FREE for contact in pressed)
    read = [each.depth_m for each in pressed[: len(up)] if each.state != ContactState.UNKNOWN]
    assert min(np.diff(read), default=0) > -0.05e-3
    assert all(reading(-5e-3).state == ContactState.FREE for _ in range(5))


def test_a_contact_that_leaves_marks_has_ended(monkeypatch):
    """The same marks without a contact before are not understood; the network finds neither."""
    real, rng = SensorModel.load("digit_real"), np.random.default_rng(0)
    camera, radius = MeasuredSensor(MeasuredOptics.load("d20641"), real, rng), 3e-3
    half, tdn = real.for_maps, load_tdn("fast", real)
    ball = np.maximum(ball_penetration(ball_centre(60, 80, 1.5e-3, radius, half), radius, half), 0)
    free, touch = camera.images(np.stack([np.zeros_like(ball), ball]))
    rows, columns = np.mgrid[-1:1:320j, -1:1:240j]
    marks = lit(free, 1 + 0.03 * np.sin(7 * rows)[..., None] * np.sin(5 * columns)[..., None], rng)
    monkeypatch.setattr(tdn, "predict", lambda image, *_: ball if image is touch else np.zeros_like(ball))
    for touches, end in (([touch], ContactState.FREE), ([], ContactState.UNKNOWN)):
        stage = DepthStage(tdn)
        images = [*(lit(free, 1.0, rng) for _ in range(5)), *touches, marks]
        states = [stage.process(image, camera.background).state for image in images]
        assert states[:5] == [ContactState.FREE] * 5
        assert states[5:] == [*([ContactState.CONTACT] * len(touches)), end]


def test_a_no_contact_image_of_another_gel_is_not_understood(touches, real):
    """All of the image differs from the first frame on, and stays so."""
    image = resting(real)
    other = MeasuredSensor(MeasuredOptics.load("vocdex"), real, np.random.default_rng(0)).background
    stage = DepthStage(load_tdn("fast", real))
    states = {stage.process(each, other).state for each in (image, np.roll(image, 1, axis=0))}
    assert states <= {ContactState.UNKNOWN, ContactState.FREE}


class Watcher:
    def __init__(self):
        self.frames = []

    def observe(self, *frame):
        self.frames.append(frame)


def test_checks_see_each_frame_once_after_its_contact_is_out(touches):
    images, background, _ = touches
    checks = fit, touched, gel = Watcher(), Watcher(), Watcher()
    stage = DepthStage(load_tdn("fast"), *checks)
    stage.deferred_update()
    contact = stage.process(images[0], background)
    assert fit.frames == touched.frames == gel.frames == []
    stage.deferred_update()
    assert [len(watcher.frames) for watcher in checks] == [1, 1, 1]
    assert touched.frames[0][0] is gel.frames[0][0] is images[0]
    for unseen in (images[0].copy(), background.copy()):  # an unchanged image, and no contact
        stage.process(unseen, background)
        stage.deferred_update()
    assert [len(watcher.frames) for watcher in checks] == [1, 1, 1]
    touched = contact.penetration > 0
    np.testing.assert_array_equal(in_steps(fit.frames[0][2])[touched], contact.penetration[touched])


def test_the_code_network_runs_for_new_contacts_only(touches):
    images, background, _ = touches
    depth, stage = DepthStage(load_tdn("fast")), CodeStage(load_tcn("fast"))
    assert stage.process(depth.process(background, background)).code is None
    contact = depth.process(images[0], background)
    first = stage.process(contact)
    again = stage.process(dataclasses.replace(contact, penetration=contact.penetration.copy()))
    np.testing.assert_array_equal(first.code, again.code)
    assert stage.skipped == {"no_contact": 1, "cloud_unchanged": 1}
    other = stage.process(depth.process(images[1], background))
    assert (other.code != first.code).any()


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((240, 320, 3), np.uint8),
        np.zeros((320, 240), np.uint8),
        np.zeros((320, 240, 3), np.uint16),
        np.zeros((320, 240, 3), np.float32),
        np.zeros((320, 240, 4), np.uint8),
        None,
    ],
)
def test_wrong_images_are_refused(touches, pipeline, image):
    with pytest.raises(InputError, match=r"tactile image: .*need"):
        pipeline.process(image, touches[1])


def test_wrong_background_is_named(touches, pipeline):
    with pytest.raises(InputError, match="background: "):
        pipeline.process(touches[0][0], np.zeros((10, 10, 3), np.uint8))


@pytest.mark.parametrize("level", [0, 255])
def test_black_and_white_images_stay_finite(touches, pipeline, level):
    touch = pipeline.process(np.full((320, 240, 3), level, np.uint8), touches[1])
    assert np.isfinite(touch.contact.penetration).all()
    assert touch.code is None or np.isfinite(touch.code).all()

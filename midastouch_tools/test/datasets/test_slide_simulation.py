import numpy as np
import pytest

from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.objects import bundled_objects
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn import load_tdn
from midastouch_tools import cli
from midastouch_tools.datasets import load_sequence, slide_simulation

LENGTH = "0.012"


@pytest.fixture(scope="module")
def slide(tmp_path_factory):
    out = tmp_path_factory.mktemp("slide") / "ball" / "00"
    assert cli.main(["simulate", "ball", "--out", str(out), "--length", LENGTH, "--seed", "3"]) == 0
    return out


def test_the_slide_is_a_sequence_with_everything(slide):
    sequence = load_sequence(slide)
    assert sequence.object_name == "ball"
    assert sequence.n_frames == 8
    assert len(sequence.ground_truth_frames) == 8
    step = np.linalg.norm(np.diff(sequence.poses_true[:, :3, 3], axis=0), axis=1)
    assert step == pytest.approx(np.full(7, 1.5e-3), rel=0.3)


def test_penetration_is_that_of_the_poses(slide):
    sequence = load_sequence(slide)
    renderer = PenetrationRenderer(ObjectMesh.load(bundled_objects()["ball"]), SensorModel.load("digit_tacto"))
    rendered = renderer.render(sequence.poses_true[4:5])[0]
    assert sequence.penetration_truth(4) == pytest.approx(rendered, abs=2e-6)
    assert 3e-4 < rendered.max() < 2.1e-3


def test_images_show_the_contact(slide):
    sequence = load_sequence(slide)
    touched = sequence.penetration_truth(4) > 1e-4
    change = np.abs(sequence.image(4).astype(int) - sequence.background).max(axis=-1)
    assert change[touched].mean() > 1.5 * change[~touched].mean()


@pytest.mark.parametrize("name", ["digit_tacto", "digit_real", "gelsight_mini"])
def test_a_sensors_light_is_the_one_its_network_reads(name, tmp_path):
    """Of another light, a slide would be measured at a third of its depth."""
    sensor, mesh = SensorModel.load(name), ObjectMesh.load(bundled_objects()["ball"])
    slide_simulation.simulate_sequence(mesh, sensor, float(LENGTH), 3, tmp_path / name)
    sequence, tdn = load_sequence(tmp_path / name), load_tdn("fast", sensor)
    assert sequence.sensor == name
    measured, true = [], []
    for i in range(sequence.n_frames):
        measured.append(tdn.predict(sequence.image(i), sequence.background).max())
        true.append(sequence.penetration_truth(i).max())
    assert 0.65 < np.median(np.divide(measured, true)) < 1.5


def test_measured_poses_carry_the_papers_noise(slide):
    sequence = load_sequence(slide)
    noise = se3.log(se3.inverse(sequence.poses_true) @ sequence.poses_measured)
    assert 1e-4 < np.abs(noise[:, :3]).mean() < 1e-3
    assert np.radians(0.2) < np.abs(noise[:, 3:]).mean() < np.radians(2)


def test_a_seed_fixes_the_sequence(slide, tmp_path):
    sensor, mesh = SensorModel.load("digit_tacto"), ObjectMesh.load(bundled_objects()["ball"])
    slide_simulation.simulate_sequence(mesh, sensor, float(LENGTH), 3, tmp_path / "again")
    for name in ("tactile_images/5.jpg", "background.png", "tactile_data.pkl"):
        assert (tmp_path / "again" / name).read_bytes() == (slide / name).read_bytes()


def test_a_cached_slide_is_not_simulated_again(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    sensor, mesh = SensorModel.load("digit_tacto"), ObjectMesh.load(bundled_objects()["ball"])
    first = slide_simulation.cached_slide(mesh, sensor, 0.003)
    monkeypatch.setattr(slide_simulation, "simulate_sequence", None)
    assert slide_simulation.cached_slide(mesh, sensor, 0.003) == first

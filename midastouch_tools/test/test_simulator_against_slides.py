"""Our simulator against slides that another renderer made."""

import numpy as np
import pytest

from midastouch_common.mesh import ObjectMesh
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_model import SensorModel
from midastouch_simulation.optics import TactoOptics
from midastouch_tools.datasets import load_sequence

OBJECTS = ["005_tomato_soup_can", "025_mug", "035_power_drill"]


@pytest.fixture(params=OBJECTS)
def slide(request, shared):
    mesh = ObjectMesh.load(shared / f"meshes/ycb/{request.param}.ply")
    return load_sequence(shared / f"data/ycb_slide_sim/{request.param}/00"), mesh


def test_penetration_is_exact(slide, shared):
    """To the stored truth's own quantisation of a micrometre."""
    sequence, mesh = slide
    truth = np.load(shared / f"data/ycb_slide_sim/{mesh.name}/00/penetration_truth.npz")
    rendered = PenetrationRenderer(mesh, SensorModel.load("digit_tacto")).render(sequence.poses_true[truth["frames"]])
    error = rendered - truth["penetration_um"] * 1e-6
    assert np.sqrt((error**2).mean()) < 1e-6


def test_optics_explain_the_images(slide):
    """The closed form predicts the smoothed change of TACTO's images to about a grey level."""
    import cv2

    sequence, mesh = slide
    sensor = SensorModel.load("digit_tacto")
    renderer, optics = PenetrationRenderer(mesh, sensor), TactoOptics(sensor)
    correlation = []
    for i in range(0, sequence.n_frames, 50):
        penetration, normals = renderer.render_with_normals(sequence.poses_true[i : i + 1])
        predicted = optics.difference(penetration[0], normals[0])
        seen = sequence.image(i).astype(np.float32) - sequence.background
        touched = np.abs(predicted).max(axis=2) > 1
        smooth = [cv2.GaussianBlur(x, (0, 0), 2)[touched].ravel() for x in (predicted, seen)]
        correlation.append(np.corrcoef(smooth)[0, 1])
    assert np.median(correlation) > 0.99

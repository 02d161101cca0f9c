"""How far the depth network's felt depth is off by a factor: what `relief_scale` of the filter stands for.

.venv/bin/python tools/fit_depth_scale.py ../shared/meshes/ycb ../shared/data/digit_backgrounds

Touches of training objects through random sensors (`RandomSensor`), without and with a calibration. Of each touch the
factor that fits best. Printed: the standard deviation of its logarithm (1.48 times the median deviation) over all
touches, between sensors, and between touches of one; the RMSE in contact before and after the factor.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from midastouch_perception.mesh import ObjectMesh
from midastouch_perception.sensor_calibration import standard_colours
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.simulation.contact_poses import ContactSampling, sample_contact_poses
from midastouch_perception.simulation.randomisation import RandomSensor
from midastouch_perception.simulation.renderer import PenetrationRenderer
from midastouch_perception.tdn import load_tdn
from midastouch_perception.tdn.inputs import ContactLight
from midastouch_perception.training.backgrounds import load_backgrounds
from midastouch_perception.training.touches import calibrate

OBJECTS = ("002", "010", "011", "013", "024", "030", "038", "040")  # neither tested on nor held out
SENSORS, TOUCHES = 48, 10
_PRESS = ContactSampling(press=(0.4e-3, 1.2e-3), free_share=0.0)
_SMALLEST = 60  # px of contact
_CONTACT = 3e-5  # m


def spread(values: np.ndarray) -> float:
    """Standard deviation by the median deviation from the median."""
    return float(1.4826 * np.median(np.abs(values - np.median(values))))


def felt_by_one(renderer: PenetrationRenderer, tdn, backgrounds: np.ndarray, calibrated: bool, rng) -> np.ndarray:
    """Rows (N, 3) of one random sensor's touches: log-factor, RMSE in contact [mm] before and after it."""
    sensor = RandomSensor(tdn.sensor, backgrounds, rng)
    response = calibrate(sensor, rng) if calibrated else None
    poses = sample_contact_poses(renderer.mesh, TOUCHES, rng, tdn.sensor, _PRESS)
    penetrations, normals = renderer.render_with_normals(poses)
    images, reference = sensor.images(penetrations, normals, rng)
    light, rows = ContactLight(reference, tdn.sensor.light), []
    for image, penetration in zip(images, penetrations, strict=True):
        change = light.difference(image)
        felt = tdn.penetration(standard_colours(response.slopes(change)) if response else change)
        if (penetration > 0).sum() < _SMALLEST or not felt.any():
            continue
        factor = float((felt * penetration).sum() / (penetration**2).sum())
        contact = (penetration > _CONTACT) | (felt > _CONTACT)
        errors = [1e3 * np.sqrt(np.mean((felt - scale * penetration)[contact] ** 2)) for scale in (1.0, factor)]
        rows.append([np.log(factor), *errors])
    return np.array(rows).reshape(-1, 3)


def main(meshes: str, folder: str) -> None:
    """Print the figures."""
    tdn = load_tdn("fast", SensorModel.load("digit_real"))
    paths = [next(Path(meshes).glob(f"{name}_*.ply")) for name in OBJECTS]
    renderers = [PenetrationRenderer(ObjectMesh.load(path), tdn.sensor) for path in paths]
    backgrounds = load_backgrounds(folder, tdn.sensor.height, tdn.sensor.width)[0]
    for calibrated in (False, True):
        rng = np.random.default_rng(0)
        by_sensor = [
            felt_by_one(renderers[k % len(renderers)], tdn, backgrounds, calibrated, rng) for k in range(SENSORS)
        ]
        logs = [rows[:, 0] for rows in by_sensor if len(rows)]
        medians = np.array([np.median(each) for each in logs])
        every = np.concatenate(by_sensor)
        print(
            f"{'calibrated' if calibrated else 'not calibrated'}: {len(every)} touches; log-factor: all "
            f"{spread(every[:, 0]):.2f}, between sensors {spread(medians):.2f}, of one "
            f"{spread(np.concatenate([each - np.median(each) for each in logs])):.2f}; "
            f"RMSE {np.median(every[:, 1]):.3f} mm, {np.median(every[:, 2]):.3f} mm with the factor"
        )


if __name__ == "__main__":
    main(*sys.argv[1:])

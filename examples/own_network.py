"""Localise with a code network of your own. Any object with these attributes will do: this one is not even a network.

midastouch simulate handle_tool --seed 3 --out out/slide
python examples/own_network.py out/slide

For a slide over a mesh of yours: python examples/own_network.py out/part_slides/1 20000 part.ply
"""

import time

import cv2
import numpy as np
from localise_offline import localise, run

from midastouch_filter import ParticleFilter
from midastouch_perception import ObjectMesh, SensorModel, TouchPipeline, build_codebook, load_tdn
from midastouch_perception.objects import bundled_mesh
from midastouch_tools.datasets import load_sequence


class ThumbnailNet:
    """Network whose code of a touch is its penetration map in small. Two touches are alike if their maps overlap.

    Attributes: network_id, which codebooks are checked against; dim, of a code; calibration, the sharpness of the
    likelihood: `temperature` of the similarity, and `outlier`, the fraction of touches that match nothing.
    """

    def __init__(self):
        self.network_id, self.dim = "thumbnail-1", 20 * 15
        self.calibration = {"temperature": 0.06, "outlier": 0.05}

    def encode(self, penetration: np.ndarray) -> np.ndarray:
        """Return unit codes (D,) or (N, D) float32 of maps (160, 120) or (N, 160, 120) m."""
        maps = penetration.reshape(-1, *penetration.shape[-2:])
        small = [cv2.resize(cv2.GaussianBlur(each, (0, 0), 6), (15, 20), interpolation=cv2.INTER_AREA) for each in maps]
        codes = np.reshape(small, (*penetration.shape[:-2], self.dim)).astype(np.float32)
        return codes / np.maximum(np.linalg.norm(codes, axis=-1, keepdims=True), 1e-12)


def main(folder: str = "out/slide", size: str = "20000", mesh_path: str = "") -> None:
    """Build a codebook of the slide's object with the network, and print where the sensor ends."""
    slide, network = load_sequence(folder), ThumbnailNet()
    mesh = ObjectMesh.load(mesh_path or bundled_mesh(slide.object_name))
    codebook = build_codebook(mesh, network, SensorModel.load("digit_tacto"), int(size))
    pipeline = TouchPipeline(load_tdn(), network, time.perf_counter)
    *_, last = localise(slide, pipeline, ParticleFilter(mesh, codebook))
    error = np.linalg.norm(last.pose[:3, 3] - slide.poses_true[-1, :3, 3])
    print(f"{last.status.state}, {1e3 * error:.1f} mm off: {last.status.reason}")


if __name__ == "__main__":
    run(main, __doc__)

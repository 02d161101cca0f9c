"""A simulated slide, kept in memory; its parameters and messages; a sender that plays it to and fro."""

from __future__ import annotations

import threading
import time
from collections import deque
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rclpy.publisher import Publisher
from sensor_msgs.msg import Image
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage
from tf_messages import tf_msg

from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_common.ros.conversions import image_to_msg, stamp_from_ns
from midastouch_perception.codebook_build import build_codebook
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tcn import load_tcn
from midastouch_tools.datasets import load_sequence
from midastouch_tools.datasets.slide_simulation import simulate_sequence

PATIENT = {"input_timeout": 1000.0}
T_BASE_OBJ = se3.make(se3.random_rotations(1, np.random.default_rng(9))[0], np.array([0.4, 0.1, 0.2]))


@dataclass(frozen=True)
class Slide:
    """Mesh, codebook and background as files; true poses T_obj_gel (N, 4, 4); images (320, 240, 3) uint8 RGB."""

    mesh: Path
    codebook: Path
    background: Path
    poses: np.ndarray
    images: list[np.ndarray]


def make_slide(path: Path, folder: Path) -> Slide:
    """A slide of 4 cm over the object of a mesh, with a small codebook by the shipped network."""
    mesh, sensor = ObjectMesh.load(path), SensorModel.load("digit_tacto")
    codebook = folder / f"{mesh.name}.npz"
    build_codebook(mesh, load_tcn("fast", sensor), sensor, size=1000, seed=0).save(codebook)
    simulate_sequence(mesh, sensor, 0.04, 3, folder / "slide")
    sequence = load_sequence(folder / "slide")
    images = [sequence.image(i) for i in range(sequence.n_frames)]
    return Slide(path, codebook, sequence.background_path, sequence.poses_true, images)


def filter_parameters(slide: Slide, **changes) -> dict:
    own = {"mesh": str(slide.mesh), "codebook": str(slide.codebook), "max_particles": 1000, "threads": 1}
    return {**own, **changes}


def tdn_parameters(slide: Slide, **changes) -> dict:
    return {"background": str(slide.background), **changes}


def image_at(slide: Slide, k: int, stamp: int) -> Image:
    return image_to_msg(slide.images[k], "rgb8", Header(stamp=stamp_from_ns(stamp), frame_id="digit_optical_frame"))


def transform_msg(T_obj_gel: np.ndarray, stamp: int, prefix: str = "") -> TFMessage:
    """The arm's word for where the sensor is."""
    return tf_msg(stamp, T_BASE_OBJ @ T_obj_gel, child=f"{prefix}digit_gel_frame")


class Sender:
    """While the `with` lasts, a thread publishes image and transform `fps` times a second, stamped with the wall clock.

    The transform goes out `late` seconds after its image. `sent` lists the stamps [ns].
    """

    def __init__(self, images: Publisher, tf: Publisher, slide: Slide, fps: float, late: float = 0.0):
        self._images, self._tf, self._slide = images, tf, slide
        self._period, self._late = 1.0 / fps, late
        self.sent: list[int] = []
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="sender")

    def __enter__(self) -> Sender:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stopping.set()
        self._thread.join()

    def _run(self) -> None:
        due, held = time.monotonic(), deque()
        while not self._stopping.is_set():
            now = time.monotonic()
            while held and held[0][0] <= now:
                self._tf.publish(held.popleft()[1])
            if now >= due:
                held.append((now + self._late, self._send_image()))
                due = max(due + self._period, now)
            upcoming = min(due, held[0][0]) if held else due
            self._stopping.wait(max(0.0, upcoming - time.monotonic()))
        for _, transform in held:
            self._tf.publish(transform)

    def _send_image(self) -> TFMessage:
        """Send the next image; the transform that belongs to it."""
        last = len(self._slide.poses) - 1
        k = last - abs(len(self.sent) % (2 * last) - last)
        stamp = time.time_ns()
        self._images.publish(image_at(self._slide, k, stamp))
        self.sent.append(stamp)
        return transform_msg(self._slide.poses[k], stamp)

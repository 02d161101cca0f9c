"""Camera image to penetration map with a trained depth network."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..errors import InputError
from ..onnx_network import OnnxNetwork
from ..sensor_model import SensorModel
from .inputs import SCALE, difference_input, geometry_input, reduce_image

EMBEDDING = "embedding"  # name of the network's second output


def check_image(image: np.ndarray, sensor: SensorModel, what: str) -> np.ndarray:
    """`image` if it is (H, W, 3) uint8 of the sensor's size; InputError naming `what` and the mend otherwise."""
    shape = (sensor.height, sensor.width, 3)
    if not isinstance(image, np.ndarray) or image.dtype != np.uint8:
        kind = getattr(image, "dtype", type(image).__name__)
        raise InputError(f"{what}: {kind} image, need uint8; convert it to 8 bit RGB")
    if image.shape != shape:
        raise InputError(f"{what}: image of shape {image.shape}, need {shape}; use the DIGIT's portrait QVGA image")
    return image


class TactileDepthNet:
    """The tactile depth network (TDN): image and background to penetration (paper section 4.1).

    Attributes: network_id; sensor, the map-resolution sensor model.
    """

    def __init__(self, name_or_path: str | Path = "fast", sensor: SensorModel | None = None, threads: int = 1):
        self._network = OnnxNetwork("tdn", name_or_path, threads)
        self._image_sensor = sensor or SensorModel.load("digit_tacto")
        self.sensor = self._image_sensor.scaled(SCALE)
        self._geometry = geometry_input(self.sensor)[None]
        self._background: tuple[np.ndarray, np.ndarray] | None = None

    @property
    def network_id(self) -> str:
        return self._network.network_id

    def difference(self, image: np.ndarray, background: np.ndarray) -> np.ndarray:
        """Difference (160, 120, 3) float32 grey levels of image and background (320, 240, 3) uint8 RGB.

        Raises InputError on wrong size or type.
        """
        if self._background is None or self._background[0] is not background:
            check_image(background, self._image_sensor, "background")
            self._background = background, reduce_image(background)
        return reduce_image(check_image(image, self._image_sensor, "tactile image")) - self._background[1]

    def predict(self, image: np.ndarray, background: np.ndarray) -> np.ndarray:
        """Penetration (160, 120) float32 m of one image; 0 where the network sees no contact."""
        return self.penetration(self.difference(image, background))

    def penetration(self, difference: np.ndarray) -> np.ndarray:
        """Penetration of difference images (160, 120, 3) or (N, 160, 120, 3): (160, 120) or (N, 160, 120) m."""
        out = self._network.run(*self._batch(difference))
        penetration = np.where(out[:, 1] > 0, np.maximum(out[:, 0], 0), 0) * np.float32(1e-3)
        return penetration.reshape(difference.shape[:-1])

    @property
    def has_embedding(self) -> bool:
        """Whether the network also gives its bottleneck."""
        return EMBEDDING in self._network.outputs

    def embedding(self, difference: np.ndarray) -> np.ndarray:
        """Bottleneck features (N, E) float32, L2-normalised, of difference images (N, 160, 120, 3).

        The image embedding that the paper compares its codes with (appendix B). Only where `has_embedding`.
        """
        return self._network.run(*self._batch(difference), output=EMBEDDING)

    def _batch(self, difference: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        batch = difference_input(np.atleast_1d(difference).reshape(-1, *difference.shape[-3:]))
        geometry = np.broadcast_to(self._geometry, (len(batch), *self._geometry.shape[1:]))
        return batch, np.ascontiguousarray(geometry)


def load_tdn(name_or_path: str | Path = "fast", sensor: SensorModel | None = None, threads: int = 1) -> TactileDepthNet:
    """A depth network by name (`fast`) or ONNX path, for images of `sensor` (default `digit_tacto`)."""
    return TactileDepthNet(name_or_path, sensor, threads)

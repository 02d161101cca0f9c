"""Camera image to penetration map with a trained depth network."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..model_card import read_card
from ..onnx_network import OnnxNetwork, network_path
from ..sensor_model import SensorModel
from .fcrn import FcrnDepthNet
from .inputs import SCALE, check_image, difference_input, geometry_input, reduce_image

EMBEDDING = "embedding"  # name of the network's second output


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

    def predict(self, image: np.ndarray, background: np.ndarray, difference: np.ndarray | None = None) -> np.ndarray:
        """Penetration (160, 120) float32 m of one image; 0 where the network sees no contact.

        difference: `difference(image, background)`, if at hand.
        """
        return self.penetration(self.difference(image, background) if difference is None else difference)

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


def load_tdn(
    name_or_path: str | Path = "fast", sensor: SensorModel | None = None, threads: int = 1
) -> TactileDepthNet | FcrnDepthNet:
    """A depth network by name (`fast`) or ONNX path, for images of `sensor` (default `digit_tacto`)."""
    card = read_card(network_path("tdn", name_or_path))
    network = FcrnDepthNet if card.get("architecture") == "fcrn" else TactileDepthNet
    return network(name_or_path, sensor, threads)

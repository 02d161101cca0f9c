"""The paper's own depth network (FCRN), with imported weights: from camera image to penetration map."""

from __future__ import annotations

import cv2
import numpy as np

from .depth_net import DepthNet
from .inputs import check_image

HEIGHT_UNIT = 3e-5  # m per grey level of the height maps that the network was trained on
# The network is a regression of height: on untouched gel its error is some units to either side. As in the official
# code, less than five units is no contact.
_FLOOR = 5 * HEIGHT_UNIT

BLOCKS = (3, 4, 6, 3)  # bottlenecks of each ResNet level
# kernel (height, width) and zero padding (top, left, bottom, right) of the four convolutions of an up-projection; each
# gives one pixel of every 2 x 2 of the output
QUARTERS = (((3, 3), (1, 1, 1, 1)), ((2, 3), (1, 1, 0, 1)), ((3, 2), (1, 1, 1, 0)), ((2, 2), (1, 1, 0, 0)))
NORM = ("weight", "bias", "running_mean", "running_var")


class FcrnDepthNet(DepthNet):
    """The paper's depth network. It was trained on whole images, and so needs no background.

    It works at the image's resolution and takes some 0.2 s per frame on one core.
    """

    uses_calibration = False

    def _prepare(self) -> None:
        self._sag = (self.sensor.gel_distance - self.sensor.gel_depth).astype(np.float32)

    def height(self, image: np.ndarray) -> np.ndarray:
        """Return the network's own output: height (320, 240) float32 m above the plane through the gel's apex.

        image: (320, 240, 3) uint8 RGB. It is stretched to the full range, all channels together, as in the official
        code.
        """
        check_image(image, self._image_sensor, "tactile image")
        stretched = cv2.normalize(image, None, 0, 255, cv2.NORM_MINMAX)
        batch = np.ascontiguousarray(np.moveaxis(stretched, -1, 0)[None], np.float32)
        return self._network.run(batch)[0, 0] * np.float32(HEIGHT_UNIT)

    def predict(self, image: np.ndarray, background: np.ndarray, difference: np.ndarray | None = None) -> np.ndarray:
        """Return the penetration (160, 120) float32 m of one image: its height above the undeformed gel, each pixel the
        mean of four. The background is not used."""
        height = cv2.resize(self.height(image), self._sag.shape[::-1], interpolation=cv2.INTER_AREA)
        penetration = height - self._sag
        return np.where(penetration >= _FLOOR, penetration, np.float32(0))


def expected_shapes() -> dict[str, tuple[int, ...]]:
    """Return names and shapes of the official state dict, without the batch counters."""
    kernels, norms, biases = {"conv1": (64, 3, 7, 7)}, {"bn1": 64}, {"conv3": 1}
    inner = 64
    for level, blocks in enumerate(BLOCKS):
        width = 64 << level
        for block in range(blocks):
            name = f"layer{level + 1}.{block}"
            kernels[f"{name}.conv1"] = (width, inner, 1, 1)
            kernels[f"{name}.conv2"] = (width, width, 3, 3)
            kernels[f"{name}.conv3"] = (4 * width, width, 1, 1)
            norms |= {f"{name}.bn1": width, f"{name}.bn2": width, f"{name}.bn3": 4 * width}
            if block == 0:
                kernels[f"{name}.downsample.0"] = (4 * width, inner, 1, 1)
                norms[f"{name}.downsample.1"] = 4 * width
            inner = 4 * width
    kernels["conv2"], norms["bn2"] = (1024, 2048, 1, 1), 1024
    for level in range(1, 5):
        inner, width = 2048 >> level, 1024 >> level
        for branch in (1, 2):
            for k, (size, _) in enumerate(QUARTERS, 1):
                kernels[f"up{level}.conv{branch}_{k}"] = (width, inner, *size)
        kernels[f"up{level}.conv3"] = (width, width, 3, 3)
        norms |= {f"up{level}.{norm}": width for norm in ("bn1_1", "bn1_2", "bn2")}
    kernels["conv3"] = (1, 64, 3, 3)
    biases |= {name: shape[0] for name, shape in kernels.items() if name.startswith("up")}
    shapes: dict[str, tuple[int, ...]] = {f"{name}.weight": shape for name, shape in kernels.items()}
    shapes |= {f"{name}.bias": (channels,) for name, channels in biases.items()}
    return shapes | {f"{name}.{part}": (channels,) for name, channels in norms.items() for part in NORM}

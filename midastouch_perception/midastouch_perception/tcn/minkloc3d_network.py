"""MinkLoc3D: a feature pyramid of sparse 3-D convolutions, pooled to one code (Komorowski, WACV 2021).

It is the paper's tactile code network (section 4.2). Each convolution gathers, for one kernel offset at a time, the
rows that have a neighbour there, multiplies them by the offset's matrix and adds the result to the output rows; within
one offset no row occurs twice. Batch normalisation is folded into the convolutions before it, and the 1 x 1 convolution
at the top of the pyramid into the transposed one after it: both are linear.

Voxels follow the conventions of MinkowskiEngine, for which the weights were made: a coarse coordinate is the fine one
halved and rounded down; the offsets of a cubic kernel run with x fastest.
"""

from __future__ import annotations

import math

import numpy as np

import midastouch_kernels as kernels
from midastouch_common.errors import InputError

_EPSILON = 1e-5  # of batch normalisation
_FLOOR = 1e-6  # of generalised-mean pooling
DIM = 256
_MARGIN = 2  # voxels kept free around the cloud, so that no kernel up to 5 wide reaches into another row


def expected_shapes() -> dict[str, tuple[int, ...]]:
    """Return names and shapes of the official state dict, without the batch counters."""
    kernels = {
        "backbone.conv0": (125, 1, 32),
        "backbone.convs.0": (8, 32, 32),
        "backbone.convs.1": (8, 32, 32),
        "backbone.convs.2": (8, 64, 64),
        "backbone.blocks.1.0.downsample.0": (32, 64),
        "backbone.conv1x1.0": (64, DIM),
        "backbone.conv1x1.1": (64, DIM),
        "backbone.tconvs.0": (8, DIM, DIM),
    }
    norms = {"backbone.bn0": 32, "backbone.blocks.1.0.downsample.1": 64}
    for level, (inner, outer) in enumerate(((32, 32), (32, 64), (64, 64))):
        norms[f"backbone.bn.{level}"] = inner
        for k, columns in ((1, inner), (2, outer)):
            kernels[f"backbone.blocks.{level}.0.conv{k}"] = (27, columns, outer)
            norms[f"backbone.blocks.{level}.0.norm{k}"] = outer
    shapes = {f"{name}.kernel": shape for name, shape in kernels.items()}
    for name, channels in norms.items():
        shapes |= {f"{name}.bn.{part}": (channels,) for part in ("weight", "bias", "running_mean", "running_var")}
    return shapes | {"pooling.p": (1,)}


class Voxels:
    """Occupied voxels of one level.

    Attributes: coordinates (N, 3) int64, each voxel once, sorted with x fastest, in units of this level's voxels.
    """

    def __init__(self, coordinates: np.ndarray):
        coordinates = np.asarray(coordinates, np.int64)
        low = coordinates.min(axis=0) - _MARGIN
        size = coordinates.max(axis=0) - low + 1 + _MARGIN
        if math.prod(int(s) for s in size) >= 2**62:
            raise InputError(f"voxel grid of {' x '.join(map(str, size))} is too fine; use a larger voxel size")
        self._width, self._plane = size[0], size[0] * size[1]
        keys = (coordinates - low) @ np.array([1, self._width, self._plane])
        self._keys, first, self._inverse = np.unique(keys, return_index=True, return_inverse=True)
        self.coordinates = coordinates[first]

    def coarser(self) -> tuple[Voxels, np.ndarray, np.ndarray]:
        """Return voxels of twice the size and, for each voxel here, the row (N,) of the one that contains it and its
        part (N,) among the eight there, x + 2 y + 4 z."""
        voxels = Voxels(self.coordinates >> 1)
        return voxels, voxels._inverse, (self.coordinates & 1) @ np.array([1, 2, 4])

    def neighbours(self, radius: int) -> np.ndarray:
        """Return rows ((2 radius + 1)^3, N) int32 of the voxels at each offset of a cubic kernel; -1 for no voxel."""
        return kernels.neighbours(self._keys, self._width, self._plane, radius)


def quantise(cloud: np.ndarray, voxel_size: float) -> Voxels:
    """Return the voxels of edge `voxel_size` occupied by a cloud (N, 3), N >= 1, both in the same unit."""
    return Voxels(np.floor(cloud / np.float32(voxel_size)))


class MinkLoc3D:
    """Network with the weights of a state dict, names and shapes as in `expected_shapes`."""

    def __init__(self, state: dict[str, np.ndarray]):
        def folded(convolution: str, norm: str) -> tuple[np.ndarray, np.ndarray]:
            part = {k: state[f"{norm}.bn.{k}"].astype(float) for k in ("weight", "bias", "running_mean", "running_var")}
            scale = part["weight"] / np.sqrt(part["running_var"] + _EPSILON)
            kernel = state[f"{convolution}.kernel"] * scale
            return kernel.astype(np.float32), (part["bias"] - part["running_mean"] * scale).astype(np.float32)

        backbone = "backbone."
        self._stem = folded(f"{backbone}conv0", f"{backbone}bn0")
        self._down = [folded(f"{backbone}convs.{i}", f"{backbone}bn.{i}") for i in range(3)]
        blocks = [f"{backbone}blocks.{i}.0." for i in range(3)]
        self._blocks = [[folded(f"{b}conv{k}", f"{b}norm{k}") for k in (1, 2)] for b in blocks]
        self._shortcut = folded(f"{blocks[1]}downsample.0", f"{blocks[1]}downsample.1")
        top = state[f"{backbone}conv1x1.0.kernel"].astype(float)
        self._top_down = (top @ state[f"{backbone}tconvs.0.kernel"].astype(float)).astype(np.float32)
        self._lateral = state[f"{backbone}conv1x1.1.kernel"].astype(np.float32)
        self._power = np.float32(state["pooling.p"][0])

    def __call__(self, voxels: Voxels) -> np.ndarray:
        """Return the code (256,) float32, positive, not normalised, of one cloud's voxels."""
        return self._pool(self.features(voxels)["pyramid"][1])

    def features(self, voxels: Voxels) -> dict[str, tuple[Voxels, np.ndarray]]:
        """Return voxels and features (N, C) float32 after each part of the network: stem, down0, ..., pyramid."""
        kernel, bias = self._stem
        # the input feature is 1 everywhere, so a neighbour adds its offset's row of the kernel
        occupied = (voxels.neighbours(2) >= 0).astype(np.float32)
        x = np.maximum(occupied.T @ kernel[:, 0] + bias, 0)
        out = {"stem": (voxels, x)}
        for level in range(3):
            voxels, holder, part = voxels.coarser()
            kernel, bias = self._down[level]
            y = np.tile(bias, (len(voxels.coordinates), 1))
            for o in range(8):
                rows = np.flatnonzero(part == o)
                y[holder[rows]] += x[rows] @ kernel[o]
            x = np.maximum(y, 0, out=y)
            out[f"down{level}"] = voxels, x
            x = self._block(level, x, voxels.neighbours(1))
            out[f"block{level}"] = voxels, x
        fine_voxels, fine = out["block1"]
        pyramid = fine @ self._lateral
        for o in range(8):
            rows = np.flatnonzero(part == o)
            pyramid[rows] += x[holder[rows]] @ self._top_down[o]
        out["pyramid"] = fine_voxels, pyramid
        return out

    def _pool(self, features: np.ndarray) -> np.ndarray:
        """Return the generalised mean (C,) over the rows of features (N, C); overwrites them (new memory is slow)."""
        np.maximum(features, _FLOOR, out=features)
        np.power(features, self._power, out=features)
        return features.mean(axis=0) ** (1 / self._power)

    def _block(self, level: int, x: np.ndarray, neighbours: np.ndarray) -> np.ndarray:
        """Apply a residual block: two 3 x 3 x 3 convolutions and a shortcut."""
        first, second = self._blocks[level]
        y = _convolve(x, neighbours, *first)
        y = _convolve(np.maximum(y, 0, out=y), neighbours, *second)
        if level == 1:
            kernel, bias = self._shortcut
            x = x @ kernel + bias
        y += x
        return np.maximum(y, 0, out=y)


def _convolve(x: np.ndarray, neighbours: np.ndarray, kernel: np.ndarray, bias: np.ndarray) -> np.ndarray:
    """Return features (N, D) of a 3 x 3 x 3 convolution that keeps the voxels of x (N, C)."""
    centre = len(kernel) // 2
    out = x @ kernel[centre]
    out += bias
    for o, rows in enumerate(neighbours):
        if o != centre:
            here = np.flatnonzero(rows >= 0)
            out[here] += x[rows[here]] @ kernel[o]
    return out

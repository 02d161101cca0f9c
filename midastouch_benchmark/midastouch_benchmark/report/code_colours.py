"""Codes as colours: what feels alike looks alike."""

from __future__ import annotations

import cv2
import numpy as np
from scipy.spatial import cKDTree
from sklearn.manifold import TSNE

from midastouch_perception.codebook import Codebook

_CELL = 3e-3  # m
_MAPPED = 1000  # codes; t-SNE takes some 3 s for them
_FEWEST_MAPPED = 100  # t-SNE needs more codes than its perplexity of 30
_LIGHTNESS, _CHROMA = 70.0, 75.0


def codebook_places(codebook: Codebook) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places (C, 3) m of a codebook with their mean outward normals (C, 3) and mean codes (C, D).

    A place is 3 mm of the surface on one side of a thin part. The mean over its entries, which differ in yaw, tells
    of the surface and not of how a finger lies on it.
    """
    position, outward = codebook.poses[:, :3, 3], codebook.poses[:, :3, 2]
    keys = np.hstack([np.rint(position / _CELL), np.rint(outward)])
    _, place, count = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    place = place.ravel()

    def mean(values: np.ndarray) -> np.ndarray:
        return np.stack([np.bincount(place, column) for column in values.T], axis=1) / count[:, None]

    return mean(position), mean(outward), mean(codebook.codes)


def code_colours(codes: np.ndarray) -> np.ndarray:
    """RGB (C, 3) in [0, 1] of codes (C, D): their t-SNE map (as in the paper's figure 3) laid over a plane of CIELAB.

    The map's axes are replaced by ranks, so that the colours are used evenly. Of many codes some are mapped, and the
    others have the colour of the nearest of those.
    """
    chosen = np.unique(np.linspace(0, len(codes) - 1, _MAPPED).round().astype(int))
    ranks = _plane(codes[chosen]).argsort(axis=0).argsort(axis=0)
    a, b = (2 * ranks / max(len(chosen) - 1, 1) - 1).T
    lab = np.stack([np.full(len(chosen), _LIGHTNESS), _CHROMA * a, _CHROMA * b], axis=1).astype(np.float32)
    colours = np.clip(cv2.cvtColor(lab[None], cv2.COLOR_Lab2RGB)[0], 0, 1).astype(float)
    return colours[cKDTree(codes[chosen]).query(codes)[1]]


def _plane(codes: np.ndarray) -> np.ndarray:
    """Codes (C, D) as points (C, 2) of a plane, like ones near each other."""
    if len(codes) < _FEWEST_MAPPED:
        plane = np.zeros((len(codes), 2))
        plane[:, : codes.shape[1]] = codes[:, :2]
        return plane
    return TSNE(init="pca", random_state=0).fit_transform(codes.astype(np.float32))

"""Codes cut to fewer numbers, to see how long they have to be."""

from __future__ import annotations

import dataclasses

import numpy as np

from midastouch_filter.core.touch import Measurement
from midastouch_perception.codebook import Codebook

from .trial import TrialFrame


class ShortCodes:
    """Projects codes onto the `length` orthogonal directions that keep most of a codebook's codes, and normalises them.

    Principal components about the origin, not about the mean: of all projections they keep cosines best, in the mean
    of squares. Calibration of the score is left as it is.
    """

    def __init__(self, codes: np.ndarray, length: int):
        """`codes` (M, D) of the codebook; length at most D."""
        codes = np.asarray(codes, float)
        _, directions = np.linalg.eigh(codes.T @ codes)  # by rising share
        self._basis = directions[:, ::-1][:, :length]

    def shorten(self, codes: np.ndarray) -> np.ndarray:
        """Unit codes (..., length) float32 of codes (..., D)."""
        short = np.asarray(codes, float) @ self._basis
        short /= np.maximum(np.linalg.norm(short, axis=-1, keepdims=True), 1e-12)
        return short.astype(np.float32)

    def codebook(self, codebook: Codebook) -> Codebook:
        """The codebook with short codes."""
        return Codebook(codebook.poses, self.shorten(codebook.codes), codebook.meta)

    def frame(self, frame: TrialFrame) -> TrialFrame:
        """A frame with short codes."""
        others = {name: self._felt(touch) for name, touch in frame.others.items()}
        return dataclasses.replace(frame, felt=self._felt(frame.felt), others=others)

    def _felt(self, touch: Measurement) -> Measurement:
        return touch if touch.code is None else dataclasses.replace(touch, code=self.shorten(touch.code))

"""Measurement model: evidence of a tactile code for each pose of a codebook (paper equation 2, calibrated).

The paper weighs particles by a softmax of cosines, whose ratios never exceed e^2. Here the similarity s of the
measured code to a codebook entry becomes a log-likelihood ratio against a random touch of the same object,

    l = log((1 - outlier) exp(s / T) / mean over the codebook(exp(s / T)) + outlier),

with temperature T and outlier fraction fitted when the network was trained (an InfoNCE-trained similarity is such a
ratio up to its temperature). l = 0: the touch is no evidence; l = log(outlier): it speaks fully against the pose.
Hypotheses at poses of their own are weighed by maps rendered there, in `comparison.py`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

import midastouch_kernels as kernels
from midastouch_common.errors import InputError

from .config import FilterConfig
from .workers import Workers

_SPARSE = 16  # stride through the sample below that is enough for a code's typical similarity
_SAMPLE = 2048  # codebook entries that stand for all of them


class MeasurementModel:
    """Likelihood of a measured code at the entries of one object's codebook.

    Args: codes (M, D), in the order of the look-up's poses; meta, which holds `temperature` and `outlier`; config;
    workers. Attributes: codes, float32; outlier.
    Raises InputError if codes or calibration cannot be used.
    """

    def __init__(self, codes: np.ndarray, meta: dict, config: FilterConfig, workers: Workers):
        self.codes = np.ascontiguousarray(codes, np.float32)
        if not np.isfinite(self.codes).all():
            raise InputError("codebook: codes are not finite; build it again with `midastouch build-codebook`")
        self._temperature, self.outlier = calibration(meta, config)
        self._workers = workers
        self._every = np.arange(len(self.codes))
        self._sampled_codes = self.codes[:: max(len(self.codes) // _SAMPLE, 1)].copy()

    @property
    def dimension(self) -> int:
        """Length of the codes."""
        return self.codes.shape[1]

    def unit_code(self, code: np.ndarray | None) -> np.ndarray:
        """Return the measured code (D,) float32 at unit length; raises ValueError with the reason if it is unusable."""
        if code is None:
            raise ValueError("no code in a touch")
        code = np.asarray(code, np.float32).ravel()
        if len(code) != self.dimension:
            raise ValueError(f"code of length {len(code)} instead of {self.dimension}")
        norm = np.linalg.norm(code.astype(float))
        if not np.isfinite(norm):
            raise ValueError("code is not finite")
        if norm < 1e-6:
            raise ValueError("code is zero")
        return (code / norm).astype(np.float32)

    def likelihoods(self, code: np.ndarray) -> np.ndarray:
        """Return the likelihoods (M,) float32 of a unit code (D,) at all entries, up to a factor common to all objects.

        It runs in our own threads: those of BLAS would spin next to them and double the time of a step.
        """
        cosines, code = np.empty(len(self.codes), np.float32), np.ascontiguousarray(code, np.float32)
        self._workers.run(
            len(cosines), lambda low, high, _: kernels.dot_rows(low, high, self.codes, self._every, code, cosines)
        )
        return self.similarity(cosines)

    def similarity(self, cosines: np.ndarray) -> np.ndarray:
        """Return the likelihood (...), up to a factor, of cosines (...) between codes."""
        return np.exp((cosines - 1) / np.float32(self._temperature))

    def log_ratio_between(self, codes: np.ndarray, similarity: np.ndarray) -> np.ndarray:
        """Return l (n, m) of codes (n, D) at m poses, given their similarity (n, m) there."""
        typical = self.similarity(codes @ self._sampled_codes[::_SPARSE].T).mean(axis=1)
        return np.log((1 - self.outlier) * similarity / typical[:, None] + self.outlier)


def log_ratios(models: Sequence[MeasurementModel], code: np.ndarray) -> list[np.ndarray]:
    """Return l (M,) float32 of a unit code (D,) at every entry of each object, against a random touch of any object."""
    every = [model.likelihoods(code) for model in models]
    outlier = models[0].outlier
    mean = sum(float(each.sum(dtype=float)) for each in every) / sum(map(len, every))
    return [np.log((1 - outlier) / max(mean, 1e-30) * each + np.float32(outlier)) for each in every]


def calibration(meta: dict, config: FilterConfig) -> tuple[float, float]:
    """Return temperature and outlier fraction: the configured ones, or those of a codebook's metadata; raises
    InputError if it has none."""
    return (
        config.temperature or _calibration(meta, "temperature", np.inf),
        config.outlier or _calibration(meta, "outlier", 1.0),
    )


def _calibration(meta: dict, name: str, below: float) -> float:
    """Return the number `name` in a codebook's metadata; raises InputError unless it lies between 0 and `below`."""
    try:
        value = float(meta[name])
    except (KeyError, TypeError, ValueError):
        value = np.nan
    if not 0 < value < below:
        raise InputError(f"codebook: {name} {meta.get(name)} is not a calibration; build it again")
    return value

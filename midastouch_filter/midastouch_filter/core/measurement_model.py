"""Measurement model: what a tactile code says about each particle (paper equation 2, calibrated).

The paper weighs particles by a softmax of cosines, whose ratios never exceed e^2. Here the similarity s of the
measured code to a codebook entry becomes a log-likelihood ratio against a random touch of the same object,

    l = log((1 - outlier) exp(s / T) / mean over the codebook(exp(s / T)) + outlier),

with temperature T and outlier fraction fitted when the network was trained (an InfoNCE-trained similarity is such a
ratio up to its temperature). l = 0: the touch tells nothing; l = log(outlier): it speaks fully against.
"""

from __future__ import annotations

import copy

import numpy as np

import midastouch_kernels as kernels
from midastouch_common.errors import InputError

from .config import FilterConfig
from .particles import Particles
from .touch import Measurement
from .workers import Workers

_SPARSE = 16  # stride through the sample below that is enough to find what is typical of a code
_SAMPLE = 2048  # codebook entries that stand for the rest of the codebook while only occupied entries are scored


class CodeScores:
    """Scores codes (M, D) by a measured one.

    Args: codes; meta, which holds `temperature` and `outlier`; config; workers.
    Attributes: codes, float32; log_ratio (M,) float32, l of the entries scored last, others hold stale values; outlier.
    """

    def __init__(self, codes: np.ndarray, meta: dict, config: FilterConfig, workers: Workers):
        self.codes = np.ascontiguousarray(codes, np.float32)
        if not np.isfinite(self.codes).all():
            raise InputError("codebook: codes are not finite; build it again with `midastouch build-codebook`")
        self._temperature, self.outlier = calibration(meta, config)
        self._workers = workers
        self._every = np.arange(len(self.codes))
        self._forget()

    def _forget(self) -> None:
        self.log_ratio = np.zeros(len(self.codes), np.float32)
        self._scored: np.ndarray | None = None  # code by which all of `log_ratio` stands

    @property
    def dimension(self) -> int:
        """Length of the codes."""
        return self.codes.shape[1]

    def unit_code(self, code: np.ndarray | None) -> np.ndarray:
        """The measured code (D,) float32 at unit length; raises ValueError saying why it cannot be used."""
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

    def score_codebook(self, code: np.ndarray) -> None:
        """Set `log_ratio` of every entry by one matrix-vector product with the unit code (D,); once for each code."""
        if self._scored is not None and np.array_equal(code, self._scored):
            return
        likelihood = self._relative_likelihood(self._similarity(self.codes, self._every, code))
        self._set(slice(None), likelihood, float(likelihood.mean(dtype=float)))
        self._scored = code

    def log_ratio_of(self, touch: Measurement) -> np.ndarray:
        """(M,) float32: that of a touch's code, of every entry; valid until the next code is scored."""
        self.score_codebook(self.unit_code(touch.code))
        return self.log_ratio

    def _similarity(self, codes: np.ndarray, rows: np.ndarray, code: np.ndarray) -> np.ndarray:
        """Cosines (n,) float32 of the codes (m, D) at `rows` (n,) with a unit code.

        In our own threads: those of BLAS would spin beside them, and double the time of a step.
        """
        out = np.empty(len(rows), np.float32)
        code = np.ascontiguousarray(code, np.float32)
        self._workers.run(len(rows), lambda low, high, _: kernels.dot_rows(low, high, codes, rows, code, out))
        return out

    def _relative_likelihood(self, scores: np.ndarray) -> np.ndarray:
        return np.exp((scores - scores.max()) * np.float32(1 / self._temperature))

    def _set(self, rows: np.ndarray | slice, likelihood: np.ndarray, mean: float) -> None:
        likelihood *= np.float32((1 - self.outlier) / mean)
        likelihood += np.float32(self.outlier)
        self.log_ratio[rows] = np.log(likelihood, out=likelihood)


class MeasurementModel(CodeScores):
    """Scores codebook entries by a measured code and hands the scores to particles."""

    def __init__(self, codes: np.ndarray, meta: dict, config: FilterConfig, workers: Workers):
        """`codes` (M, D) in the order of the look-up's poses; the others as of `CodeScores`."""
        super().__init__(codes, meta, config, workers)
        self._sample = self._every[:: max(len(self.codes) // _SAMPLE, 1)].copy()
        self._sampled_codes = self.codes[self._sample]

    def for_another_sensor(self) -> MeasurementModel:
        """A model of the same codes with scores of its own."""
        other = copy.copy(self)
        other._forget()
        return other

    def score_occupied(self, code: np.ndarray, particles: Particles) -> None:
        """Set `log_ratio` only of the entries nearest to particles.

        The mean over the codebook is then the exact sum over these entries, and a fixed sample's over the rest.
        """
        self._scored = None
        rows, others = kernels.occupied_entries(particles.entries, len(self.codes), self._sample)
        scores = self._similarity(self.codes, rows, code), self._similarity(self._sampled_codes, others, code)
        likelihood = self._relative_likelihood(np.concatenate(scores))
        here, elsewhere = likelihood[: len(rows)], likelihood[len(rows) :]
        rest = elsewhere.mean(dtype=float) * (len(self.codes) - len(rows)) if len(elsewhere) else 0.0
        self._set(rows, here, (here.sum(dtype=float) + rest) / len(self.codes))

    def similarity(self, cosines: np.ndarray) -> np.ndarray:
        """Likelihood (...) up to a factor, of cosines (...) between codes."""
        return np.exp((cosines - 1) / np.float32(self._temperature))

    def log_ratio_between(self, codes: np.ndarray, similarity: np.ndarray) -> np.ndarray:
        """l (n, m) of codes (n, D) at m poses, which they have a similarity (n, m) with."""
        typical = self.similarity(codes @ self._sampled_codes[::_SPARSE].T).mean(axis=1)
        return np.log((1 - self.outlier) * similarity / typical[:, None] + self.outlier)

    def log_likelihood(self, particles: Particles) -> np.ndarray:
        """l (N,) float32 of each particle: that of its entry."""
        return self.log_ratio[particles.entries]

    def draw_matches(self, n: int, rng: np.random.Generator) -> np.ndarray:
        """n entries (n,) int32 drawn by their likelihood; needs `score_codebook` for the same code before."""
        cumulative = np.cumsum(np.exp(self.log_ratio, dtype=float))
        return np.searchsorted(cumulative, rng.random(n) * cumulative[-1], side="right").astype(np.int32)


def calibration(meta: dict, config: FilterConfig) -> tuple[float, float]:
    """Temperature and outlier fraction: configured, or else a codebook's; raises InputError if its metadata has
    none."""
    return (
        config.temperature or _calibration(meta, "temperature", np.inf),
        config.outlier or _calibration(meta, "outlier", 1.0),
    )


def _calibration(meta: dict, name: str, below: float) -> float:
    """The number `name` in a codebook's metadata; InputError unless it lies between 0 and `below`."""
    try:
        value = float(meta[name])
    except (KeyError, TypeError, ValueError):
        value = np.nan
    if not 0 < value < below:
        raise InputError(f"codebook: {name} {meta.get(name)} is not a calibration; build it again")
    return value

"""Has the object jumped? A Kalman filter without a jump, and one for each of the last frames, with a jump just then.

Bayesian change-point detection (Adams and MacKay 2007): the odds between a filter and the one without a jump are a
Bayes factor. The state of all is [error of the pose, further errors that stay]; a jump is one of the pose.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

POSE = slice(0, 6)
"""The error of the pose among the errors: m, rad."""
DECISIVE = 9.0
"""Log-odds [nats] from which a jump of the object is certain: `midastouch_benchmark/fits/object_motion.py`."""
_DRIFT = np.repeat([3e-5, np.radians(0.05)], 3) ** 2  # m^2, rad^2 a frame: a pose's error is not quite constant
_FREEDOM = 10.0  # degrees of freedom of the innovations' t distribution: some alignments are wrong altogether
_WINDOW = 10  # frames within which a jump must become certain


@dataclass
class JumpHypotheses:
    """One row each, the first without a jump.

    mean (K, D) and covariance (K, D, D) of the errors; before (K, D), the mean as the frames before the jump had it;
    log_odds (K,) against the first; age (K,), frames since the jump.
    """

    mean: np.ndarray
    before: np.ndarray
    covariance: np.ndarray
    log_odds: np.ndarray
    age: np.ndarray

    @classmethod
    def only(cls, covariance: np.ndarray) -> JumpHypotheses:
        """No jump; errors of mean zero and covariance (D, D)."""
        mean = np.zeros((1, len(covariance)))
        return cls(mean, mean.copy(), covariance[None], np.zeros(1), np.zeros(1, int))

    def __getitem__(self, rows: np.ndarray | list[int]) -> JumpHypotheses:
        return JumpHypotheses(*(value[rows] for value in vars(self).values()))

    def __add__(self, other: JumpHypotheses) -> JumpHypotheses:
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return JumpHypotheses(*(np.concatenate(pair) for pair in pairs))

    def propagate(self, transition: np.ndarray) -> None:
        """One frame later: errors change by transition (D, D)."""
        self.mean, self.before = self.mean @ transition.T, self.before @ transition.T
        self.covariance = transition @ self.covariance @ transition.T
        self.covariance[:, np.arange(6), np.arange(6)] += _DRIFT
        self.age = self.age + 1

    def with_one_now(self, jump: np.ndarray) -> JumpHypotheses:
        """These without what is too old to be decided, and a jump in this frame, of covariance (6, 6)."""
        new = self[[0]]
        new.before, new.age = new.mean, np.zeros(1, int)
        new.covariance[:, POSE, POSE] += jump
        return self[(self.age < _WINDOW) | (np.arange(len(self.age)) == 0)] + new

    def weigh(self, error: np.ndarray, information: np.ndarray, jitter: np.ndarray) -> None:
        """The pose's error was seen to be `error` (6,), with information (6, 6), which may be none in some directions,
        from a sensor pose of covariance `jitter` (6, 6).

        Kalman update of all, by a t distribution (its weights are those of a robust estimator).
        """
        innovation = error - self.mean[:, POSE]
        noise = self.covariance[:, POSE, POSE] + jitter
        # inv(inv(information) + noise), where the information may be singular
        mixed = np.eye(6) + noise @ information
        weight = information @ np.linalg.inv(mixed)
        squared = np.einsum("ki,kij,kj->k", innovation, weight, innovation)
        log_likelihood = -0.5 * (_FREEDOM + 6) * np.log1p(squared / _FREEDOM) - 0.5 * np.linalg.slogdet(mixed)[1]
        self.log_odds = self.log_odds + log_likelihood - self.log_odds[0] - log_likelihood[0]
        trust = np.minimum((_FREEDOM + 6) / (_FREEDOM + squared), 1.0)
        gain = trust[:, None, None] * self.covariance[:, :, POSE] @ weight
        self.mean = self.mean + np.einsum("kij,kj->ki", gain, innovation)
        covariance = self.covariance - gain @ self.covariance[:, POSE, :]
        self.covariance = 0.5 * (covariance + covariance.swapaxes(1, 2))

    def decided(self) -> JumpHypotheses | None:
        """The likeliest jump alone, as what is so from now on, if it is certain."""
        best = int(np.argmax(self.log_odds))
        if self.log_odds[best] <= DECISIVE:
            return None
        certain = self[[best]]
        certain.log_odds, certain.age = np.zeros(1), np.zeros(1, int)
        return certain

    def settled(self) -> np.ndarray:
        """Mean (D,) of the first's errors, which all count from now on."""
        change = self.mean[0].copy()
        self.mean, self.before = self.mean - change, self.before - change
        return change

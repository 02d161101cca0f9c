"""How well a place explains the penetration maps of a window of keyframes: its marginal likelihood, map by map."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from midastouch_perception import se3

from .alignment import PenetrationAlignment, without_jitter
from .effort import Effort
from .joint_alignment import align_in_turn, transform_covariance
from .keyframes import Keyframe
from .noise_model import NoiseModel
from .places import Place, Prior, is_apart


class Replay:
    """Aligns places to all keyframes, from the newest back along the path, and compares their marginal likelihoods.

    Args: keyframes, oldest first; alignment; tempering exponent of a keyframe; noise; effort.
    """

    def __init__(
        self,
        keyframes: list[Keyframe],
        alignment: PenetrationAlignment,
        tempering: float,
        noise: NoiseModel,
        effort: Effort,
    ):
        self._keyframes, self._alignment, self._tempering = keyframes, alignment, tempering
        self._noise, self._effort = noise, effort
        self._held: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []  # pose, covariance at the oldest; evidence
        self._refuted: list[np.ndarray] = []  # poses at the newest
        self._best = np.full(len(keyframes), -np.inf)  # evidence of the best place so far

    def follow(self, start: np.ndarray) -> Iterator[None]:
        """Align `start` (4, 4) at the newest keyframe to all of them, in slices, as long as there is hope."""
        keyframes, jitter = self._keyframes, self._noise.jitter
        pose, covariance = start, self._noise.between_entries
        evidence = np.full(len(keyframes), -np.inf)
        for k in range(len(keyframes) - 1, -1, -1):
            maps = keyframes[k].maps(settled=len(keyframes) - k > self._effort.settled)
            aligned = align_in_turn(self._alignment, pose, covariance + jitter, maps, self._noise.finger_error)
            evidence[k] = aligned.log_evidence
            pose, covariance = without_jitter(pose, covariance, jitter, aligned)
            if k:
                back = se3.inverse(keyframes[k].motion) @ keyframes[k - 1].motion
                pose, covariance = pose @ back, transform_covariance(covariance, back)
            if k % self._effort.alignments_per_step == 0:
                yield None
            if self._held and self._log_odds(evidence[k:], self._best[k:]) < self._noise.refuted:
                self._refuted.append(start)
                return
        if not self._held or self._log_odds(evidence, self._best) > 0:
            self._best = evidence
        self._held.append((pose, covariance, evidence))

    def places(self, motion: np.ndarray, prior: Prior | None) -> list[Place]:
        """All places that were followed, best first; `motion` (4, 4) of the first gel from the start to now."""
        from_oldest = se3.inverse(self._keyframes[0].motion)
        log_odds = np.array([self._log_odds(evidence, self._best) for *_, evidence in self._held])
        if prior is not None:
            starts = np.stack([pose for pose, *_ in self._held]) @ from_oldest
            log_odds += prior.log_density(starts, self._noise.prior_floor)
        log_odds -= log_odds.max()
        on = from_oldest @ motion
        found = [
            Place(pose @ on, transform_covariance(covariance, on), float(value))
            for (pose, covariance, _), value in zip(self._held, log_odds, strict=True)
        ]
        on = se3.inverse(self._keyframes[-1].motion) @ motion
        found += [Place(pose @ on, self._noise.between_entries, self._noise.refuted) for pose in self._refuted]
        places: list[Place] = []
        for place in sorted(found, key=lambda each: -each.log_odds):
            if is_apart(place.pose, [other.pose for other in places]):
                places.append(place)
        return places

    def _log_odds(self, evidence: np.ndarray, other: np.ndarray) -> float:
        """Of a place with this evidence of each keyframe against another place."""
        most = self._noise.largest_evidence
        return self._tempering * float(np.clip(evidence - other, -most, most).sum())

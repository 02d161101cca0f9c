"""Hindsight: would another place on the object explain the last touches just as well?

A particle filter forgets: a place that lost its particles to a few noisy touches is never asked again, and one narrow
mode is left that looks certain. So the last touches are kept with the path between them. Every now and then the
places that explain them best by their codes are looked for over the whole codebook, and each of these rivals as well
as the filter's own modes is aligned to the kept reliefs, one after the other along the path. The evidence of this
replay, and the start's prior as long as the start lies in reach, give the odds between them.

A replay takes a hundred alignments, so it is done in slices, a few in every step of the filter.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Iterator
from dataclasses import dataclass, replace

import numpy as np

from midastouch_perception import se3
from midastouch_perception.pose_metric import ROTATION_SCALE

from .alignment import ReliefAlignment, without_jitter
from .config import FilterConfig
from .joint_alignment import FeltRelief, align_in_turn, carried
from .lookup import PoseLookup

_FEWEST = 6  # touches that a replay needs to say anything
_ANEW, _RARELY = 3, 12  # further touches after which it is worth another one; after some that all found no rival
_OFF = 0.01  # m from any entry, where a finger can touch nothing; 1 rad counts as 10 mm
_SHORTLIST = 150  # best entries of each touch, of all fingers, that are carried to the present as candidates
_SIEVE, _KEPT = 4, 400  # candidates are first scored on this many touches, and only the best on all of them
# Codebook entries are some 20 deg apart, which moves a further finger by centimetres: with several fingers, the best
# candidates are turned to where all fit
_TURNED, _TURNS = 50, np.radians([10.0, 5.0])
_AXES = np.concatenate([np.zeros((1, 6)), np.eye(6)[3:], -np.eye(6)[3:]])
_MOST_RIVALS = 5
CODE_MARGIN = 4.0  # nats by which a rival may fall behind the best in its codes
_APART = 0.015  # m: places nearer than this are the same one; 1 rad counts as 10 mm
_SETTLED = 3  # touches after which a place's rotation is known well enough to say where further fingers are
_HOPELESS = 12.0  # nats behind, at which a replay is broken off
_LARGEST = 5.0  # nats that one touch may speak for one place and against another
_PRIOR_FLOOR = -12.0  # nats: a prior may be wrong
_START = np.repeat([4e-3, np.radians(12.0)], 3) ** 2  # of a candidate: half the distance between codebook entries
_SLICE = 2  # alignments a step
_LIFTED = 0.01  # m of path without contact; less is a gap in a slide
_ENDLESS = 10**9  # touches since the last lift, while there was none


@dataclass(frozen=True)
class Place:
    """One explanation of the last touches: pose (4, 4) `T_obj_gel` at present; covariance (6, 6) in its own frame;
    log_odds [nats] against the best of all explanations (0 for that one)."""

    pose: np.ndarray
    covariance: np.ndarray
    log_odds: float


@dataclass(frozen=True)
class Comparison:
    """places, best first; exhaustive: no further place was within reach of the best by its codes."""

    places: list[Place]
    exhaustive: bool

    @property
    def unrivalled(self) -> bool:
        """Whether all places but the best are refuted."""
        return self.exhaustive and all(place.log_odds <= -_HOPELESS for place in self.places[1:])


@dataclass(frozen=True)
class Prior:
    """Where the start was thought to be: pose (4, 4), sigma_t [m] and sigma_r [rad] per axis."""

    pose: np.ndarray
    sigma_t: float
    sigma_r: float

    def log_density(self, poses: np.ndarray) -> np.ndarray:
        """(N,) nats of poses (N, 4, 4) below the prior's own pose, floored."""
        error = se3.log(se3.inverse(self.pose) @ poses)
        squared = (error[:, :3] ** 2).sum(axis=1) / self.sigma_t**2 + (error[:, 3:] ** 2).sum(axis=1) / self.sigma_r**2
        return np.maximum(-0.5 * squared, _PRIOR_FLOOR)


@dataclass(frozen=True)
class Felt:
    """What one finger felt: log_ratio (M,) of every codebook entry; relief (80, 60) m or None; T_gel_finger (4, 4),
    None for the reference itself."""

    log_ratio: np.ndarray
    relief: np.ndarray | None
    T_gel_finger: np.ndarray | None = None


@dataclass(frozen=True)
class _Kept:
    motion: np.ndarray  # (4, 4) from the start to this touch
    felt: list[Felt]  # log_ratio as float16

    def reliefs(self, settled: bool) -> list[FeltRelief]:
        """Those to align to: as long as the place is not settled, the first one's only."""
        found = [FeltRelief(f.relief, f.T_gel_finger) for f in self.felt if f.relief is not None]
        return found if settled else found[:1]


class Hindsight:
    """Keeps the last touches and replays them for the best places.

    Args: lookup; poses (M, 4, 4) of its entries; alignment; config.
    """

    def __init__(self, lookup: PoseLookup, poses: np.ndarray, alignment: ReliefAlignment, config: FilterConfig):
        self._lookup, self._poses, self._alignment, self._config = lookup, poses, alignment, config
        self._jitter = config.jitter
        self._share = min(1.0, config.hindsight_spacing / config.correlation_length)
        self.restart(None)

    def restart(self, prior: Prior | None) -> None:
        """Forget all touches; `prior` is what is known of the present pose, if anything."""
        self._prior = prior
        self._motion = np.eye(4)
        self._path = np.inf
        self._in_the_air, self._since_lift = 0.0, _ENDLESS
        self._touches: deque[_Kept] = deque(maxlen=self._config.hindsight_touches)
        self._since_replay, self._patience = _FEWEST, _ANEW
        self._replay: Iterator[Comparison | None] | None = None

    def moved(self, transform: np.ndarray, path: float, in_contact: bool = True) -> None:
        """The sensor moved by `transform` (4, 4), which counts as `path` [m]."""
        self._motion = self._motion @ transform
        self._path += path
        self._in_the_air = 0.0 if in_contact else self._in_the_air + path
        if self._in_the_air > _LIFTED:
            self._since_lift = 0

    def contradicted(self) -> None:
        """The last touches fit the belief badly: forget those from before the sensor was lifted, if it was.

        The object may have been moved meanwhile, and touches that no one place explains would hide the new one.
        """
        if self._since_lift < len(self._touches):
            kept, motion = list(self._touches)[len(self._touches) - self._since_lift :], self._motion
            self.restart(None)
            self._motion = motion
            self._touches.extend(kept)
            self._since_lift = _ENDLESS

    @property
    def rests(self) -> bool:
        """Whether no replay is under way, and none is worth it yet because the last ones found no rival."""
        return self._replay is None and _ANEW <= self._since_replay < self._patience

    @property
    def due(self) -> bool:
        """Whether the present touch is worth keeping."""
        return self._path >= self._config.hindsight_spacing

    def keep(self, *felt: Felt) -> None:
        """Keep what the fingers feel at present, the reference first; at least one has a relief."""
        kept = [replace(each, log_ratio=each.log_ratio.astype(np.float16)) for each in felt]
        self._touches.append(_Kept(self._motion, kept))
        self._path = 0.0
        self._since_replay += 1
        self._since_lift += 1

    def compare(self, modes: list[np.ndarray]) -> Comparison | None:
        """Do a slice of the replay; what it found once it is complete, else None.

        modes: poses (4, 4) of the filter's own modes at present. All of them are among the places, the refuted ones
        with odds of -12 or less; the others are their rivals.
        """
        if len(modes) > 1:
            self._patience = _ANEW
        if self._replay is None:
            if self.rests or len(self._touches) < _FEWEST or self._since_replay < _ANEW:
                return None
            self._since_replay = 0
            self._replay = self._replayed(modes)
        found = next(self._replay)
        if found is not None:
            self._replay = None
            self._patience = min(2 * self._patience, _RARELY) if found.unrivalled else _ANEW
        return found

    # ------------------------------------------------------------------ replay

    def _replayed(self, modes: list[np.ndarray]) -> Iterator[Comparison | None]:
        touches = list(self._touches)
        newest = touches[-1].motion
        to_newest = se3.inverse(self._motion) @ newest
        starts = [mode @ to_newest for mode in modes]
        candidates, score = yield from self._sieved(touches)
        rivals, exhaustive = self._rivals(candidates, score, starts)
        explained = _Explanations(len(touches), self._share)
        for start in starts + rivals:
            yield from self._followed(start, touches, explained)
        yield Comparison(self._places(explained, touches), exhaustive)

    def _sieved(self, touches: list[_Kept]) -> Generator[None, None, tuple[np.ndarray, np.ndarray]]:
        """The candidates (C, 4, 4) at the newest touch that explain all touches best by their codes, and how well."""
        candidates, some = self._candidates(touches), touches[:: -max(len(touches) // _SIEVE, 1)]
        candidates, _ = _best_of(candidates, (yield from self._summed(candidates, touches[-1], some)))
        if any(len(touch.felt) > 1 for touch in touches):
            for angle in _TURNS:
                yield None
                candidates = self._turned(candidates[:_TURNED], angle, touches[-1], some)
        return _best_of(candidates, (yield from self._summed(candidates, touches[-1], touches)))

    def _turned(self, candidates: np.ndarray, angle: float, newest: _Kept, touches: list[_Kept]) -> np.ndarray:
        """Each of the candidates (C, 4, 4), turned by `angle` about one of its axes if that explains these touches."""
        turned = candidates[:, None] @ se3.exp(angle * _AXES)
        every = turned.reshape(-1, 4, 4)
        score = sum(self._scores(every @ (se3.inverse(newest.motion) @ touch.motion), touch) for touch in touches)
        return turned[np.arange(len(turned)), score.reshape(len(turned), -1).argmax(axis=1)]

    def _summed(self, candidates: np.ndarray, newest: _Kept, touches: list[_Kept]) -> Generator[None, None, np.ndarray]:
        """Scores (C,) of candidates (C, 4, 4) at the newest touch, over these touches."""
        score = np.zeros(len(candidates))
        for touch in touches:
            yield None
            score += self._scores(candidates @ (se3.inverse(newest.motion) @ touch.motion), touch)
        return score

    def _followed(self, start: np.ndarray, touches: list[_Kept], explained: _Explanations) -> Iterator[None]:
        """Align `start` (4, 4) at the newest touch to all of them, back along the path, as long as there is hope."""
        pose, covariance = start, np.diag(_START)
        evidence = np.full(len(touches), -np.inf)
        for k in range(len(touches) - 1, -1, -1):
            reliefs = touches[k].reliefs(settled=len(touches) - k > _SETTLED)
            aligned = align_in_turn(
                self._alignment, pose, covariance + self._jitter, reliefs, self._config.finger_error
            )
            evidence[k] = aligned.log_evidence
            pose, covariance = without_jitter(pose, covariance, self._jitter, aligned)
            if k:
                on = se3.inverse(touches[k].motion) @ touches[k - 1].motion
                pose, covariance = pose @ on, carried(covariance, on)
            if k % _SLICE == 0:
                yield None
            if explained.hopeless(evidence, k):
                explained.refuted.append(start)
                return
        explained.add(pose, covariance, evidence)

    def _candidates(self, touches: list[_Kept]) -> np.ndarray:
        """Poses (C, 4, 4) at the newest touch of the entries that fit best at any of the touches."""
        newest, out = touches[-1].motion, []
        for touch in touches:
            to_newest = se3.inverse(touch.motion) @ newest
            count = _SHORTLIST // len(touch.felt)
            for felt in touch.felt:
                best = np.argpartition(-felt.log_ratio, min(count, len(felt.log_ratio) - 1))[:count]
                poses = self._poses[best]
                if felt.T_gel_finger is not None:
                    poses = poses @ se3.inverse(felt.T_gel_finger)
                out.append(poses @ to_newest)
        poses = np.concatenate(out)
        return poses[np.unique(self._lookup.exact(poses), return_index=True)[1]]

    def _scores(self, poses: np.ndarray, touch: _Kept) -> np.ndarray:
        """Log-likelihood ratios (C,) of poses (C, 4, 4) at a touch, of all fingers, as far as it counts."""
        out = np.zeros(len(poses))
        for felt in touch.felt:
            out += self._share * self._log_ratio(poses, felt)
        return out

    def _log_ratio(self, poses: np.ndarray, felt: Felt) -> np.ndarray:
        """(C,) of poses (C, 4, 4) of the reference; where a finger would be off the surface, its worst."""
        if felt.T_gel_finger is None:
            return felt.log_ratio[self._lookup.exact(poses)].astype(float)
        entries = self._lookup.exact(poses @ felt.T_gel_finger, within=_OFF)
        return np.append(felt.log_ratio, felt.log_ratio.min())[entries].astype(float)

    def _rivals(
        self, candidates: np.ndarray, score: np.ndarray, taken: list[np.ndarray]
    ) -> tuple[list[np.ndarray], bool]:
        """The best candidates apart from `taken` and from each other, and whether these are all worth a replay."""
        chosen: list[np.ndarray] = []
        for i in np.argsort(-score, kind="stable"):
            if score[i] < score.max() - CODE_MARGIN:
                break
            if all(pose_distance(candidates[i], other) > _APART for other in [*taken, *chosen]):
                if len(chosen) == _MOST_RIVALS:
                    return chosen, False
                chosen.append(candidates[i])
        return chosen, True

    def _places(self, explained: _Explanations, touches: list[_Kept]) -> list[Place]:
        odds = explained.log_odds()
        from_oldest = se3.inverse(touches[0].motion)
        if self._prior is not None:
            odds += self._prior.log_density(np.stack([pose for pose, *_ in explained.ends]) @ from_oldest)
        odds -= odds.max()
        on = from_oldest @ self._motion
        found = [
            Place(pose @ on, carried(covariance, on), float(value))
            for (pose, covariance, _), value in zip(explained.ends, odds, strict=True)
        ]
        on = se3.inverse(touches[-1].motion) @ self._motion
        found += [Place(pose @ on, np.diag(_START), -_HOPELESS) for pose in explained.refuted]
        places: list[Place] = []
        for place in sorted(found, key=lambda each: -each.log_odds):
            if all(pose_distance(place.pose, other.pose) > _APART for other in places):
                places.append(place)
        return places


class _Explanations:
    """Places that were replayed.

    Attributes: ends, of those that held out: pose (4, 4) and covariance (6, 6) at the oldest touch, evidence (K,) of
    every touch; refuted: poses (4, 4) at the newest touch of the others.
    """

    def __init__(self, touches: int, share: float):
        self.ends: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        self.refuted: list[np.ndarray] = []
        self._best = np.full(touches, -np.inf)  # evidence of the best place so far
        self._share = share

    def hopeless(self, evidence: np.ndarray, since: int) -> bool:
        """Whether a place with this evidence of the touches from `since` on is too far behind the best one."""
        return bool(self.ends) and -self._ahead(evidence[since:], self._best[since:]) > _HOPELESS

    def add(self, pose: np.ndarray, covariance: np.ndarray, evidence: np.ndarray) -> None:
        if not self.ends or self._ahead(evidence, self._best) > 0:
            self._best = evidence
        self.ends.append((pose, covariance, evidence))

    def log_odds(self) -> np.ndarray:
        """Of `ends`, against the best of them."""
        return np.array([self._ahead(evidence, self._best) for *_, evidence in self.ends])

    def _ahead(self, evidence: np.ndarray, other: np.ndarray) -> float:
        return self._share * float(np.clip(evidence - other, -_LARGEST, _LARGEST).sum())


def _best_of(candidates: np.ndarray, score: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The best candidates and their scores, best first."""
    best = np.argsort(-score, kind="stable")[:_KEPT]
    return candidates[best], score[best]


def pose_distance(a: np.ndarray, b: np.ndarray) -> float:
    """Pose distance [m] as the look-up's, of (4, 4) and (4, 4)."""
    angle = se3.rotation_angle(a[:3, :3].T @ b[:3, :3])
    return float(np.hypot(np.linalg.norm(a[:3, 3] - b[:3, 3]), 2 * ROTATION_SCALE * np.sin(angle / 2)))

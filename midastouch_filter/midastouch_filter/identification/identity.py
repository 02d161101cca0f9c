"""Which object of a catalogue explains the last touches, and where on it the sensor is.

Identity and pose are one question: the posterior is over hypotheses on all objects, from the same keyframes, and
`unknown` is what none of them explains. Codes are of one network, so that how well they fit is on one scale over all
objects, and the best entries of the whole catalogue become the candidates of a touch. The best of these hypotheses are
aligned to the kept penetration maps in one race: what falls far behind the best, on whichever object, is given up after
a few maps, so that ten objects take hardly more alignments than one. Of thousands of objects only some are compared:
`compared`.
docs/evidence.md has the mathematics.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import dataclass, replace

import numpy as np

from midastouch_common import se3
from midastouch_common.errors import InputError

from ..core.alignment import transform_covariance
from ..core.config import FilterConfig
from ..core.gates import Gates
from ..core.keyframes import Keyframe, KeyframeWindow
from ..core.motion_model import Odometry, RestGate
from ..core.noise_model import Effort, NoiseModel
from ..core.pose_hypothesis import APART, PoseHypothesis, distinct
from ..core.touch import Measurement, require_network
from ..smoothing.competitor_search import CompetitorSearch, Pace, Scored
from ..smoothing.window_likelihood import Followed, Race, WindowLikelihood, hypothesis_posterior
from .catalogue import Catalogue
from .compared import Compared

UNKNOWN = "unknown"
"""Name of what is none of the catalogue's objects."""

# the shortlist is of the whole catalogue; of an object fewer hypotheses are kept, as some of each are; how probable an
# object is was fitted with so many alignments (midastouch_benchmark/fits/identity.py)
_EFFORT = Effort(shortlist=800, kept=24, alignments=200)
_TOUCHES = 32  # kept; more than for a hypothesis, as an object does not become another one while it is slid over
_CARRIED_HYPOTHESES = 6  # hypotheses that are asked for again; codes bring up the others
_NAMED_PROBABILITY = 0.01
_ALIKE_PROBABILITY = 0.5  # probability that an object of no catalogue is like others of this one


@dataclass(frozen=True)
class CandidateObject:
    """An object of the catalogue: name; probability that it is touched; hypotheses on it, most probable first, whose
    probabilities sum up to that."""

    name: str
    probability: float
    hypotheses: list[PoseHypothesis]


@dataclass(frozen=True)
class Identity:
    """What is touched: hypotheses, one for each object, most probable first; unknown, the probability that it is none
    of them. All together are one."""

    objects: list[CandidateObject]
    unknown: float

    @property
    def leading(self) -> CandidateObject:
        """The most probable object."""
        return self.objects[0]

    @property
    def answer(self) -> str:
        """The most probable object's name, or `UNKNOWN` if that is more probable."""
        return UNKNOWN if self.unknown > self.leading.probability else self.leading.name

    def moved(self, transform: np.ndarray) -> Identity:
        """After the gel moved by `transform` (4, 4)."""
        moved = [
            replace(each, hypotheses=[hypothesis.moved(transform) for hypothesis in each.hypotheses])
            for each in self.objects
        ]
        return replace(self, objects=moved)

    def in_words(self) -> str:
        """Those that compete, such as "mug 62 %, bowl 30 %, unknown 8 %"."""
        fractions = [*((each.name, each.probability) for each in self.objects), (UNKNOWN, self.unknown)]
        named = sorted((each for each in fractions if each[1] >= _NAMED_PROBABILITY), key=lambda each: -each[1])
        return ", ".join(f"{name} {fraction:.0%}" for name, fraction in named)


@dataclass(frozen=True)
class Contest:
    """What the last touches say of P hypotheses on several objects.

    owner (P,), number of the object; hypotheses, at present, of no probability yet; residual_ratio (P, K), fraction of
    each of K maps that a hypothesis leaves unexplained; squared_innovation (P, K), squared Mahalanobis distance that it
    has to give way to fit; weights (K,) and change (K,), as of `Scored`.
    """

    owner: np.ndarray
    hypotheses: list[PoseHypothesis]
    residual_ratio: np.ndarray
    squared_innovation: np.ndarray
    weights: np.ndarray
    change: np.ndarray

    def posterior(self, noise: NoiseModel, objects: int, unknown: float) -> tuple[np.ndarray, float]:
        """Probabilities (P,) of the hypotheses, and that of none of the objects, which is `unknown` beforehand.

        An object is as probable as its best hypothesis makes it: how many were followed says nothing of it. An object
        of no catalogue may be like none in this one, or like the others, those beside the most probable one.
        """
        followed = np.bincount(self.owner, minlength=objects)
        prior = (1 - unknown) / objects
        evidence = self.weights * noise.object_evidence(self.residual_ratio, self.squared_innovation)
        nowhere = unknown + prior * (followed == 0).sum()  # an object without a hypothesis is there, too
        beforehand = np.log(np.append(prior / followed[self.owner], nowhere))
        fractions, none = hypothesis_posterior(evidence, beforehand, beforehand, self.change)
        best = np.zeros(objects)
        np.maximum.at(best, self.owner, fractions)
        of_object, summed = best * followed, np.bincount(self.owner, fractions, objects)
        fractions *= (of_object / np.maximum(summed, np.finfo(float).tiny))[self.owner]
        if objects > 1:
            fits_none = none / nowhere
            fits = np.where(followed > 0, of_object / prior, fits_none)
            alike = (fits.sum() - fits.max()) / (objects - 1)
            none += _ALIKE_PROBABILITY * unknown * (alike - fits_none)
        total = fractions.sum() + none
        return fractions / total, float(none / total)


class Identification:
    """Keeps the last touches of the first finger and asks which object explains them, in slices.

    Args: catalogue; config; noise; unknown: probability beforehand that the object is none of them.
    Attributes: compared, the objects that are; window of the kept touches; found, by the last comparison, its
    hypotheses as they were then; contest, that it comes from, None before the first.
    """

    def __init__(self, catalogue: Catalogue, config: FilterConfig, noise: NoiseModel, unknown: float = 0.5):
        self._catalogue, self._config, self._noise, self._unknown = catalogue, config, noise, unknown
        self.compared = Compared(catalogue, config, noise)
        self._pace = Pace(_EFFORT.lookups_per_step)
        self.window = KeyframeWindow(_TOUCHES, config.smoothing_spacing, noise.touch_correlation, _EFFORT.shortlist)
        self._rest = RestGate(config, Gates())
        self.restart()

    def restart(self) -> None:
        """Forget all touches."""
        self.window.restart()
        self._rest.reset()
        self._running: Iterator[Contest | None] | None = None
        self._news, self._wait, self.contest = 0, _EFFORT.anew, None
        self._believe(np.zeros(0), self._unknown)

    @property
    def identity(self) -> Identity:
        """What was found, its hypotheses as they are now."""
        return self.found.moved(se3.inverse(self._found_at) @ self.window.motion)

    @property
    def measured_gels(self) -> np.ndarray:
        """(F, 4, 4) of the gels of the kept touches since the last lift, in the frame of the present one."""
        keyframes = self.window.keyframes
        since = [each.motion for each in keyframes if each.stretch == self.window.stretch]
        return se3.inverse(self.window.motion) @ np.array(since).reshape(-1, 4, 4)

    def step(self, odometry: np.ndarray | None, touch: Measurement) -> bool:
        """One frame: motion since the last (4, 4), None if unknown; whether the identity was found anew.

        What the filter refuses is passed over; raises InputError if the code comes from another network, or if what is
        not held in memory cannot be read.
        """
        require_network([touch], self._catalogue.network_id)
        self._move(odometry, touch.in_contact)
        if self.window.due and touch.in_contact and self._is_usable(touch.penetration):
            self._keep(touch)
        if self._running is None and self._news >= self._wait and len(self.window) >= _EFFORT.fewest:
            self._news, self._running = 0, self._run()
        try:
            found = next(self._running) if self._running else None
        except InputError:  # a codebook or a mesh that is gone; the touches are half scored
            self.restart()
            raise
        if found is None:
            return False
        self._running, self.contest = None, found
        self._believe(*found.posterior(self._noise, len(self._catalogue), self._unknown))
        settled = self.found.leading.probability > self._noise.settled
        self._wait = _EFFORT.seldom if settled else _EFFORT.anew
        return True

    def _move(self, odometry: np.ndarray | None, in_contact: bool) -> None:
        try:
            step = None if odometry is None else Odometry.from_matrix(odometry)
        except ValueError:
            return
        if step is not None and step.distance > self._config.max_odometry_jump:
            self.restart()
        elif step is not None and (motion := self._rest.motion(step)) is not None:
            self.window.moved(motion.transform, motion.path, in_contact)

    def _is_usable(self, penetration: np.ndarray | None) -> bool:
        shape = self.compared.catalogue.entries[0].alignment.map_shape
        return penetration is not None and penetration.shape == shape and bool(np.isfinite(penetration).all())

    def _keep(self, touch: Measurement) -> None:
        try:
            log_ratio = self.compared.scores.log_ratio_of(touch)
        except ValueError:
            return
        self.window.keep([touch], [log_ratio])
        self._news += 1
        if self.window.lifted:  # what is under way was asked before, of an object that may have been exchanged
            self._running, self._wait = None, _EFFORT.anew

    def _believe(self, fractions: np.ndarray, unknown: float) -> None:
        """Take over the probabilities (P,) of the contest's hypotheses."""
        hypotheses: list[list[PoseHypothesis]] = [[] for _ in self._catalogue.entries]
        for i in np.argsort(-fractions, kind="stable"):
            hypotheses[self.contest.owner[i]].append(
                replace(self.contest.hypotheses[i], probability=float(fractions[i]))
            )
        even = (1 - self._unknown) / len(hypotheses)
        objects = [
            CandidateObject(
                entry.name, sum(hypothesis.probability for hypothesis in some) if self.contest else even, some
            )
            for entry, some in zip(self._catalogue.entries, hypotheses, strict=True)
        ]
        self.found = Identity(sorted(objects, key=lambda each: -each.probability), unknown)
        self._found_at = self.window.motion

    # ------------------------------------------------------------------ one contest

    def _run(self) -> Iterator[Contest | None]:
        best = self._best_found()
        yield from self.compared.choose(self.window, [k for k, each in best if each.probability > self.found.unknown])
        window = Scored.of(list(self.window.keyframes), self._noise)
        views = {
            k: replace(window, keyframes=[_seen(each, rows) for each in window.keyframes])
            for k, rows in zip(self.compared.numbers, self.compared.catalogue.rows, strict=True)
        }
        onward = se3.inverse(self._found_at) @ window.keyframes[-1].motion
        carried = [(k, hypothesis.pose @ onward) for k, hypothesis in best if k in views]
        ranked = yield from self._ranked(views, carried)
        race, likelihoods = Race(window), {}
        for starts, most in ((carried, np.inf), (ranked, _EFFORT.alignments)):
            for k, pose in starts:
                if race.alignments >= most:
                    break
                if k not in likelihoods:
                    if not self._catalogue.entries[k].prepared:
                        yield None  # to read a mesh takes as long as a step may
                    likelihoods[k] = self._likelihood_of(k, views[k], race)
                yield from likelihoods[k].follow(pose)
        yield self._contest(window, likelihoods)

    def _likelihood_of(self, number: int, view: Scored, race: Race) -> WindowLikelihood:
        alignment = self._catalogue.entries[number].alignment
        return WindowLikelihood(view, alignment, self._noise, _EFFORT, self._config.penetration_fit, race)

    def _best_found(self) -> list[tuple[int, PoseHypothesis]]:
        """The best hypotheses of before, as they were then, each with the number of its object."""
        found = [(each.name, hypothesis) for each in self.found.objects for hypothesis in each.hypotheses]
        found.sort(key=lambda each: -each[1].probability)
        return [(self._catalogue.number(name), hypothesis) for name, hypothesis in found[:_CARRIED_HYPOTHESES]]

    def _ranked(
        self, views: dict[int, Scored], carried: list[tuple[int, np.ndarray]]
    ) -> Generator[None, None, list[tuple[int, np.ndarray]]]:
        """Further hypotheses that codes bring up, with the numbers of their objects, best first; views by these."""
        found: list[tuple[float, int, np.ndarray]] = []
        for k, view in views.items():
            if any(len(each.shortlists[0]) for each in view.sparser(_EFFORT.sieve).keyframes):
                search = CompetitorSearch(self._catalogue.entries[k].lookup, self._noise, _EFFORT, self._pace)
                competitors = yield from search.find(view, [pose for owner, pose in carried if owner == k])
                found += [(score, k, pose) for score, pose in zip(competitors.scores, competitors.poses, strict=True)]
        found.sort(key=lambda each: -each[0])
        return [(k, pose) for score, k, pose in found if score > found[0][0] - self._noise.code_margin]

    def _contest(self, window: Scored, likelihoods: dict[int, WindowLikelihood]) -> Contest:
        """The distinct hypotheses that were followed, as they are now; likelihoods by the numbers of their objects."""
        owner: list[int] = []
        hypotheses: list[PoseHypothesis] = []
        kept: list[Followed] = []
        for k, likelihood in sorted(likelihoods.items()):
            followed = sorted(likelihood.followed, key=lambda one: -self._support(window, one))
            onward = [se3.inverse(window.keyframes[each.at].motion) @ self.window.motion for each in followed]
            poses = np.array([each.pose @ on for each, on in zip(followed, onward, strict=True)]).reshape(-1, 4, 4)
            for i in distinct(poses, range(len(poses)), APART):
                owner.append(k)
                kept.append(followed[i])
                hypotheses.append(
                    PoseHypothesis(poses[i], transform_covariance(followed[i].covariance, onward[i]), 0.0)
                )
        shape = len(kept), len(window.weights)
        residual_ratio = np.reshape([each.residual_ratio for each in kept], shape)
        squared_innovation = np.reshape([each.squared_innovation() for each in kept], shape)
        return Contest(
            np.array(owner, int), hypotheses, residual_ratio, squared_innovation, window.weights, window.change
        )

    def _support(self, window: Scored, hypothesis: Followed) -> float:
        return float(window.weights @ self._noise.residual_evidence(hypothesis.residual_ratio))


def _seen(keyframe: Keyframe, rows: slice) -> Keyframe:
    """What a keyframe of the catalogue says of the object whose entries are `rows` of all."""
    (scores,), (best,) = keyframe.log_ratios, keyframe.shortlists
    own = best[(best >= rows.start) & (best < rows.stop)] - rows.start
    return replace(keyframe, log_ratios=[scores[rows]], shortlists=[own])

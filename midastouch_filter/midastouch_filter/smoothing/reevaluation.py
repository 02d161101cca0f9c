"""Fixed-lag re-evaluation: would another hypothesis on the object explain the last touches just as well?

A particle filter forgets: a hypothesis that lost its particles to a few noisy touches is never asked again, and one
narrow mode is left that looks certain. So a window of keyframes is kept. At each new one the hypotheses that explain
them best by their codes are looked for over the whole codebook, and each of these competitors as well as the filter's
own modes is aligned to the kept penetration maps, one after the other along the path. How well they fit, and the
start's prior, give the probability of each hypothesis; that the object was moved meanwhile, unreported, is one of the
explanations.

That takes dozens of alignments, so it is done in slices, a few in every step of the filter.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from midastouch_common import se3
from midastouch_perception.symmetry.group import Symmetry
from midastouch_perception.symmetry.search import ObjectSymmetry

from ..core.alignment import PenetrationAlignment, transform_covariance
from ..core.config import FilterConfig
from ..core.keyframes import KeyframeWindow, WeighedWindow
from ..core.lookup import PoseLookup
from ..core.noise_model import Effort, NoiseModel
from ..core.pose_hypothesis import PoseHypothesis, Prior, another, distinct, far_from
from ..core.touch import Measurement
from .competitor_search import Competitors, CompetitorSearch
from .contest import Contest
from .pace import InTime, Pace, always
from .window_likelihood import Alignments, Race, WindowLikelihood, hypothesis_posterior

_POSSIBLE = 1e-4  # probability of a hypothesis from which on it is compared again
_LEADS = 1e-3  # probability of a hypothesis from which on those that look like it are compared, too
_OWN = 0.05  # probability of another object below which the touches so far are counted as the object's own
_NEVER_SURER = 0.01  # than so, that no later touch is of another object
_SAMPLE = 2048  # entries that the mean density of a prior is taken over


@dataclass(frozen=True)
class Comparison:
    """hypotheses, most probable first; elsewhere: probability that it is none of them; contest, what they tell of the
    object, and unknown, the probability that it is another one; exhaustive: no further hypothesis was within reach of
    the best by its codes; cloud (C, 4, 4), cloud_scores (C,): as `Competitors`, at present; symmetry, modulo which all
    of these are."""

    hypotheses: list[PoseHypothesis]
    elsewhere: float
    contest: Contest
    unknown: float
    exhaustive: bool
    cloud: np.ndarray
    cloud_scores: np.ndarray
    symmetry: Symmetry

    def settled(self, certain: float) -> bool:
        """Whether the object is known, one hypothesis is as probable as that, and none was left out."""
        return self.exhaustive and self.unknown < _OWN and self.hypotheses[0].probability > certain

    def probability_at(self, pose: np.ndarray, within: float) -> float:
        """Of the hypothesis that a pose (4, 4) belongs to: the nearest one, not farther than `within` [m]."""
        distance = self.symmetry.distance(np.stack([hypothesis.pose for hypothesis in self.hypotheses]), pose)
        nearest = int(distance.argmin())
        return self.hypotheses[nearest].probability if distance[nearest] <= within else 0.0


class Reevaluation:
    """Keeps the last touches and compares the best hypotheses by them.

    Args: lookup; alignment; symmetry of the object; n_poses, number of poses on it that codes can tell apart, modulo
    symmetry; config; noise; effort.
    Attributes: lifted, whether the sensor was lifted after the newest touch of the last comparison.
    """

    def __init__(
        self,
        lookup: PoseLookup,
        alignment: PenetrationAlignment,
        symmetry: ObjectSymmetry,
        n_poses: float,
        config: FilterConfig,
        noise: NoiseModel,
        effort: Effort,
    ):
        self._lookup, self._alignment, self._noise, self._effort = lookup, alignment, noise, effort
        self._symmetry, self._count, self._explains = symmetry, n_poses, config.penetration_fit
        self._unknown_prior = config.unknown_prior
        self._pace = Pace(effort)
        self._search = CompetitorSearch(lookup, symmetry.exact, noise, effort, self._pace)
        self._window = KeyframeWindow(
            config.smoothing_touches, config.smoothing_spacing, noise.touch_correlation, effort.shortlist
        )
        self.restart(None)

    def restart(self, prior: Prior | None) -> None:
        """Forget all touches; `prior` is what is known of the present pose, if anything."""
        self._window.restart()
        self._prior = prior
        self._typical = 0.0  # log of the prior's mean density over all poses
        if prior is not None:
            some = self._lookup.poses[:: max(len(self._lookup) // _SAMPLE, 1)]
            density = prior.log_density(some, self._noise.prior_floor, self._symmetry.exact)
            self._typical = float(np.logaddexp.reduce(density) - np.log(len(some)))
        self._alignments = Alignments()  # of the hypotheses of the last comparison
        self._carried: list[np.ndarray] = []  # what was possible by the last comparison, (4, 4) as it was then
        self._carried_at = np.eye(4)
        self._since, self._wait, self.lifted = 0, self._effort.anew, False
        self._own: float | None = None  # probability of another object when that was last improbable ...
        self._since_own = 0  # ... and touches since
        self._running: Iterator[Comparison | None] | None = None

    def score_anew(self, log_ratio_of: Callable[[Measurement], np.ndarray], n_poses: float) -> None:
        """Score the kept touches again, once the look-up has other entries; arguments as of `KeyframeWindow.score_anew`
        and of this class."""
        self._running, self._count = None, n_poses
        self._window.score_anew(log_ratio_of)

    def recall(self, measured: KeyframeWindow, log_ratio_of: Callable[[Measurement], np.ndarray]) -> None:
        """Take the touches of another window after a restart, and compare at once; as `KeyframeWindow.take`."""
        self._window.take(measured, log_ratio_of)
        self._since = len(self._window)

    def moved(self, transform: np.ndarray, path: float, in_contact: bool = True) -> None:
        """The first gel moved by `transform` (4, 4), which counts as `path` [m]."""
        self.lifted |= self._window.moved(transform, path, in_contact)

    @property
    def motion(self) -> np.ndarray:
        """(4, 4) of the first gel since the restart."""
        return self._window.motion

    @property
    def measured_gels(self) -> np.ndarray:
        """(F, 4, 4) of the gels of the kept touches since the last lift, in the frame of the present first one."""
        since = [each for each in self._window.keyframes if each.stretch == self._window.stretch]
        gels = [gel for each in since for gel in each.gels]
        return se3.inverse(self._window.motion) @ np.stack(gels) if gels else np.empty((0, 4, 4))

    @property
    def due(self) -> bool:
        """Whether the present touch is worth keeping."""
        return self._window.due

    def keep(self, touches: list[Measurement], log_ratios: list[np.ndarray]) -> None:
        """Keep what the fingers measure at present, the first one first; at least one touch has a map.

        log_ratios: for each (M,), of every codebook entry.
        """
        self._window.keep(touches, log_ratios)
        self._since += 1
        self._since_own += 1
        if self._window.lifted:  # what is under way was asked before, of an object that may have been moved
            self._running, self._wait = None, self._effort.anew

    def rests(self, contradicted: bool) -> bool:
        """Whether no comparison is under way and the next one can wait, because the last ones agreed.

        contradicted: the present touch does not fit the belief.
        """
        if contradicted:
            self._wait = self._effort.anew
        return self._running is None and (self._since < self._wait or self._window.touches < self._effort.fewest)

    def compare(
        self, modes: list[np.ndarray], elapsed: float | None = None, in_time: InTime = always
    ) -> Comparison | None:
        """Work on the comparison for one slice; returns it once it is complete, else None.

        elapsed [s], in_time: as of `Pace.grant`. modes: poses (4, 4) of the filter's own modes at present. All of them
        are among the hypotheses; the others are their competitors.
        """
        self._pace.grant(elapsed, in_time)
        if self._running is None:
            self._since = 0
            self._running = self._run(modes)
        found = next(self._running)
        if found is not None:
            self._running, self.lifted = None, False
            if found.unknown < _OWN:
                surest = min(_NEVER_SURER, self._unknown_prior)
                self._own, self._since_own = max(found.unknown, surest), self._since
            most = self._effort.rarely if found.settled(self._noise.settled) else self._effort.seldom
            self._wait = min(2 * self._wait, most)
        return found

    def _run(self, modes: list[np.ndarray]) -> Iterator[Comparison | None]:
        window = WeighedWindow.of(list(self._window.keyframes), self._noise)
        newest = window.keyframes[-1].motion
        to_newest = se3.inverse(self._window.motion) @ newest
        starts = [mode @ to_newest for mode in modes]
        onward = se3.inverse(self._carried_at) @ newest
        starts += [pose @ onward for pose in self._carried]
        competitors = yield from self._search.find(window, starts)
        race = Race(window, self._pace)
        likelihood = WindowLikelihood(
            window, self._alignment, self._noise, self._effort, self._explains, race, self._alignments
        )
        for start in starts:
            yield from likelihood.follow(start)
        asked = yield from self._follow_some(likelihood, race, competitors.poses)
        compared = self._compared(window, likelihood, competitors, asked)
        back = se3.inverse(self._window.motion) @ newest
        leading = [each.pose @ back for each in compared.hypotheses if each.probability > _LEADS]
        images = self._look_alikes(leading, likelihood, newest)
        asked_images = yield from self._follow_some(likelihood, race, images)
        for start in leading:
            yield from likelihood.follow_again(start)
        compared = self._compared(window, likelihood, competitors, asked)
        compared = replace(compared, exhaustive=compared.exhaustive and asked_images == len(images))
        self._alignments = Alignments(likelihood.followed, window.keyframes)
        possible = [each.pose for each in compared.hypotheses if each.probability > _POSSIBLE]
        self._carried, self._carried_at = possible[: self._effort.carried], self._window.motion
        yield compared

    def _follow_some(
        self, likelihood: WindowLikelihood, race: Race, starts: Sequence[np.ndarray]
    ) -> Generator[None, None, int]:
        """Follow poses (4, 4) at the newest keyframe, the first ones first, as far as the effort goes; how many."""
        most = race.alignments + self._effort.alignments
        for asked, start in enumerate(starts):
            if race.alignments >= most:
                return asked
            yield from likelihood.follow(start)
        return len(starts)

    def _look_alikes(
        self, poses: Sequence[np.ndarray], likelihood: WindowLikelihood, newest: np.ndarray
    ) -> list[np.ndarray]:
        """Poses (4, 4) that nearly have the same surface as these, at the newest keyframe, where the gel had moved by
        `newest` (4, 4), and where no hypothesis ended."""
        images = np.array([motion @ pose for pose in poses for motion in self._symmetry.look_alikes])
        if not len(images):
            return []
        (ended, _), differ = likelihood.ended(newest), another(self._symmetry.exact)
        new = images[far_from(ended, images, differ)]
        return list(new[distinct(new, range(len(new)), differ)])

    def _compared(
        self, window: WeighedWindow, likelihood: WindowLikelihood, competitors: Competitors, asked: int
    ) -> Comparison:
        """Probabilities of all hypotheses that were followed, at present; `asked`, number of the competitors among
        them."""
        symmetry = self._symmetry.exact
        now, followed, every = self._window.motion, likelihood.followed, likelihood.evidence(self._search.along)
        poses, onward = likelihood.ended(now)
        poses = symmetry.nearest(poses, poses[0])
        chosen = distinct(poses, np.argsort(-every.sum(axis=1), kind="stable"), another(symmetry))
        log_prior = np.full(len(chosen), -np.log(self._count))
        if self._prior is not None:
            starts = poses[chosen] @ se3.inverse(now)
            log_prior += self._prior.log_density(starts, self._noise.prior_floor, symmetry) - self._typical
            # a start may be narrower than the object's poses are apart
            log_prior -= max(float(np.logaddexp.reduce(log_prior)) + np.log(2.0), 0.0)
        # only some of the object's many poses are named; a broken motion may lead to any of them
        log_prior = np.append(log_prior, np.log(max(1.0 - np.exp(log_prior).sum(), 1.0 / self._count)))
        log_arrival = np.append(np.full(len(chosen), -np.log(self._count)), 0.0)
        probability, elsewhere = hypothesis_posterior(every[chosen], log_prior, log_arrival, window.change)
        hypotheses = [
            PoseHypothesis(poses[i], transform_covariance(followed[i].covariance, onward[i]), float(p))
            for i, p in zip(chosen, probability, strict=True)
        ]
        contest = Contest.of([0] * len(chosen), hypotheses, [followed[i] for i in chosen], window)
        unknown = self._unknown(contest)
        best = followed[chosen[int(probability.argmax())]]
        # a hypothesis that explains all touches does not compete with those that explain the last ones only
        exhaustive = asked >= (competitors.lasting if best.at == 0 else len(competitors.poses))
        hypotheses = sorted(hypotheses, key=lambda hypothesis: -hypothesis.probability)  # the contest keeps its order
        on = se3.inverse(window.keyframes[-1].motion) @ now
        cloud = competitors.cloud @ on, competitors.cloud_scores
        return Comparison(hypotheses, elsewhere, contest, unknown, exhaustive, *cloud, symmetry)

    def _unknown(self, contest: Contest) -> float:
        """Probability that another object is touched.

        Touches before one at which that was improbable are settled: they do not speak again. So an unreported motion,
        after which none of the present hypotheses explains them, does not make them another object's.
        """
        if self._own is None:
            return contest.posterior(self._noise, 1, self._unknown_prior)[1]
        recent = contest.of_last(self._since_own - self._since + 1)
        return recent.posterior(self._noise, 1, self._unknown_prior, self._own)[1]

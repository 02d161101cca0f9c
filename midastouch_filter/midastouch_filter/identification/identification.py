"""Which object of a catalogue explains the last touches, and where on it the sensor is: the search, in slices.

The best entries of the whole catalogue become the candidates of a touch. The best of these hypotheses are aligned to
the kept penetration maps in one race: what falls far behind the best, on whichever object, is given up after a few
maps, so that ten objects take hardly more alignments than one.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import replace

import numpy as np

from midastouch_common import se3

from ..core.alignment import transform_covariance
from ..core.config import FilterConfig
from ..core.gates import Gates
from ..core.keyframes import Keyframe, KeyframeWindow, WeighedWindow
from ..core.measurement_model import CodeScores
from ..core.motion_model import Odometry, RestGate
from ..core.noise_model import Effort, NoiseModel
from ..core.pose_hypothesis import APART, PoseHypothesis, distinct, farther
from ..core.touch import Measurement, require_network
from ..core.workers import Workers
from ..smoothing.competitor_search import CompetitorSearch
from ..smoothing.contest import Contest
from ..smoothing.pace import Pace
from ..smoothing.window_likelihood import Followed, Race, WindowLikelihood
from .catalogue import Catalogue
from .identity import CandidateObject, Identity

# the shortlist is of the whole catalogue; of an object fewer hypotheses are kept, as some of each are; how probable an
# object is was fitted with so many alignments (midastouch_benchmark/fits/identity.py)
_EFFORT = Effort(shortlist=800, kept=24, alignments=200)
_TOUCHES = 32  # kept; more than for a hypothesis, as an object does not become another one while it is slid over
_CARRIED_HYPOTHESES = 6  # hypotheses that are asked for again; codes bring up the others


class Identification:
    """Keeps the last touches of the first finger and asks which object explains them, in slices.

    Args: catalogue; config; noise.
    Attributes: window of the kept touches; found, by the last comparison, its hypotheses as they were then; contest,
    that it comes from, None before the first.
    """

    def __init__(self, catalogue: Catalogue, config: FilterConfig, noise: NoiseModel):
        self._catalogue, self._config, self._noise = catalogue, config, noise
        codes = np.concatenate([entry.codebook.codes for entry in catalogue.entries])
        self._scores = CodeScores(codes, catalogue.calibration, config, Workers(config.threads))
        self._pace = Pace(_EFFORT)
        self.window = KeyframeWindow(_TOUCHES, config.smoothing_spacing, noise.touch_correlation, _EFFORT.shortlist)
        self._rest = RestGate(config, Gates())
        self.restart()

    def restart(self) -> None:
        """Forget all touches."""
        self.window.restart()
        self._rest.reset()
        self._running: Iterator[Contest | None] | None = None
        self._news, self._wait, self.contest = 0, _EFFORT.anew, None
        self._believe(np.zeros(0), self._config.unknown_prior)

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

    def step(self, odometry: np.ndarray | None, touch: Measurement, elapsed: float | None = None) -> bool:
        """One frame: motion since the last (4, 4), None if unknown; elapsed [s], as of `Pace.grant`; whether the
        identity was found anew.

        What the filter refuses is passed over; raises InputError if the code comes from another network.
        """
        require_network([touch], self._catalogue.network_id)
        self._move(odometry, touch.in_contact)
        if self.window.due and touch.in_contact and self._is_usable(touch.penetration):
            self._keep(touch)
        if self._running is None and self._news >= self._wait and len(self.window) >= _EFFORT.fewest:
            self._news, self._running = 0, self._run()
        self._pace.grant(elapsed)
        found = next(self._running) if self._running else None
        if found is None:
            return False
        self._running, self.contest = None, found
        self._believe(*found.posterior(self._noise, len(self._catalogue), self._config.unknown_prior))
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
        shape = self._catalogue.entries[0].alignment.map_shape
        return penetration is not None and penetration.shape == shape and bool(np.isfinite(penetration).all())

    def _keep(self, touch: Measurement) -> None:
        try:
            log_ratio = self._scores.log_ratio_of(touch)
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
            found = replace(self.contest.hypotheses[i], probability=float(fractions[i]))
            hypotheses[self.contest.owner[i]].append(found)
        even = (1 - self._config.unknown_prior) / len(hypotheses)
        objects = [
            CandidateObject(entry.name, sum(each.probability for each in some) if self.contest else even, some)
            for entry, some in zip(self._catalogue.entries, hypotheses, strict=True)
        ]
        self.found = Identity(sorted(objects, key=lambda each: -each.probability), unknown)
        self._found_at = self.window.motion

    # ------------------------------------------------------------------ one contest

    def _run(self) -> Iterator[Contest | None]:
        best = self._best_found()
        window = WeighedWindow.of(list(self.window.keyframes), self._noise)
        views = [
            replace(window, keyframes=[_seen(each, rows) for each in window.keyframes]) for rows in self._catalogue.rows
        ]
        onward = se3.inverse(self._found_at) @ window.keyframes[-1].motion
        carried = [(k, hypothesis.pose @ onward) for k, hypothesis in best]
        ranked = yield from self._ranked(views, carried)
        race, likelihoods = Race(window, self._pace), {}
        for starts, most in ((carried, np.inf), (ranked, _EFFORT.alignments)):
            for k, pose in starts:
                if race.alignments >= most:
                    break
                if k not in likelihoods:
                    likelihoods[k] = self._likelihood_of(k, views[k], race)
                yield from likelihoods[k].follow(pose)
        yield self._contest(window, likelihoods)

    def _likelihood_of(self, number: int, view: WeighedWindow, race: Race) -> WindowLikelihood:
        alignment = self._catalogue.entries[number].alignment
        return WindowLikelihood(view, alignment, self._noise, _EFFORT, self._config.penetration_fit, race)

    def _best_found(self) -> list[tuple[int, PoseHypothesis]]:
        """The best hypotheses of before, as they were then, each with the number of its object."""
        found = [(each.name, hypothesis) for each in self.found.objects for hypothesis in each.hypotheses]
        found.sort(key=lambda each: -each[1].probability)
        return [(self._catalogue.number(name), hypothesis) for name, hypothesis in found[:_CARRIED_HYPOTHESES]]

    def _ranked(
        self, views: list[WeighedWindow], carried: list[tuple[int, np.ndarray]]
    ) -> Generator[None, None, list[tuple[int, np.ndarray]]]:
        """Further hypotheses that codes bring up, with the numbers of their objects, best first; views by these."""
        found: list[tuple[float, int, np.ndarray]] = []
        for k, view in enumerate(views):
            if any(len(each.shortlists[0]) for each in view.sparser(_EFFORT.sieve).keyframes):
                entry = self._catalogue.entries[k]
                search = CompetitorSearch(entry.lookup, entry.symmetry, self._noise, _EFFORT, self._pace)
                competitors = yield from search.find(view, [pose for owner, pose in carried if owner == k])
                found += [(score, k, pose) for score, pose in zip(competitors.scores, competitors.poses, strict=True)]
        found.sort(key=lambda each: -each[0])
        return [(k, pose) for score, k, pose in found if score > found[0][0] - self._noise.code_margin]

    def _contest(self, window: WeighedWindow, likelihoods: dict[int, WindowLikelihood]) -> Contest:
        """The distinct hypotheses that were followed, as they are now; likelihoods by the numbers of their objects."""
        owner: list[int] = []
        hypotheses: list[PoseHypothesis] = []
        kept: list[Followed] = []
        for k, likelihood in sorted(likelihoods.items()):
            followed, (poses, onward) = likelihood.followed, likelihood.ended(self.window.motion)
            order = np.argsort([-self._support(window, each) for each in followed], kind="stable")
            for i in distinct(poses, order, farther(APART, self._catalogue.entries[k].symmetry)):
                owner.append(k)
                kept.append(followed[i])
                covariance = transform_covariance(followed[i].covariance, onward[i])
                hypotheses.append(PoseHypothesis(poses[i], covariance, 0.0))
        return Contest.of(owner, hypotheses, kept, window)

    def _support(self, window: WeighedWindow, hypothesis: Followed) -> float:
        return float(window.weights @ self._noise.residual_evidence(hypothesis.residual_ratio))


def _seen(keyframe: Keyframe, rows: slice) -> Keyframe:
    """What a keyframe of the catalogue says of the object whose entries are `rows` of all."""
    (scores,), (best,) = keyframe.log_ratios, keyframe.shortlists
    own = best[(best >= rows.start) & (best < rows.stop)] - rows.start
    return replace(keyframe, log_ratios=[scores[rows]], shortlists=[own])

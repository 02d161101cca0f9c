"""Which object of a catalogue explains the last touches, and where on it the sensor is.

Identity and place are one question: the posterior is over places on all objects, from the same keyframes, and `unknown`
is what none of them explains. Codes are of one network, so that how well they fit is on one scale over all objects, and
the best entries of the whole catalogue become the candidates of a touch. The best of these places are aligned to the
kept penetration maps in one race: what falls far behind the best, on whichever object, is given up after a few maps, so
that ten objects take hardly more alignments than one. Of thousands of objects only some are compared: `compared`.
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
from ..core.places import APART, Place, distinct
from ..core.touch import Measurement, require_network
from ..smoothing.replay import Followed, Race, Replay, place_posterior
from ..smoothing.rival_search import Pace, RivalSearch, Scored
from .catalogue import Catalogue
from .compared import Compared

UNKNOWN = "unknown"
"""Name of what is none of the catalogue's objects."""

# the shortlist is of the whole catalogue; of an object fewer places are kept, as some of each are; how probable an
# object is was fitted with so many alignments (midastouch_benchmark/fits/identity.py)
_EFFORT = Effort(shortlist=800, kept=24, alignments=200)
_TOUCHES = 32  # kept; more than for a place, as an object does not become another one while it is slid over
_CARRIED = 6  # places that are asked for again; codes bring up the others
_WORTH_NAMING = 0.01
_ALIKE = 0.5  # probability that an object of no catalogue feels as others of this one do


@dataclass(frozen=True)
class Hypothesis:
    """An object of the catalogue: name; probability that it is touched; places on it, most probable first, whose
    probabilities sum up to that."""

    name: str
    probability: float
    places: list[Place]


@dataclass(frozen=True)
class Identity:
    """What is touched: hypotheses, one for each object, most probable first; unknown, the probability that it is none
    of them. All together are one."""

    hypotheses: list[Hypothesis]
    unknown: float

    @property
    def leading(self) -> Hypothesis:
        """The most probable object."""
        return self.hypotheses[0]

    @property
    def answer(self) -> str:
        """The most probable object's name, or `UNKNOWN` if that is more probable."""
        return UNKNOWN if self.unknown > self.leading.probability else self.leading.name

    def moved(self, transform: np.ndarray) -> Identity:
        """After the gel moved by `transform` (4, 4)."""
        moved = [replace(each, places=[place.moved(transform) for place in each.places]) for each in self.hypotheses]
        return replace(self, hypotheses=moved)

    def in_words(self) -> str:
        """Those that compete, such as "mug 62 %, bowl 30 %, unknown 8 %"."""
        shares = [*((each.name, each.probability) for each in self.hypotheses), (UNKNOWN, self.unknown)]
        named = sorted((each for each in shares if each[1] >= _WORTH_NAMING), key=lambda each: -each[1])
        return ", ".join(f"{name} {share:.0%}" for name, share in named)


@dataclass(frozen=True)
class Contest:
    """What the last touches say of P places on several objects.

    owner (P,), number of the object; places, at present, of no probability yet; misfit (P, K), share of each of K maps
    that a place leaves unexplained; strain (P, K), squared Mahalanobis distance that it has to give way to fit; weights
    (K,) and change (K,), as of `Scored`.
    """

    owner: np.ndarray
    places: list[Place]
    misfit: np.ndarray
    strain: np.ndarray
    weights: np.ndarray
    change: np.ndarray

    def posterior(self, noise: NoiseModel, objects: int, unknown: float) -> tuple[np.ndarray, float]:
        """Probabilities (P,) of the places, and that of none of the objects, which is `unknown` beforehand.

        An object is as probable as its best place makes it: how many were followed says nothing of it. An object of no
        catalogue may feel like none in this one, or as the others do, those beside the most probable one.
        """
        followed = np.bincount(self.owner, minlength=objects)
        prior = (1 - unknown) / objects
        evidence = self.weights * noise.object_evidence(self.misfit, self.strain)
        nowhere = unknown + prior * (followed == 0).sum()  # an object without a place is there, too
        beforehand = np.log(np.append(prior / followed[self.owner], nowhere))
        shares, none = place_posterior(evidence, beforehand, beforehand, self.change)
        best = np.zeros(objects)
        np.maximum.at(best, self.owner, shares)
        of_object, summed = best * followed, np.bincount(self.owner, shares, objects)
        shares *= (of_object / np.maximum(summed, np.finfo(float).tiny))[self.owner]
        if objects > 1:
            fits_none = none / nowhere
            fits = np.where(followed > 0, of_object / prior, fits_none)
            alike = (fits.sum() - fits.max()) / (objects - 1)
            none += _ALIKE * unknown * (alike - fits_none)
        total = shares.sum() + none
        return shares / total, float(none / total)


class Identification:
    """Keeps the last touches of the first finger and asks which object explains them, in slices.

    Args: catalogue; config; noise; unknown: probability beforehand that the object is none of them.
    Attributes: compared, the objects that are; window of the kept touches; found, by the last comparison, its places as
    they were then; contest, that it comes from, None before the first.
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
        self._news, self._patience, self.contest = 0, _EFFORT.anew, None
        self._believe(np.zeros(0), self._unknown)

    @property
    def identity(self) -> Identity:
        """What was found, its places as they are now."""
        return self.found.moved(se3.inverse(self._found_at) @ self.window.motion)

    @property
    def felt(self) -> np.ndarray:
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
        if self._running is None and self._news >= self._patience and len(self.window) >= _EFFORT.fewest:
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
        self._patience = _EFFORT.seldom if settled else _EFFORT.anew
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
            self._running, self._patience = None, _EFFORT.anew

    def _believe(self, shares: np.ndarray, unknown: float) -> None:
        """Take over the probabilities (P,) of the contest's places."""
        places: list[list[Place]] = [[] for _ in self._catalogue.entries]
        for i in np.argsort(-shares, kind="stable"):
            places[self.contest.owner[i]].append(replace(self.contest.places[i], probability=float(shares[i])))
        even = (1 - self._unknown) / len(places)
        hypotheses = [
            Hypothesis(entry.name, sum(place.probability for place in some) if self.contest else even, some)
            for entry, some in zip(self._catalogue.entries, places, strict=True)
        ]
        self.found = Identity(sorted(hypotheses, key=lambda each: -each.probability), unknown)
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
        carried = [(k, place.pose @ onward) for k, place in best if k in views]
        ranked = yield from self._ranked(views, carried)
        race, replays = Race(window), {}
        for starts, most in ((carried, np.inf), (ranked, _EFFORT.alignments)):
            for k, pose in starts:
                if race.alignments >= most:
                    break
                if k not in replays:
                    if not self._catalogue.entries[k].prepared:
                        yield None  # to read a mesh takes as long as a step may
                    replays[k] = self._replay(k, views[k], race)
                yield from replays[k].follow(pose)
        yield self._contest(window, replays)

    def _replay(self, number: int, view: Scored, race: Race) -> Replay:
        alignment = self._catalogue.entries[number].alignment
        return Replay(view, alignment, self._noise, _EFFORT, self._config.penetration_fit, race)

    def _best_found(self) -> list[tuple[int, Place]]:
        """The best places of before, as they were then, each with the number of its object."""
        found = [(each.name, place) for each in self.found.hypotheses for place in each.places]
        found.sort(key=lambda each: -each[1].probability)
        return [(self._catalogue.number(name), place) for name, place in found[:_CARRIED]]

    def _ranked(
        self, views: dict[int, Scored], carried: list[tuple[int, np.ndarray]]
    ) -> Generator[None, None, list[tuple[int, np.ndarray]]]:
        """Further places that codes bring up, with the numbers of their objects, best first; views by these."""
        found: list[tuple[float, int, np.ndarray]] = []
        for k, view in views.items():
            if any(len(each.shortlists[0]) for each in view.sparser(_EFFORT.sieve).keyframes):
                search = RivalSearch(self._catalogue.entries[k].lookup, self._noise, _EFFORT, self._pace)
                rivals = yield from search.find(view, [pose for owner, pose in carried if owner == k])
                found += [(score, k, pose) for score, pose in zip(rivals.scores, rivals.poses, strict=True)]
        found.sort(key=lambda each: -each[0])
        return [(k, pose) for score, k, pose in found if score > found[0][0] - self._noise.code_margin]

    def _contest(self, window: Scored, replays: dict[int, Replay]) -> Contest:
        """The distinct places that were followed, as they are now; replays by the numbers of their objects."""
        owner: list[int] = []
        places: list[Place] = []
        kept: list[Followed] = []
        for k, replay in sorted(replays.items()):
            followed = sorted(replay.followed, key=lambda one: -self._support(window, one))
            onward = [se3.inverse(window.keyframes[each.at].motion) @ self.window.motion for each in followed]
            poses = np.array([each.pose @ on for each, on in zip(followed, onward, strict=True)]).reshape(-1, 4, 4)
            for i in distinct(poses, range(len(poses)), APART):
                owner.append(k)
                kept.append(followed[i])
                places.append(Place(poses[i], transform_covariance(followed[i].covariance, onward[i]), 0.0))
        misfit, strain = (np.array(rows).reshape(len(kept), len(window.weights)) for rows in
                          ([each.misfit for each in kept], [each.strain() for each in kept]))  # fmt: skip
        return Contest(np.array(owner, int), places, misfit, strain, window.weights, window.change)

    def _support(self, window: Scored, place: Followed) -> float:
        return float(window.weights @ self._noise.misfit_evidence(place.misfit))


def _seen(keyframe: Keyframe, rows: slice) -> Keyframe:
    """What a keyframe of the catalogue says of the object whose entries are `rows` of all."""
    (scores,), (best,) = keyframe.log_ratios, keyframe.shortlists
    own = best[(best >= rows.start) & (best < rows.stop)] - rows.start
    return replace(keyframe, log_ratios=[scores[rows]], shortlists=[own])

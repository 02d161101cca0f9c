"""The particle filter over touch, as one recursion over Gaussian pose hypotheses (docs/method.md).

Each frame, odometry moves all hypotheses, and those that could be published are aligned to the frame's maps: that gives
the answer. Each keyframe, a few millimetres of path later, every hypothesis that can still matter is compared with the
touch (`core/keyframes.py`, `core/comparison.py`), most of it after the answer is out, in `deferred_update`. If the
object may have been moved, hypotheses are born (`core/births.py`). `core/answer.py` turns the belief into the answer.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

import midastouch_kernels as kernels
from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh

from .core.alignment import Sighting, transform_covariance
from .core.answer import Group, covariance_of, draws, grouped, modes_of
from .core.belief import Belief
from .core.births import Births
from .core.config import FilterConfig
from .core.estimate import Estimate, Mode
from .core.fingers import Fingers, by_name
from .core.gates import Gates, Stopwatch
from .core.initialisation import checked_prior
from .core.keyframes import Keyframes
from .core.mesh_scale import MeshScale
from .core.motion_model import Odometry
from .core.noise_model import REGION_WIDTH, NoiseModel
from .core.novelty import Novelty
from .core.object_model import ObjectModel
from .core.pace import InTime, always
from .core.pose_difference import Prior
from .core.state import CONVERGED, StateEvidence, StateMachine, Status
from .core.touch import Measurement, gels_of
from .core.track import Track
from .core.workers import Workers

if TYPE_CHECKING:
    from midastouch_perception.codebook import Codebook

_LEAST_FOLLOWED = 0.01  # weight, relative to the heaviest mode's, that a mode needs to be aligned in every frame
_MILLIMETRES = 1.0  # m, longest step of an arm between two images: a longer one is likely of other units
_DRAWS = 1000  # poses that show the belief to viewers


class ParticleFilter:
    """Distribution of the sensor pose `T_obj_gel` on a known object, or on one of several.

    The same input on the same machine gives a bit-equal result, with any number of threads.

    Parameters
    ----------
    mesh
    codebook
        Codebook of that mesh.
    config
        Settings; the defaults if None.
    seed
    clock
        Function that returns seconds, for the milliseconds per stage in `Status`. By default none are measured.
    open_gates
        Names of gates, as in `Status.skipped`, that skip nothing, to measure what they save.

    Raises
    ------
    InputError
        The codebook cannot be used.
    """

    def __init__(
        self,
        mesh: ObjectMesh,
        codebook: Codebook,
        config: FilterConfig | None = None,
        seed: int = 0,
        clock: Callable[[], float] = lambda: 0.0,
        open_gates: Collection[str] = (),
    ):
        config = config or FilterConfig()
        model = ObjectModel(mesh, codebook, config, NoiseModel.of(config), Workers(config.threads))
        self._set_up([model], config, seed, clock, open_gates)

    @classmethod
    def on(
        cls,
        objects: Sequence[ObjectModel],
        config: FilterConfig,
        seed: int = 0,
        clock: Callable[[], float] = lambda: 0.0,
    ) -> ParticleFilter:
        """Return a filter that does not know which of several objects is touched.

        Parameters
        ----------
        objects
            The possible objects, all of one network and sensor.
        config, seed, clock
            As for the class.
        """
        self = cls.__new__(cls)
        self._set_up(list(objects), config, seed, clock, ())
        return self

    def _set_up(
        self,
        objects: list[ObjectModel],
        config: FilterConfig,
        seed: int,
        clock: Callable[[], float],
        open_gates: Collection[str],
    ) -> None:
        self.config, self.objects = config, objects
        self._noise, self._watch, self._open_gates = NoiseModel.of(config), Stopwatch(clock), tuple(open_gates)
        self._track, self._mesh_scale = Track(config.keyframe_spacing), MeshScale()
        kernels.set_threads(config.threads)
        self.reset(seed)

    def reset(self, seed: int) -> None:
        """Forget everything except objects and settings, as if the filter had just been made.

        Parameters
        ----------
        seed
            New seed of the draws.
        """
        self._seed, self._gates = seed, Gates(self._open_gates)
        self._fingers = Fingers(self.objects[0], self._gates)
        self._state = StateMachine(self.config)
        self._novelty = Novelty(self.config, self._gates)
        self._belief: Belief | None = None
        self._keyframes: Keyframes | None = None
        self._forget()

    def _forget(self) -> None:
        self._track.restart()
        self._mesh_scale.restart()
        self._novelty.forget()
        self._sightings: dict[int, Sighting] = {}
        self._groups: list[Group] = []
        self._trend, self._untouched, self._held = 0.0, False, False
        self.modes: list[Mode] = []

    # ------------------------------------------------------------------ start

    def initialise_uniform(self) -> None:
        """Start over the whole surface, with uniform yaw, because nothing is known."""
        self._start(None)
        self._untouched = True

    def initialise_gaussian(self, prior: np.ndarray, sigma_t: float, sigma_r: float) -> None:
        """Start around a prior pose (paper section 4.3).

        Parameters
        ----------
        prior : `T_obj_gel` (4, 4)
        sigma_t, sigma_r : standard deviations per axis, [m] and [rad]

        Raises
        ------
        InputError
            The prior is no rigid transform, or it or a sigma is negative, not finite or absurdly large.
        """
        self._start(Prior(checked_prior(prior, sigma_t, sigma_r), max(sigma_t, 1e-4), max(sigma_r, 1e-3)))

    def _start(self, prior: Prior | None) -> None:
        self._forget()
        self._state.update(StateEvidence())  # the state does not depend on anything before this start
        self._belief = Belief(self.objects)
        births = Births(self._noise, self.config.max_particles)
        births.anywhere(self._belief, 0.0, prior)
        self._keyframes = Keyframes(
            self._belief, self._track, births, self.config, self._noise, self._gates, self._watch
        )
        self._groups = grouped(self._belief)

    def force_update(self) -> None:
        """Count the next touch in full, even if the arm rests or the code has not changed."""
        self._track.force()
        self._novelty.forget()

    def take(self, prepared: ObjectModel) -> None:
        """Switch to another codebook of the object, between two steps, and keep the belief.

        Parameters
        ----------
        prepared
            Made by `ObjectModel.with_codebook`.
        """
        model = self.objects[0]
        before, coarse = model.lookup.poses, len(model.lookup)
        now = prepared.lookup.exact(before)
        model.take(prepared)
        if self._belief is None:
            return
        (some,) = self._belief.untested
        some.entries = now[some.entries]
        if len(some) and not len(self._belief.hypotheses) and len(some) == coarse:
            self.initialise_uniform()  # nothing was measured yet

    # ------------------------------------------------------------------ one step

    def step(
        self,
        odometry: np.ndarray | None,
        measurement: Measurement,
        others: Mapping[str, Measurement] | None = None,
        elapsed: float | None = None,
    ) -> Estimate:
        """Process one frame and return its estimate.

        Unusable odometry, codes, maps or finger poses (not finite, wrong size, zero) are refused: the status gives the
        reason, `Status.skipped` the number of times. Without a start the state stays `uninitialised`. Calling
        `deferred_update` in between is optional: a step first runs the deferred work, so the estimates are the same.

        Parameters
        ----------
        odometry
            Motion of the sensor since the last step, `inv(p_prev) p_now` (4, 4); None on the first frame.
        measurement
            Touch of the first finger, whose pose is estimated.
        others
            Measurements of further fingers on the same object, by name, also while the first is in the air. Any of them
            may be missing in any frame.
        elapsed
            Seconds since the last step, None if unknown. They limit the amount of deferred work.

        Returns
        -------
        Estimate
            Modes of `T_obj_gel` at this frame, and the status.

        Raises
        ------
        InputError
            A code comes from another network than the codebook's.
        """
        touches = by_name(measurement, others or {})
        self.objects[0].require_same_network(touches.values())
        self.deferred_update()
        if self._belief is None:
            self._state.update(StateEvidence())
            return Estimate([], self._status([]))
        self._gates.note, self._restarted = "", ""
        in_contact = any(touch.in_contact for touch in touches.values())
        self._gates.skips("no_contact", not in_contact)
        with self._watch.stage("motion"):
            motion = self._checked(odometry)
            self._track.moved(motion, in_contact)
            if self._untouched:
                # wherever the sensor is, it will touch the surface somewhere; the way there only shows free space
                self._untouched = not in_contact
            elif motion is not None:
                self._belief.since = self._belief.since @ motion.transform
        usable, self._held = self._fingers.usable(touches), False
        self._sightings = {} if not in_contact or motion is not None else self._sightings
        if usable:
            self._compare(usable, [touch for touch in touches.values() if not touch.in_contact])
        self._keyframes.grant(elapsed)
        estimate = self._estimate(in_contact)
        self._watch.restart()
        return estimate

    def _checked(self, odometry: np.ndarray | None) -> Odometry | None:
        """Return odometry that can be used, or None; after a jump, start again over the whole surface."""
        if odometry is None:
            return None
        try:
            motion = Odometry.from_matrix(odometry)
        except ValueError as error:
            self._gates.refuse("bad_odometry", str(error))
            return None
        if motion.distance > self.config.max_odometry_jump:
            units = "; is TF in millimetres? It must be in metres" if motion.distance > _MILLIMETRES else ""
            self._restarted = f"odometry jumped by {motion.distance:.2f} m{units}"
            self._gates.refuse("odometry_jump", self._restarted)
            self.initialise_uniform()
            return None
        return motion

    def _compare(self, touches: list[Measurement], in_air: list[Measurement]) -> None:
        """Make this frame a keyframe if one is due; otherwise align what could be published to it."""
        gels = gels_of(touches)
        at = self._track.motion @ gels
        if self._track.is_due(gels):
            self._novelty.take(at, touches)
            self._sightings = self._keyframes.begin(touches, gels, in_air)
            with self._watch.stage("align"):
                self._groups = grouped(self._belief)
            return
        if self._novelty.is_new(at, touches):
            self._sharpen(touches)
        self._held = self._novelty.resting

    def deferred_update(self, in_time: InTime = always) -> None:
        """Run the work that only later estimates need: best called between an answer and the next touch.

        The time since the last frame limits the amount of work.

        Parameters
        ----------
        in_time
            Ends the work earlier on a machine that is too slow: estimates then depend on the machine.
        """
        if self._keyframes is None or not self._keyframes.waiting:
            return
        with self._watch.stage("compare"):
            if self._keyframes.go_on(self._held, in_time):
                self._sightings = {}
            self._groups = grouped(self._belief)

    # ------------------------------------------------------------------ every frame

    def _sharpen(self, touches: list[Measurement]) -> None:
        """Align the modes that could be published to this frame's maps."""
        belief, least = self._belief, _LEAST_FOLLOWED * self._groups[0].weight if self._groups else 0.0
        groups = [group for group in self._groups[: self.config.refined_modes] if group.weight >= least]
        if not groups or self.objects[0].alignment is None:
            return
        with self._watch.stage("align"):
            leading = np.array([group.members[0] for group in groups])
            odometer, back = self._track.odometer, se3.inverse(belief.since)
            hypotheses = belief.hypotheses.some(leading).moved(belief.since).drifted(odometer, self._noise.drift)
            poses, covariances = belief.hypotheses.poses.copy(), belief.hypotheses.covariances.copy()
            aligned_at = belief.hypotheses.aligned_at.copy()
            seen: dict[int, Sighting] = {}
            for number in np.unique(hypotheses.objects):
                own = np.flatnonzero(hypotheses.objects == number)
                found = self.objects[number].alignment.align_each(
                    hypotheses.poses[own], hypotheses.covariances[own], touches, descents=1
                )
                self._gates.count("descents", int(found.descents.sum()))
                seen.update(zip(leading[own].tolist(), found.sightings(), strict=True))
                poses[leading[own]] = found.poses @ back
                covariances[leading[own]] = transform_covariance(found.covariances, back)
                aligned_at[leading[own]] = odometer
            belief.hypotheses = replace(belief.hypotheses, poses=poses, covariances=covariances, aligned_at=aligned_at)
            self._sightings = seen

    # ------------------------------------------------------------------ answers

    @property
    def identity(self) -> tuple[np.ndarray, float]:
        """Probabilities (O,) of the objects, from their weights, and of none of them, from the leading hypothesis."""
        prior, belief = self.config.unknown_prior, self._belief
        if belief is None or not self._groups:
            return np.full(len(self.objects), (1 - prior) / len(self.objects)), prior
        known = (1 - prior) * float(np.exp(belief.support[self._groups[0].object]))
        unknown = prior / (known + prior)
        return (1.0 - unknown) * belief.object_masses(), unknown

    def _estimate(self, in_contact: bool) -> Estimate:
        belief = self._belief
        unknown = self.identity[1]
        leading = self._leading_object
        groups = [group for group in self._groups if group.object == leading]
        with self._watch.stage("modes"):
            believed = {k: each for k, each in self._sightings.items() if each.fit > self._noise.explained}
            self.modes = modes_of(belief, groups, believed, REGION_WIDTH, self._noise)
            if not self.modes:
                self.modes = [self._guess()]
            covariance = covariance_of(belief, leading, self.modes)
        if groups:
            unexplained = 1.0 - belief.hypotheses.fit[groups[0].members[0]]
            barely = self._noise.residual_evidence(1.0 - self._noise.explained)
            self._trend = float(self._noise.residual_evidence(unexplained) - barely)
        first = self.modes[0]
        alike = self.objects[leading].symmetry.exact
        self._state.update(
            StateEvidence(
                initialised=True,
                in_contact=in_contact,
                trend=self._trend,
                restarted=self._restarted,
                listed=1.0 - belief.untested_mass if groups else 0.0,
                mode_mass=first.weight,
                error_t=first.spread_translation,
                error_r=first.spread_rotation,
                unknown=unknown,
                alike="" if alike.trivial else alike.describe(),
            )
        )
        if self._state.state == CONVERGED:
            self._mesh_scale.add(self._track.motion[:3, 3], first.pose[:3, 3])
        elif in_contact:
            self._mesh_scale.restart()
        return Estimate(self.modes, self._status(self.modes), covariance)

    def _guess(self) -> Mode:
        """Return the heaviest untested pose as a mode, for the time before anything was compared."""
        belief = self._belief
        tops = [some.log_weights.max(initial=-np.inf) for some in belief.untested]
        number = int(np.argmax(tops))
        some = belief.untested[number]
        row = int(np.argmax(some.log_weights))
        weight = float(np.exp(some.log_weights[row] - belief.total()))
        pose = some.some(np.array([row])).poses[0] @ belief.since
        turn = se3.turn(pose[:3, :3])
        return Mode(weight, pose, turn @ self._noise.between_entries @ turn.T, 1)

    def _status(self, modes: Sequence[Mode]) -> Status:
        skipped, note = dict(self._gates.counts), self._gates.note
        said = self._state.reason
        reason = f"{said} ({note})" if note and note != said else said
        symmetry = self.objects[0].symmetry.describe()
        if not modes:
            return Status(self._state.state, reason, skipped=skipped, symmetry=symmetry)
        first, belief = modes[0], self._belief
        if self._state.state == CONVERGED and (scale := self._mesh_scale.fault(first.spread_translation)):
            reason = f"{reason}; {scale}"
        return Status(
            state=self._state.state,
            reason=reason,
            n_particles=len(belief),
            ess=_effective(belief),
            n_modes=len(modes),
            mode_mass=first.weight,
            spread_t=first.spread_translation,
            spread_r=first.spread_rotation,
            likelihood_trend=self._trend,
            skipped=skipped,
            ms=self._watch.ms,
            symmetry=symmetry,
            foreign=self._state.foreign,
        )

    @property
    def poses(self) -> np.ndarray:
        """Draws `T_obj_gel` (N, 4, 4) from the belief about the object that the estimate is on, at the present frame.

        N = 0 while uninitialised.
        """
        if self._belief is None:
            return np.empty((0, 4, 4))
        return draws(self._belief, self._leading_object, _DRAWS, self._seed)

    @property
    def weights(self) -> np.ndarray:
        """Weights (N,) of the draws, sum 1."""
        return np.full(_DRAWS, 1.0 / _DRAWS) if self._belief else np.empty(0)

    @property
    def object(self) -> ObjectModel:
        """Object that the estimate is on."""
        return self.objects[self._leading_object]

    @property
    def _leading_object(self) -> int:
        return self._groups[0].object if self._groups else 0

    @property
    def belief(self) -> Belief | None:
        """Hypotheses and untested poses after the last step, for reading only; None while uninitialised."""
        return self._belief

    @property
    def groups(self) -> list[Group]:
        """Modes of the belief, as groups of hypotheses, heaviest first."""
        return self._groups

    @property
    def measured_gels(self) -> np.ndarray:
        """Poses (F, 4, 4) of the gels that have touched since the last lift, in the present frame of the first gel."""
        return self._track.touched


def _effective(belief: Belief) -> float:
    """Return the effective number of hypotheses and untested poses, 1 / sum(w^2)."""
    total = belief.total()
    parts = [belief.hypotheses.log_weights, *(some.log_weights for some in belief.untested)]
    return float(1.0 / max(sum(np.exp(2 * (each - total)).sum() for each in parts), 1e-300))

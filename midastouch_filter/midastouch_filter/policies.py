"""The parts of a filter step, each of which can be swapped for another one that is called alike."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arm_calibration.odometry_correction import AsMeasured, OdometryCorrection
from .core.config import FilterConfig
from .core.fingers import Fingers
from .core.gates import Gates, Stopwatch
from .core.initialisation import ParticleSource
from .core.motion_model import MotionModel, Propagation
from .core.noise_model import Effort, NoiseModel
from .core.object_model import ObjectModel
from .core.pose_hypothesis import Prior
from .core.resampling import Resampler
from .core.reweighting import Recovery, Reweighting
from .core.workers import Workers
from .refinement.fine_stage import CoarseOnly, FineStage
from .refinement.refinement import Refinement
from .smoothing.fixed_lag_smoother import FixedLagSmoother
from .smoothing.reevaluation import Reevaluation


@dataclass
class Policies:
    """correct: the odometry; propagate: equation 1; fingers: what is measured that is new; reweigh: equation 2,
    normalised; resample: to how many; recover: after a collapse of the likelihood, without maps; refine: the
    fine stage; source: of new particles."""

    correct: AsMeasured
    propagate: Propagation
    fingers: Fingers
    reweigh: Reweighting
    resample: Resampler
    recover: Recovery
    refine: CoarseOnly
    source: ParticleSource

    def restart(self, prior: Prior | None = None) -> None:
        """Forget what was measured: the particles were drawn anew; `prior` as `CoarseOnly.restart`."""
        for policy in (self.correct, self.propagate, self.fingers, self.reweigh):
            policy.restart()
        self.refine.restart(prior)


def default_policies(
    config: FilterConfig,
    noise: NoiseModel,
    model: ObjectModel,
    rng: np.random.Generator,
    gates: Gates,
    watch: Stopwatch,
    workers: Workers,
) -> Policies:
    """The policies that the configuration asks for, without a memory."""
    motion_model = MotionModel(config, rng, workers)
    source = ParticleSource(model.lookup, motion_model, noise.jitter, rng, workers)
    resample = Resampler(model.regions, config, rng)
    map_shape, refine, correct = None, CoarseOnly(), AsMeasured()
    if model.alignment is not None:
        map_shape, effort = model.alignment.map_shape, Effort()
        refinement = Refinement(model.alignment, config, noise, effort, workers)
        refine = FineStage(refinement, config, gates, watch)
        if config.smoothing:
            reevaluation = Reevaluation(
                model.lookup, model.alignment, model.symmetry, model.n_poses, config, noise, effort
            )
            refine = FixedLagSmoother(refinement, reevaluation, config, noise, source, resample, gates, watch)
        if config.calibration or config.object_motion:
            correct = OdometryCorrection(model.alignment, config, noise, watch)
    return Policies(
        correct=correct,
        propagate=Propagation(motion_model, config, gates),
        fingers=Fingers(model.finger_maker(gates), map_shape, gates),
        reweigh=Reweighting(model.measurement.outlier, refine.pool),
        resample=resample,
        # where maps tell hypotheses apart, these are found by the kept touches instead
        recover=Recovery(source, gates, 0.0 if model.alignment else config.recovery_fraction),
        refine=refine,
        source=source,
    )

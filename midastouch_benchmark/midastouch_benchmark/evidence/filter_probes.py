"""Probes of the answers of filter, identification and advice on small scenes, under each protocol.

Each run is short, and its touches lie far apart: much happens before an error of the last bit has grown.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable

import numpy as np

from midastouch_filter.active_touch.suggestion import Advisor, Wanted
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.estimate import Estimate
from midastouch_filter.core.noise_model import NoiseModel
from midastouch_filter.core.object_model import ObjectModel
from midastouch_filter.core.state import STATES
from midastouch_filter.core.workers import Workers
from midastouch_filter.filter import ParticleFilter

from ..trials import disturbances
from ..trials.protocols import PROTOCOLS
from ..trials.sequence_trials import start_filter
from ..trials.trial import TrialFrame, with_odometry
from .probe import Probe, Probes
from .scene import ProbeScene

_LEAST = (*[1e-4] * 3, *[5e-3] * 6, 1e-2, 5e-2, 1e-2, 1e-2, 3e-2, 3e-2, 5e-2, 0.1)
"""Differences that do not matter, by number of `_answer`: m, rotation entries, masses, logarithms, nats, a state."""
_FEW = 1_000
"""Particles of most probes."""
_MOST = 16  # frames
_ELSEWHERE = ("real_sensor", "real_sensor_calibrated", "small_parts")  # differ from `plain` in object or sensor
Nudge = Callable[[list[TrialFrame]], list[TrialFrame]]


def filter_probes(scenes: list[ProbeScene], config: FilterConfig, nudge: Nudge = lambda frames: frames) -> Probes:
    """Return probes of two scenes by name; nudge: changes frames before a filter gets them."""
    config = dataclasses.replace(config, threads=1)
    few = dataclasses.replace(config, max_particles=_FEW)
    tool, eyebolt = scenes
    out = {}
    for k, (name, protocol) in enumerate(PROTOCOLS.items()):
        if name in _ELSEWHERE:
            continue
        frames = eyebolt.grasp if name == "grasp" else eyebolt.frames
        given = disturbances.UndisturbedSlide(frames, np.random.default_rng(k), tool.frames, eyebolt.codebook)
        frames = nudge(protocol.disturb(given).frames)[:_MOST]
        out[name] = _run(eyebolt, frames, few, protocol.starts[0], protocol.beta)
    frames = nudge(tool.frames)
    out["tool"] = _run(tool, frames, few, "paper", 0.2)
    out["tool, nothing known"] = _run(tool, frames, few, "uniform", 1.0)
    for name, start in (("as shipped", ("paper", 1.0)), ("as shipped, nothing known", ("uniform", 1.0))):
        out[name] = _run(eyebolt, nudge(eyebolt.frames), config, *start)
    codes = dataclasses.replace(few, refinement=False)
    out["codes"] = _run(eyebolt, nudge(eyebolt.frames), codes, "paper", 0.5)
    out["identity"] = _identity(scenes, frames, few)
    out["advice"] = _advice(tool, frames, few)
    return out


def _run(scene: ProbeScene, frames: list[TrialFrame], config: FilterConfig, init: str, beta: float) -> Probe:
    estimates, _ = _estimates(scene, frames, config, init, beta)
    return Probe(np.array([_answer(each) for each in estimates]), _LEAST)


def _estimates(
    scene: ProbeScene, frames: Iterable[TrialFrame], config: FilterConfig, init: str, beta: float
) -> tuple[list[Estimate], ParticleFilter]:
    """Return an estimate for each frame, and the filter at the end."""
    particle_filter, out = ParticleFilter(scene.mesh, scene.codebook, config), []
    start_filter(particle_filter, scene.mesh, scene.poses[0], init, beta)
    for frame, odometry in with_odometry(frames):
        out.append(particle_filter.step(odometry, frame.measurement, frame.others, frame.seconds))
    return out, particle_filter


def _answer(estimate: Estimate) -> list[float]:
    status, pose = estimate.status, estimate.pose
    return [
        *pose[:3, 3],
        *pose[:3, :2].ravel(),
        status.mode_mass,
        np.log(status.ess),
        np.log(status.n_particles),
        status.likelihood_trend,
        np.log(status.spread_t + 1e-6),
        np.log(status.spread_r + 1e-6),
        np.log(np.trace(estimate.covariance[:3, :3])),
        STATES.index(status.state),
    ]


def _identity(scenes: list[ProbeScene], frames: list[TrialFrame], config: FilterConfig) -> Probe:
    """Probe the probabilities of the objects and of none, and the position of the gel on the leading one."""
    about = config, NoiseModel.of(config), Workers(config.threads)
    particle_filter = ParticleFilter.on([ObjectModel(each.mesh, each.codebook, *about) for each in scenes], config)
    particle_filter.initialise_uniform()
    rows = []
    for frame, odometry in with_odometry(frames):
        estimate = particle_filter.step(odometry, frame.measurement, elapsed=frame.seconds)
        probabilities, unknown = particle_filter.identity
        rows.append([unknown, *probabilities, *estimate.pose[:3, 3]])
    return Probe(np.array(rows), [3e-3] * 3 + [2e-5] * 3)


def _advice(scene: ProbeScene, frames: list[TrialFrame], config: FilterConfig) -> Probe:
    """Probe information, cost, length and heading of the best suggestions, early and later."""
    rows = []
    for count in (1, 3, len(frames) // 2):
        _, particle_filter = _estimates(scene, frames[:count], config, "uniform", 1.0)
        advice = Advisor(particle_filter).advise(Wanted(lifts=True))
        best = advice.suggestions[0] if advice.suggestions else None
        rows.append([best.information, best.cost, best.length, best.heading] if best else [0.0] * 4)
    return Probe(np.array(rows), (1e-2, 1e-4, 1e-4, 1e-3))

"""Calibration of the likelihood of a single touch, by which a codebook's likelihood temperature is judged."""

from __future__ import annotations

import numpy as np

from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.lookup import PoseLookup
from midastouch_filter.core.measurement_model import MeasurementModel, log_ratios
from midastouch_filter.core.workers import Workers
from midastouch_perception.codebook import Codebook

from ..evidence import fingerprint
from ..statistics.coverage import LEVELS
from .campaign import Plan
from .trial_log import TrialLog, key_of


def likelihood_levels(plan: Plan, mesh: ObjectMesh, log: TrialLog) -> list[int]:
    """Count the levels at which the likelihoods of single touches put their true poses, over the plan's slides."""
    networks = plan.cache.describe()
    digest = plan.cache.codebook_digest(mesh)
    content = [mesh.sha256, networks, digest, plan.cache.slides.name, plan.slides, fingerprint.of_estimates()]
    key = key_of({"likelihood": content, "settings": [plan.config.temperature, plan.config.outlier]})
    if (entry := log.get(key)) is None:
        codes, poses = [], []
        for slide in plan.slides:
            for frame in plan.cache.frames(mesh, slide, stride=5):
                if frame.measurement.in_contact:
                    codes.append(frame.measurement.code)
                    poses.append(frame.truth)
        entry = {"counts": likelihood_counts(plan.cache.codebook(mesh), codes, np.array(poses), plan.config)}
        log.add(key, entry)
    return entry["counts"]


def likelihood_counts(
    codebook: Codebook, codes: list[np.ndarray], poses: np.ndarray, config: FilterConfig
) -> list[int]:
    """Count the levels of the true poses (N, 4, 4) in the likelihoods of their codes, in the bins of `LEVELS`.

    The likelihood of one touch over the codebook is a distribution; the level of the truth is the mass of all entries
    that it ranks above the entry nearest to the true pose, plus half of the entry's own.
    """
    workers = Workers(config.threads)
    lookup = PoseLookup(codebook.poses, workers)
    model = MeasurementModel(codebook.codes, codebook.meta, config, workers)
    counts = np.zeros(len(LEVELS) + 1, int)
    for code, entry in zip(codes, lookup.exact(poses), strict=True):
        (log_ratio,) = log_ratios([model], model.unit_code(code))
        likelihood = np.exp(log_ratio, dtype=float)
        own = likelihood[entry]
        # entries as likely as the truth's own share the rank
        level = (likelihood[likelihood > own].sum() + 0.5 * likelihood[likelihood == own].sum()) / likelihood.sum()
        counts[np.searchsorted(LEVELS, level)] += 1
    return counts.tolist()

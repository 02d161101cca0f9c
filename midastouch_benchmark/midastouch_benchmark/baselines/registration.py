"""Methods without a filter: odometry alone, and registration of the contact cloud that odometry accumulates.

Features (FPFH, Rusu et al. 2009) of the cloud are matched with the object's by RANSAC, then ICP, point to plane, aligns
the cloud; both are Open3D's.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_common.pose_metric import geodesic_distances
from midastouch_filter.core.estimate import Estimate, Mode
from midastouch_filter.core.gates import Stopwatch
from midastouch_filter.core.state import AMBIGUOUS, CONVERGED, UNINITIALISED, Status
from midastouch_filter.core.touch import MAP_SCALE
from midastouch_filter.paper_filter import gaussian_poses, uniform_entries
from midastouch_perception.pointcloud import cloud_from_penetration
from midastouch_perception.sensor_model import SensorModel
from midastouch_tools.view import require_open3d

if TYPE_CHECKING:
    from midastouch_filter.core.touch import Measurement
    from midastouch_perception.codebook import Codebook


class DeadReckoning:
    """Odometry alone: one pose `T_obj_gel`, always `converged` once started, with the interface of `ParticleFilter`.

    It starts at the codebook pose nearest to a draw from the prior: the prior's mean would give the answer away.
    Args: mesh, codebook, clock: as of `ParticleFilter`.
    """

    def __init__(self, mesh: ObjectMesh, codebook: Codebook, clock: Callable[[], float] = lambda: 0.0):
        self._book, self._clock, self._diagonal = np.asarray(codebook.poses, float), clock, mesh.diagonal
        self.reset(0)

    def reset(self, seed: int) -> None:
        """Forget everything but the object."""
        self._rng = np.random.default_rng(seed)
        self._pose: np.ndarray | None = None
        self._covariance = np.eye(6)
        self._state = UNINITIALISED

    def initialise_uniform(self) -> None:
        """Start anywhere on the surface."""
        entry = uniform_entries(len(self._book), 1, self._rng)[0]
        self._start(self._book[entry], self._diagonal, np.pi)

    def initialise_gaussian(self, prior: np.ndarray, sigma_t: float, sigma_r: float) -> None:
        """Start at a draw around a prior `T_obj_gel` (4, 4) with sigma_t [m] and sigma_r [rad] per axis."""
        drawn = gaussian_poses(prior, sigma_t, sigma_r, 1, self._rng)[0]
        self._start(self._book[np.argmin(geodesic_distances(self._book, drawn))], sigma_t, sigma_r)

    def _start(self, pose: np.ndarray, sigma_t: float, sigma_r: float) -> None:
        self._pose, self._state = pose.copy(), CONVERGED
        self._covariance = np.diag(np.repeat([sigma_t, sigma_r], 3) ** 2)

    def step(self, odometry: np.ndarray | None, measurement: Measurement, elapsed: float | None = None) -> Estimate:
        """Move by `inv(p_prev) p_now` (4, 4), None on the first frame; elapsed is ignored."""
        if self._pose is None:
            return Estimate([], Status(self._state, "no start given yet"))
        watch = Stopwatch(self._clock)
        with watch.stage("motion"):
            if odometry is not None:
                self._pose = self._pose @ odometry
        with watch.stage("look"):
            self._look(odometry, measurement)
        status = Status(self._state, "one answer", n_particles=1, ess=1.0, n_modes=1, mode_mass=1.0, ms=watch.ms)
        return Estimate([Mode(1.0, self._pose, self._covariance, 1)], status, self._covariance)

    def _look(self, odometry: np.ndarray | None, measurement: Measurement) -> None:
        """Ignore the measurement."""

    @property
    def poses(self) -> np.ndarray:
        """The pose (1, 4, 4); (0, 4, 4) before a start."""
        return np.empty((0, 4, 4)) if self._pose is None else self._pose[None]

    @property
    def weights(self) -> np.ndarray:
        """Weights of `poses`: 1 for the registered pose (1,), empty (0,) before there is one."""
        return np.ones(len(self.poses))


_VOXEL = 2e-3  # m, of both clouds; other lengths are multiples of it, as in Open3D's documents
_EVERY = 20  # touches between two registrations
_ITERATIONS = 20_000  # of RANSAC
_SURE = 0.8  # fraction of the cloud that must lie on the surface for the state `converged`


class Registration(DeadReckoning):
    """The latest registration of all points measured so far, moved by the odometry in between.

    ICP starts from RANSAC's answer and from the present pose; the better fit counts. The covariance follows from the
    RMSE of its inliers. Raises InputError if Open3D is missing.
    """

    def __init__(self, mesh: ObjectMesh, codebook: Codebook, clock: Callable[[], float] = lambda: 0.0):
        self._open3d = require_open3d()
        self._sensor = SensorModel.of_codebook(codebook.meta).scaled(MAP_SCALE)
        points, normals, _ = mesh.sample_surface(max(int(4 * mesh.area / _VOXEL**2), 1000), np.random.default_rng(0))
        self._object = self._cloud(points, normals)
        self._object_features = self._features(self._object)
        super().__init__(mesh, codebook, clock)

    def reset(self, seed: int) -> None:
        """Forget everything but the object."""
        super().reset(seed)
        self._open3d.utility.random.seed(seed)
        self._since_start = np.eye(4)
        self._points: np.ndarray = np.empty((0, 3))
        self._normals: np.ndarray = np.empty((0, 3))
        self._touches = 0

    def _start(self, pose: np.ndarray, sigma_t: float, sigma_r: float) -> None:
        super()._start(pose, sigma_t, sigma_r)
        self._state = AMBIGUOUS

    def _look(self, odometry: np.ndarray | None, measurement: Measurement) -> None:
        if odometry is not None:
            self._since_start = self._since_start @ odometry
        if not measurement.in_contact or measurement.penetration is None:
            return
        points = cloud_from_penetration(measurement.penetration, measurement.penetration > 0, self._sensor)
        self._points = np.concatenate([self._points, points @ self._since_start[:3, :3].T + self._since_start[:3, 3]])
        # the surface faces the gel
        self._normals = np.concatenate([self._normals, np.tile(self._since_start[:3, 2], (len(points), 1))])
        self._touches += 1
        if self._touches % _EVERY == 0 and len(self._points) > 10:
            self._register()

    def _register(self) -> None:
        """Align all points measured so far."""
        registration = self._open3d.pipelines.registration
        cloud = self._cloud(self._points, self._normals)
        # the given normals only show which way is out: Open3D keeps new normals on the side of those present
        cloud.estimate_normals(self._open3d.geometry.KDTreeSearchParamHybrid(2 * _VOXEL, 30))
        matched = registration.registration_ransac_based_on_feature_matching(
            cloud, self._object, self._features(cloud), self._object_features, True, 1.5 * _VOXEL,
            registration.TransformationEstimationPointToPoint(False), 3,
            [registration.CorrespondenceCheckerBasedOnEdgeLength(0.9),
             registration.CorrespondenceCheckerBasedOnDistance(1.5 * _VOXEL)],
            registration.RANSACConvergenceCriteria(_ITERATIONS, 0.999),
        )  # fmt: skip
        starts = (matched.transformation, self._pose @ se3.inverse(self._since_start))
        found = [
            registration.registration_icp(
                cloud, self._object, _VOXEL, start, registration.TransformationEstimationPointToPlane()
            )
            for start in starts
        ]
        best = max(found, key=lambda one: (one.fitness, -one.inlier_rmse))
        self._state = CONVERGED if best.fitness >= _SURE else AMBIGUOUS
        self._pose = np.array(best.transformation) @ self._since_start
        spread = max(best.inlier_rmse, 1e-4)
        self._covariance = np.diag(np.repeat([spread, spread / 0.01], 3) ** 2)

    def _cloud(self, points: np.ndarray, normals: np.ndarray):
        vectors = self._open3d.utility.Vector3dVector
        cloud = self._open3d.geometry.PointCloud(vectors(points.astype(float)))
        cloud.normals = vectors(normals.astype(float))
        return cloud.voxel_down_sample(_VOXEL)

    def _features(self, cloud):
        reach = self._open3d.geometry.KDTreeSearchParamHybrid(5 * _VOXEL, 100)
        return self._open3d.pipelines.registration.compute_fpfh_feature(cloud, reach)

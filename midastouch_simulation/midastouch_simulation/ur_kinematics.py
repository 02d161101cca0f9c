"""Kinematics of a simulated UR: joint speeds that move its gel by a twist, joint positions that put it at a pose."""

from __future__ import annotations

from types import ModuleType

import numpy as np

from midastouch_common import se3

_DAMPED = 0.01  # damping of the least squares that turn a twist into joint speeds; matters if the arm is stretched
_FOLLOWED = 0.9  # fraction of every twist that the arm must follow: a depth cannot be held with less
_CLOSE = 1e-4, 1e-3  # m, rad: a pose counts as reached
_MOST_ITERATIONS = 200
_LONGEST_STEP = 0.2  # rad


def pose_of(site) -> np.ndarray:
    """Return the pose (4, 4) of one of MuJoCo's sites, in its world."""
    return se3.make(site.xmat.reshape(3, 3).copy(), site.xpos.copy())


def jacobian_of(mujoco: ModuleType, model, data, site) -> tuple[np.ndarray, np.ndarray]:
    """Return the linear and angular velocity of a site per velocity of each joint: (3, N) each."""
    linear, angular = np.zeros((2, 3, model.nv))
    mujoco.mj_jacSite(model, data, linear, angular, site.id)
    return linear, angular


class Kinematics:
    """Kinematics of an arm as `ur_model` makes it. Args: mujoco, the module; model and data, MuJoCo's own."""

    def __init__(self, mujoco: ModuleType, model, data):
        self._mujoco, self._model, self._data = mujoco, model, data
        arm = [model.joint(f"joint{number}").id for number in range(6)]
        self._places, self._speeds = model.jnt_qposadr[arm], model.jnt_dofadr[arm]
        self._gel = data.site("drawn_gel")

    @property
    def positions(self) -> np.ndarray:
        """Positions (6,) of the joints [rad]."""
        return self._data.qpos[self._places].copy()

    @positions.setter
    def positions(self, positions: np.ndarray) -> None:
        self._data.qpos[self._places] = positions
        self._mujoco.mj_fwdPosition(self._model, self._data)

    @property
    def velocities(self) -> np.ndarray:
        """Velocities (6,) of the joints [rad/s]."""
        return self._data.qvel[self._speeds].copy()

    @property
    def pose(self) -> np.ndarray:
        """Pose T_base_gel (4, 4) by the drawing."""
        return pose_of(self._gel)

    @property
    def meets(self) -> bool:
        """True while a link touches the table, or the sensor's housing touches a link or the table."""
        return self._data.ncon > 0

    @property
    def follows(self) -> bool:
        """True while the gel can follow every twist: not if the arm is stretched, or two of its axes are in line."""
        weakest = np.linalg.svd(self._jacobian, compute_uv=False)[-1]
        return bool(weakest**2 >= _FOLLOWED * (weakest**2 + _DAMPED**2))

    def speeds_of(self, twist: np.ndarray) -> np.ndarray:
        """Return joint speeds (6,) [rad/s] that give the drawn gel a twist (6,) in its frame: damped least squares."""
        jacobian = self._jacobian
        return jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + _DAMPED**2 * np.eye(6), twist)

    @property
    def _jacobian(self) -> np.ndarray:
        """Jacobian (6, 6): twist of the gel, in its frame, per joint speed."""
        linear, angular = jacobian_of(self._mujoco, self._model, self._data, self._gel)
        turned = self.pose[:3, :3].T
        return np.concatenate([turned @ linear[:, self._speeds], turned @ angular[:, self._speeds]])

    def reach(self, goal: np.ndarray, passing: bool = False) -> bool:
        """Move the joints until the drawn gel is at a pose (4, 4); return whether it is, follows twists there, and
        meets nothing. If not, the joints stay where the way ended. passing: whether it may meet things on the way."""
        for _ in range(_MOST_ITERATIONS):
            error = se3.log(se3.inverse(self.pose) @ goal)
            there = bool(np.linalg.norm(error[:3]) < _CLOSE[0] and np.linalg.norm(error[3:]) < _CLOSE[1])
            if there or (self.meets and not passing):
                return there and not self.meets and self.follows
            step = self.speeds_of(error)
            self.positions += step * min(1.0, _LONGEST_STEP / float(np.abs(step).max()))
        return False

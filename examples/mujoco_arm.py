"""A simulated arm slides a DIGIT over an object, with the contact of MuJoCo (`pip install mujoco`).

midastouch build-codebook handle_tool
midastouch run digit_sim object:=handle_tool       # this and the next in terminals of their own
midastouch run localization object:=handle_tool
python examples/mujoco_arm.py
"""

import mujoco
import numpy as np
from scipy.interpolate import LinearNDInterpolator
from simulated_finger import BASE_FROM_OBJECT, SPEED, STEP, along, run

from midastouch_common import se3
from midastouch_perception import ObjectMesh, bundled_objects
from midastouch_tools.processes.foreground import ended_by_signals

CELL = 1e-3  # m
HOME = [0.0, 0.7, 1.4, 1.0, 0.0, -1.6]  # rad
TOO_DEEP = 4e-3  # m below the surface, where the arm wants the gel; the contact decides how deep it gets
STIFFNESS, DAMPING = np.diag([600.0] * 3 + [20.0] * 3), np.diag([60.0] * 3 + [1.5] * 3)  # N/m, Nm/rad; times s
# Links as long as a UR5e's. The gel is as round at its apex as the sensor model's; a spring lets it give way by 1 mm
# for 3 N. The site is where the gel would be untouched.
ARM = """
<mujoco>
  <option timestep="0.001" integrator="implicitfast"/>
  <default>
    <joint damping="0.5" armature="0.1"/>
    <geom rgba="0.6 0.6 0.65 1" contype="0" conaffinity="0" density="1000"/>
    <default class="touch"><geom contype="1" conaffinity="1" friction="0.2"/></default>
  </default>
  <asset><hfield name="top" size="{half[0]} {half[1]} {height} 0.01" nrow="{rows}" ncol="{columns}"/></asset>
  <worldbody>
    <geom class="touch" type="hfield" hfield="top" pos="{position}"/>
    <body name="shoulder" pos="0 0 0.163"><joint axis="0 0 1"/><geom type="cylinder" size="0.06 0.08"/>
     <body name="upper_arm" pos="0 0.138 0"><joint axis="0 1 0"/>
      <geom type="capsule" size="0.05" fromto="0 0 0 0 0 0.425"/>
      <body name="forearm" pos="0 -0.131 0.425"><joint axis="0 1 0"/>
       <geom type="capsule" size="0.04" fromto="0 0 0 0 0 0.392"/>
       <body name="wrist_1" pos="0 0 0.392"><joint axis="0 1 0"/>
        <geom type="capsule" size="0.035" fromto="0 0 0 0 0.127 0"/>
        <body name="wrist_2" pos="0 0.127 0"><joint axis="0 0 1"/>
         <geom type="capsule" size="0.035" fromto="0 0 0 0 0 0.1"/>
         <body name="wrist_3" pos="0 0 0.1"><joint axis="0 1 0"/>
          <geom type="capsule" size="0.03" fromto="0 0 0 0 0.1 0"/>
          <geom type="box" size="0.013 0.012 0.018" pos="0 0.13 0" rgba="0.1 0.1 0.1 1"/>
          <body pos="0 0.145 0"><joint type="slide" axis="0 1 0" stiffness="3000" damping="15" armature="0"/>
           <geom class="touch" type="ellipsoid" size="0.012 0.0044 0.016" mass="0.02" rgba="0.9 0.6 0.6 1"/></body>
          <site name="gel" pos="0 0.1494 0" xyaxes="1 0 0 0 0 1"/>
         </body></body></body></body></body></body>
  </worldbody>
</mujoco>
"""


def height_of(mesh: ObjectMesh) -> LinearNDInterpolator:
    """Return the height z [m] of the object's upper side as a function of (x, y) [m]."""
    upper = mesh.vertices[mesh.vertex_normals[:, 2] > 0.1]
    return LinearNDInterpolator(upper[:, :2], upper[:, 2], fill_value=mesh.bounds[0, 2])


def model_of(mesh: ObjectMesh) -> mujoco.MjModel:
    """Return arm and object. MuJoCo touches only a mesh's convex hull, so the object's upper side is a height field."""
    low, high = mesh.bounds
    half, height = (high - low)[:2] / 2, high[2] - low[2]
    columns, rows = np.ceil(2 * half / CELL).astype(int) + 1
    position = BASE_FROM_OBJECT[:3, 3] + [*(low + high)[:2] / 2, low[2]]
    model = mujoco.MjModel.from_xml_string(
        ARM.format(half=half, height=height, rows=rows, columns=columns, position=" ".join(map(str, position)))
    )
    y, x = np.meshgrid(np.linspace(low[1], high[1], rows), np.linspace(low[0], high[0], columns), indexing="ij")
    model.hfield_data[:] = ((height_of(mesh)(x, y) - low[2]) / height).ravel()
    return model


class Arm:
    """Arm as a motion: a spring at its tool pulls it along `wanted`, as under impedance control."""

    def __init__(self, mesh: ObjectMesh, wanted):
        self.model, self.wanted = model_of(mesh), wanted
        self.data = mujoco.MjData(self.model)
        self.data.qpos[:6] = HOME
        self.site = self.model.site("gel").id
        self.jacobian = np.zeros((6, self.model.nv))
        while self.data.time < 4.0:  # to where the motion begins
            self.step(0.0)
        self.began = self.data.time

    def __call__(self, seconds: float) -> np.ndarray:
        """Return the gel's pose T_obj_gel (4, 4) at that time."""
        while self.data.time < self.began + seconds:
            self.step(self.data.time - self.began)
        return self.pose()

    def pose(self) -> np.ndarray:
        """Return the gel's pose T_obj_gel (4, 4)."""
        at = self.data.site(self.site)
        return se3.inverse(BASE_FROM_OBJECT) @ se3.make(at.xmat.reshape(3, 3), at.xpos)

    def step(self, seconds: float) -> None:
        """Simulate a millisecond."""
        mujoco.mj_forward(self.model, self.data)
        mujoco.mj_jacSite(self.model, self.data, self.jacobian[:3], self.jacobian[3:], self.site)
        here, there = self.pose(), self.wanted(seconds)
        speed = twist(there, self.wanted(seconds + 1e-3)) / 1e-3
        pull = STIFFNESS @ twist(here, there) - DAMPING @ (self.jacobian @ self.data.qvel - speed)
        self.data.qfrc_applied[:] = self.jacobian.T @ pull + self.data.qfrc_bias
        mujoco.mj_step(self.model, self.data)


def twist(here: np.ndarray, there: np.ndarray) -> np.ndarray:
    """Return the way (6,) m, rad from a pose (4, 4) to another, in the axes of the frame that both are in."""
    turn = se3.log(se3.make(there[:3, :3] @ here[:3, :3].T, np.zeros(3)))[3:]
    return np.concatenate([there[:3, 3] - here[:3, 3], turn])


def along_the_grip(mesh: ObjectMesh, length: float) -> np.ndarray:
    """Return poses T_obj_gel (N, 4, 4) below the upper side of the tool's grip, to and fro from pommel to collar."""
    t = np.arange(0, length, STEP)
    x, y = -0.035 - 0.032 * np.cos(t / 0.032), 0.003 * np.sin(20 * t)
    points = np.stack([x, y, height_of(mesh)(x, y)], axis=1)
    normals = mesh.smooth_normals(points, radius=8e-3)
    return se3.make(se3.frame_from_normal(normals, 0.3 * np.sin(9 * t)), points - TOO_DEEP * normals)


if __name__ == "__main__":
    with ended_by_signals():
        tool = ObjectMesh.load(bundled_objects()["handle_tool"])
        path = along_the_grip(tool, 0.35)
        # a touch looks the same all around the grip: the filter gets the pose at which the slide begins
        run(Arm(tool, along(path, lifted=TOO_DEEP + 8e-3)), len(path) * STEP / SPEED, start_given=True)

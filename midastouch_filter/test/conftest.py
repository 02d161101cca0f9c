"""A small world for the filter: an object without symmetry, a codebook and slides over it."""

from __future__ import annotations

import functools
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from hypothesis import settings

from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.object_model import derived_arrays, of_surface
from midastouch_filter.core.touch import MAP_SCALE, Measurement
from midastouch_filter.filter import ParticleFilter
from midastouch_filter.identification.catalogue import Catalogue
from midastouch_perception.codebook import Codebook
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.symmetry.group import Symmetry
from midastouch_perception.symmetry.search import ObjectSymmetry
from midastouch_simulation.slide import measure_poses

# on a busy machine time says nothing about the code
settings.register_profile("filter", deadline=None, derandomize=True)
settings.load_profile("filter")

NETWORK = "fourier-test"


def bumpy_mesh(twofold: bool = False, handed_below: bool = False) -> ObjectMesh:
    """An ellipsoid of 100 x 70 x 50 mm with bumps at uneven places.

    twofold: the same after half a turn about z; handed_below: but not where z is lowest.
    """
    sphere = trimesh.creation.icosphere(subdivisions=4)
    directions = np.random.default_rng(3).standard_normal((12, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    if twofold:
        copies = directions[directions[:, 2] > -0.4] if handed_below else directions
        directions = np.concatenate([directions, copies * [-1, -1, 1]])
    bumps = np.exp(15 * (sphere.vertices @ directions.T - 1)).sum(axis=1)
    vertices = sphere.vertices * (1 + 0.12 * bumps[:, None]) * [0.05, 0.035, 0.025]
    return ObjectMesh.from_arrays(vertices, sphere.faces, "bumpy")


def poses_at(mesh: ObjectMesh, points: np.ndarray, yaw: np.ndarray, penetration: float | np.ndarray) -> np.ndarray:
    """Contact poses `T_obj_gel` (N, 4, 4) at the surface points nearest to points (N, 3)."""
    closest, _, face = mesh.closest_points(points)
    normals = mesh.face_normals[face]
    depth = np.broadcast_to(penetration, len(points))[:, None]
    return se3.make(se3.frame_from_normal(normals, yaw), closest - depth * normals)


def random_poses(mesh: ObjectMesh, n: int, rng: np.random.Generator) -> np.ndarray:
    """n contact poses, uniform over surface, yaw and a penetration of 0.5-2 mm."""
    points = mesh.sample_surface(n, rng)[0]
    return poses_at(mesh, points, rng.uniform(0, 2 * np.pi, n), rng.uniform(5e-4, 2e-3, n))


class FourierEncoder:
    """Codes (N, 64) that vary smoothly with the pose: random Fourier features of position and rotation."""

    def __init__(self, dim: int = 64, length: float = 0.012, seed: int = 5):
        rng = np.random.default_rng(seed)
        self.frequency = rng.standard_normal((12, dim // 2)) / length
        self.phase = rng.uniform(0, 2 * np.pi, dim // 2)

    def __call__(self, poses: np.ndarray) -> np.ndarray:
        rotation = 0.007 * poses[:, :3, :3].reshape(-1, 9)
        angle = np.concatenate([poses[:, :3, 3], rotation], axis=1) @ self.frequency + self.phase
        codes = np.concatenate([np.cos(angle), np.sin(angle)], axis=1)
        return (codes / np.linalg.norm(codes, axis=1, keepdims=True)).astype(np.float32)


def make_codebook(poses: np.ndarray, codes: np.ndarray, derived: dict[str, np.ndarray] | None = None) -> Codebook:
    """What the filter needs of a codebook; derived: as of `Codebook`, which saves a second with each filter."""
    return Codebook(poses, codes, {"temperature": 0.1, "outlier": 0.05, "tcn": NETWORK}, derived)


def make_slide(mesh: ObjectMesh, n: int, rng: np.random.Generator, step: float = 0.0015) -> np.ndarray:
    """A slide (n, 4, 4) over the surface in steps of about `step` metres, turning slowly."""
    pose = random_poses(mesh, 1, rng)[0]
    out = [pose]
    heading, yaw = rng.uniform(0, 2 * np.pi), 0.0
    for _ in range(n - 1):
        heading += rng.normal(0, 0.05)
        ahead = pose[:3, 3] + step * (np.cos(heading) * pose[:3, 0] + np.sin(heading) * pose[:3, 1])
        normal = mesh.face_normals[mesh.closest_points(ahead[None])[2][0]]
        # carry the frame along: the old x axis, made perpendicular to the new normal
        x = pose[:3, 0] - normal * (normal @ pose[:3, 0])
        x /= np.linalg.norm(x)
        yaw = rng.normal(0, 0.02)
        turn = se3.exp([0, 0, 0, 0, 0, yaw])
        closest = mesh.closest_points(ahead[None])[0][0]
        pose = se3.make(np.stack([x, np.cross(normal, x), normal], axis=1), closest - 1e-3 * normal) @ turn
        heading -= yaw
        out.append(pose)
    return np.stack(out)


@pytest.fixture(scope="session")
def world() -> SimpleNamespace:
    """mesh, poses (8000), encode, codebook, of_surface (what is derived of the mesh), and functions above."""
    mesh = bumpy_mesh()
    poses = random_poses(mesh, 8000, np.random.default_rng(1))
    encode = FourierEncoder()
    codebook = make_codebook(poses, encode(poses))
    codebook.derived = derived_arrays(mesh, codebook)
    return SimpleNamespace(
        mesh=mesh,
        poses=poses,
        encode=encode,
        codebook=codebook,
        of_surface=of_surface(codebook.derived),
        bumpy_mesh=bumpy_mesh,
        make_codebook=make_codebook,
        random_poses=random_poses,
        poses_at=poses_at,
        make_slide=make_slide,
    )


@pytest.fixture(scope="session")
def coded_slide(world) -> SimpleNamespace:
    """A slide on which codes are measured: poses (100, 4, 4); odometry between measured poses (0.5 mm, 1 deg, as
    YCB-Slide's) and touches along them; config; make_filter(config, seed), as if made anew with the seed."""
    rng = np.random.default_rng(12)
    poses = make_slide(world.mesh, 100, rng)
    measured = measure_poses(poses, rng)
    # without maps a pose is known no better than the entries of its book are apart, here some 5 mm
    config = FilterConfig(converged_error=0.02)
    # making one takes a second
    made = functools.cache(lambda config: ParticleFilter(world.mesh, world.codebook, config))

    def make_filter(config: FilterConfig = config, seed: int = 0) -> ParticleFilter:
        made(config).reset(seed)
        return made(config)

    return SimpleNamespace(
        poses=poses,
        odometry=[*se3.odometry(measured)],
        touches=[Measurement(True, code, 1e-4) for code in world.encode(poses)],
        config=config,
        make_filter=make_filter,
    )


@pytest.fixture(scope="session")
def mapped_slide(world) -> SimpleNamespace:
    """A slide on which maps are measured: poses (120, 4, 4); odometry and touches along them; touches_at(poses), those
    at other poses; codebook; make_filter(codebook, seed, **settings), as if made anew with the seed."""
    book = make_codebook(world.poses, world.codebook.codes, world.codebook.derived)
    book.meta["sensor"], book.symmetry = "digit_tacto", ObjectSymmetry()  # to search for one takes seconds
    poses = make_slide(world.mesh, 120, np.random.default_rng(12))
    renderer = PenetrationRenderer(world.mesh, SensorModel.load("digit_tacto").scaled(MAP_SCALE))

    def touches_at(poses: np.ndarray) -> list[Measurement]:
        maps = np.maximum(renderer.render(poses), 0)
        return [Measurement(True, c, 1e-4, penetration=m) for c, m in zip(world.encode(poses), maps, strict=True)]

    def make(codebook: Codebook = book, **settings) -> ParticleFilter:
        return ParticleFilter(world.mesh, codebook, FilterConfig(**{"threads": 1, **settings}))

    made = functools.cache(lambda settings: make(**dict(settings)))  # making one takes a second

    def make_filter(codebook: Codebook | None = None, seed: int = 0, **settings) -> ParticleFilter:
        filter_ = made(tuple(settings.items())) if codebook is None else make(codebook, **settings)
        filter_.reset(seed)
        return filter_

    return SimpleNamespace(
        poses=poses,
        odometry=[*se3.odometry(poses)],
        touches=touches_at(poses),
        touches_at=touches_at,
        codebook=book,
        make_filter=make_filter,
    )


@pytest.fixture(scope="session")
def gripper(world) -> SimpleNamespace:
    """Two fingers on an object that is the same after half a turn, above but not below; one slides over each side.

    above (75, 4, 4), poses of the first finger, and measured, the same with an arm's errors; odometry between these;
    between (75, 4, 4), the second finger's gel in the first's; codes and penetrations (160, 120) of both; half_turn;
    make_filter(config).
    """
    mesh, half_turn = bumpy_mesh(twofold=True, handed_below=True), np.diag([-1.0, -1.0, 1.0, 1.0])

    def encode(poses: np.ndarray) -> np.ndarray:
        codes = world.encode(poses)
        above = poses[:, 2, 3] > 0
        codes[above] += world.encode(half_turn @ poses[above])
        return codes / np.linalg.norm(codes, axis=1, keepdims=True)

    poses = random_poses(mesh, 8000, np.random.default_rng(1))
    book = make_codebook(poses, encode(poses))
    nearly = Symmetry(np.stack([np.eye(4), half_turn]))
    book.derived, book.symmetry = derived_arrays(mesh, book), ObjectSymmetry(Symmetry(), 0.0, nearly)
    book.meta["sensor"] = "digit_tacto"
    turns = np.linspace(0, 2 * np.pi, 75)
    circle = 0.018 * np.stack([1.4 * np.cos(turns), np.sin(turns), 0 * turns], axis=1)
    sides = [poses_at(mesh, circle + np.array([0, 0, z]), 0.5 * turns, 1e-3) for z in (0.04, -0.04)]
    renderer = PenetrationRenderer(mesh, SensorModel.load("digit_tacto").scaled(0.5))
    rng = np.random.default_rng(2)
    measured = measure_poses(sides[0], rng)
    return SimpleNamespace(
        above=sides[0],
        measured=measured,
        odometry=[*se3.odometry(measured)],
        between=measure_poses(se3.inverse(sides[0]) @ sides[1], rng, 2e-4, np.radians(0.3)),
        codes=[encode(side) for side in sides],
        penetrations=[np.maximum(renderer.render(side), 0) for side in sides],
        half_turn=half_turn,
        make_filter=functools.cache(lambda config: ParticleFilter(mesh, book, config, 0)),
    )


def lumpy_mesh(seed: int) -> ObjectMesh:
    """An ellipsoid with bumps of its own."""
    sphere = trimesh.creation.icosphere(subdivisions=4)
    rng = np.random.default_rng(seed)
    directions = rng.standard_normal((25, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    bumps = np.exp(rng.uniform(20, 90) * (sphere.vertices @ directions.T - 1)).sum(axis=1)
    axes = rng.uniform(0.025, 0.045, 3)
    return ObjectMesh.from_arrays(sphere.vertices * (1 + 0.15 * bumps[:, None]) * axes, sphere.faces, f"bumpy_{seed}")


@pytest.fixture(scope="session")
def shelf(world):
    """Three objects: catalogue; touches(k), true poses and frames, motion and measurement, of a slide over one."""
    sensor = SensorModel.load("digit_tacto").scaled(MAP_SCALE)
    meshes = [lumpy_mesh(seed) for seed in (1, 2, 3)]
    renderers = [PenetrationRenderer(mesh, sensor) for mesh in meshes]

    def encode(maps: np.ndarray) -> np.ndarray:
        """What is measured, coarsely: a code that is much alike where maps are, on whichever object."""
        coarse = maps.reshape(len(maps), 8, 10, 6, 10).mean(axis=(2, 4)).reshape(len(maps), -1)
        return (coarse / np.linalg.norm(coarse, axis=1, keepdims=True)).astype(np.float32)

    meta = {"sensor": "digit_tacto", "tcn": NETWORK, "temperature": 0.03, "outlier": 0.05}
    objects = []
    for k, mesh in enumerate(meshes):
        poses = world.random_poses(mesh, 3000, np.random.default_rng(k))
        maps = np.maximum(renderers[k].render(poses), 0)
        touching = maps.max(axis=(1, 2)) > 0
        book = Codebook(poses[touching], encode(maps[touching]), meta)
        book.derived, book.symmetry = derived_arrays(mesh, book), ObjectSymmetry()
        objects.append((mesh, book, None))

    @functools.cache
    def touches(k: int, steps: int = 130):
        truth = world.make_slide(meshes[k], steps, np.random.default_rng(5 + k))
        maps = np.maximum(renderers[k].render(truth), 0)
        measured = [Measurement(True, code, network_id=NETWORK, penetration=each) for code, each in
                zip(encode(maps), maps, strict=True)]  # fmt: skip
        return truth, list(zip(se3.odometry(truth), measured, strict=True))

    return SimpleNamespace(catalogue=Catalogue.of(objects, FilterConfig(threads=1)), touches=touches)

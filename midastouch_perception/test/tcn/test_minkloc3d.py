import numpy as np
import pytest

from midastouch_common.errors import InputError
from midastouch_perception.codebook import Codebook
from midastouch_perception.codebook_build import build_codebook
from midastouch_perception.rendering.contact_poses import sample_contact_poses
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.tcn import load_tcn
from midastouch_perception.tcn.minkloc3d import contact_cloud, save_minkloc3d, scaled_cloud


@pytest.fixture(scope="module")
def maps(minkloc, tool):
    poses = sample_contact_poses(tool, 4, np.random.default_rng(0), minkloc.sensor)
    return PenetrationRenderer(tool, minkloc.sensor).render(poses)


def test_codes_are_unit_and_do_not_depend_on_their_company(minkloc, maps):
    codes = minkloc.encode(maps)
    assert codes.shape == (4, minkloc.dim) == (4, 256)
    np.testing.assert_allclose(np.linalg.norm(codes, axis=1), 1, atol=1e-6)
    np.testing.assert_array_equal(minkloc.encode(maps[2]), codes[2])
    assert np.abs(codes[0] - codes[1]).max() > 1e-3
    with pytest.raises(InputError, match="penetration map: "):
        minkloc.encode(np.full((160, 120), np.nan, np.float32))


@pytest.mark.slow
def test_a_codebook_is_built_and_found_again(minkloc, tool, sensor, tmp_path):
    build_codebook(tool, minkloc, sensor, size=20).save(tmp_path / "book.npz")
    book = Codebook.load(tmp_path / "book.npz", mesh=tool, tcn=minkloc.network_id)
    assert book.codes.shape == (20, minkloc.dim)
    assert book.meta["temperature"] == 1.0
    with pytest.raises(InputError, match="tcn_minkloc3d-"):
        Codebook.load(tmp_path / "book.npz", tcn=load_tcn("fast").network_id)


@pytest.mark.parametrize(("voxel_size", "same"), [(0.01, True), (0.02, False)])
def test_weights_and_voxel_size_are_the_identity(minkloc, minkloc_state, tmp_path, voxel_size, same):
    other = load_tcn(save_minkloc3d(minkloc_state, {"network": "tcn_minkloc3d"}, tmp_path, voxel_size=voxel_size))
    assert (other.network_id == minkloc.network_id) == same


@pytest.mark.parametrize(
    ("name", "kept", "said"),
    [
        ("none", None, r"none\.npz: no such tcn network file"),
        ("cut", 100_000, r"cut\.npz: .*import-weights"),
        ("alone", 10**9, r"alone\.json: "),
    ],
)
def test_unusable_files_are_named(minkloc_file, tmp_path, name, kept, said):
    path = tmp_path / f"{name}.npz"
    if kept:
        path.write_bytes(minkloc_file.read_bytes()[:kept])
    with pytest.raises(InputError, match=said):
        load_tcn(path)
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    with pytest.raises(InputError, match=r"other\.npz: .*midastouch import-weights"):
        load_tcn(tmp_path / "other.npz")


POINTS = 4096


def touched(rows: slice, depth: float = 1e-3) -> np.ndarray:
    """A map (160, 120) pressed `depth` m in these rows."""
    penetration = np.zeros((160, 120), np.float32)
    penetration[rows] = depth
    return penetration


def test_points_lie_where_the_camera_sees_the_pressed_gel(sensor):
    cloud = contact_cloud(touched(slice(0, 160)), sensor, 10**6, np.random.default_rng(0))
    depth = sensor.gel_depth - 1e-3
    expected = np.stack([sensor.rays[0] * depth, sensor.rays[1] * depth, -depth], axis=2)
    np.testing.assert_allclose(cloud.reshape(320, 240, 3), expected, atol=1e-7)


def test_points_are_drawn_without_preference(sensor):
    """The official code would have three in four of them in the lower half."""
    cloud = contact_cloud(touched(slice(0, 160)), sensor, POINTS, np.random.default_rng(0))
    assert len(cloud) == len(np.unique(cloud, axis=0)) == POINTS
    assert np.mean(cloud[:, 1] > 0) == pytest.approx(0.5, abs=0.03)


def test_scaling_is_joint_and_the_official_one(shared):
    cloud = np.array([[-0.01, 0.0, -0.02], [0.005, 0.01, -0.021]], np.float32)
    scaled = scaled_cloud(cloud)
    assert (scaled.min(), scaled.max()) == (-1, 1)
    np.testing.assert_allclose(scaled[1] - scaled[0], (cloud[1] - cloud[0]) * 2 / 0.031, atol=1e-6)
    with np.load(shared / "reference" / "minkloc3d" / "tactile24_q0.01.npz") as data:
        clouds, official = data["clouds_m"], data["clouds_n"]
    ours = np.stack([scaled_cloud(cloud) for cloud in clouds])
    np.testing.assert_array_equal(ours, official)

import numpy as np
import pytest

from midastouch_common.errors import InputError
from midastouch_perception.rendering.contact_poses import sample_contact_poses
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_simulation.optics import ColourTable, Illumination, TactoOptics, gel_normals, render_gel

SLOPES, DIRECTIONS = 9, 17  # a quarter turn is a whole number of bins
PIXEL = 1e-4  # m


@pytest.fixture(scope="module")
def pressed(tool, sensor):
    renderer = PenetrationRenderer(tool, sensor)
    penetration, normals = renderer.render_with_normals(sample_contact_poses(tool, 1, np.random.default_rng(5), sensor))
    return penetration[0], normals[0]


def test_gel_normals_are_the_dome_s(sensor):
    """Against the analytic normal of the ellipsoid cap."""
    tangent_x, tangent_y = sensor.rays
    depth = sensor.gel_depth
    x, y = tangent_x * depth, tangent_y * depth
    dome = dict(sensor.dome)
    c = dome["semi_axis_z"]
    root = np.sqrt(1 - x**2 / (c * dome["radius_x"]) - y**2 / (c * dome["radius_y"]))
    expected = np.stack([-x / (dome["radius_x"] * root), -y / (dome["radius_y"] * root), np.ones_like(x)], axis=-1)
    expected /= np.linalg.norm(expected, axis=-1, keepdims=True)
    np.testing.assert_allclose(gel_normals(sensor)[2:-2, 2:-2], expected[2:-2, 2:-2], atol=2e-3)


def test_the_image_changes_where_it_is_touched(pressed, sensor):
    penetration, normals = pressed
    optics = TactoOptics(sensor)
    assert np.abs(optics.difference(np.zeros((320, 240), np.float32))).max() < 1e-3
    with_normals, without = optics.difference(penetration, normals), optics.difference(penetration)
    change = np.abs(with_normals).max(axis=2)
    assert change[penetration > 0].mean() > 3
    assert change[penetration == 0].mean() < 0.5
    assert np.corrcoef(with_normals.ravel(), without.ravel())[0, 1] > 0.9, "slopes stand in for normals"


def test_image_is_background_plus_change_plus_noise(pressed, sensor):
    penetration, normals = pressed
    optics = TactoOptics(sensor)
    background = np.full((320, 240, 3), 120, np.uint8)
    image = optics.image(penetration, background, np.random.default_rng(0), normals)
    assert image.dtype == np.uint8
    residual = image - np.floor(optics.difference(penetration, normals) + background)
    assert residual.std() == pytest.approx(2.0, abs=0.1)
    np.testing.assert_array_equal(image, optics.image(penetration, background, np.random.default_rng(0), normals))


@pytest.fixture(scope="module")
def coefficients():
    """Responds to the slope's direction (red: cosine, green: sine), twice as strongly per bin, plus an offset."""
    angle = np.linspace(-np.pi, np.pi, DIRECTIONS)
    out = np.zeros((SLOPES, DIRECTIONS, 6, 3))
    strength = 2.0 * np.arange(SLOPES)[:, None]
    out[:, :, 5, 0] = strength * np.cos(angle) + 7
    out[:, :, 5, 1] = strength * np.sin(angle) - 3
    return out


@pytest.fixture(scope="module")
def table(coefficients):
    return ColourTable(coefficients)


def ramp(along_x: float, along_y: float, shape=(40, 30)) -> np.ndarray:
    """A plane (H, W) m that rises by these slopes to the right and downwards."""
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    return ((along_x * columns + along_y * rows) * PIXEL).astype(np.float32)


def test_the_table_is_asked_for_slope_and_direction(table):
    assert np.abs(table.difference(ramp(1e-4, 0), PIXEL)).max() < 0.01, "the offset at zero slope is taken off"
    slope = np.tan(np.pi / 2 * 2.5 / (SLOPES - 1))
    assert table.difference(ramp(slope, 0), PIXEL)[20, 15, 0] == pytest.approx(5.0, rel=0.01), "linear between bins"
    strength = [np.abs(table.difference(ramp(slope, 0), PIXEL)[20, 15, 0]) for slope in (0.1, 0.5, 2.0, 1e3, 1e4)]
    assert strength == sorted(strength)
    assert strength[-1] == pytest.approx(2 * (SLOPES - 1), rel=0.01)
    assert strength[-1] - strength[-2] < 0.1, "saturates"
    right, down = (table.difference(ramp(*slope), PIXEL)[20, 15] for slope in ((1, 0), (0, 1)))
    assert right[0] > 3 > abs(right[1])
    assert down[1] > 3 > abs(down[0])
    np.testing.assert_allclose(table.difference(ramp(-1, 0), PIXEL)[20, 15, 0], -right[0], atol=0.05)
    full, half = table.difference(ramp(0.7, 0.2), PIXEL), table.difference(2 * ramp(0.7, 0.2, (20, 15)), 2 * PIXEL)
    np.testing.assert_allclose(half[10, 7], full[20, 15], atol=0.05, err_msg="the same plane at half the resolution")


@pytest.mark.parametrize("turns", [1, 2, 3, 4, -1])
def test_quarter_turns_turn_the_camera_with_its_lights(table, turns):
    """The picture of a turned height by the turned table is the turned picture."""
    height = np.random.default_rng(0).normal(0, 1e-4, (24, 24)).astype(np.float32)
    plain = table.difference(height, PIXEL)
    turned = table.difference(np.rot90(height, -turns), PIXEL, turns)
    np.testing.assert_allclose(turned, np.rot90(plain, -turns), atol=0.05)
    if turns % 4:
        assert np.abs(table.difference(height, PIXEL, turns) - plain).max() > 3
    np.testing.assert_allclose(table.difference(height[:, ::-1], PIXEL, mirrored=True), plain[:, ::-1], atol=0.05)


def test_the_answer_differs_over_the_image_and_is_limited(coefficients):
    local = np.zeros_like(coefficients)
    local[1:, :, 3, 2] = 0.1  # blue, linear in x
    blue = ColourTable(local).difference(ramp(1, 0), PIXEL)[..., 2]
    assert blue[20, 25] > blue[20, 4] + 20
    difference = ColourTable(coefficients * 1e4).difference(ramp(1, 1), PIXEL)
    assert np.isfinite(difference).all()
    assert np.abs(difference).max() == 130


def test_load_reads_what_taxim_writes(coefficients, table, tmp_path):
    path = tmp_path / "polycalib.npz"
    np.savez(path, **{f"grad_{c}": coefficients[..., k] for k, c in enumerate("rgb")})
    np.testing.assert_array_equal(
        ColourTable.load(path).difference(ramp(1, 0.3), PIXEL), table.difference(ramp(1, 0.3), PIXEL)
    )


def test_unusable_files_are_named(tmp_path, coefficients):
    (tmp_path / "text.npz").write_text("no table")
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    np.savez(tmp_path / "nan.npz", **{f"grad_{c}": coefficients[..., 0] * np.nan for c in "rgb"})
    np.savez(tmp_path / "flat.npz", **{f"grad_{c}": np.zeros((3, 3)) for c in "rgb"})
    (tmp_path / "empty.npz").touch()
    (tmp_path / "cut.npz").write_bytes((tmp_path / "flat.npz").read_bytes()[:-99])
    with pytest.raises(InputError, match=r"none\.npz: no such colour table file"):
        ColourTable.load(tmp_path / "none.npz")
    for name in ("text", "other", "nan", "flat", "empty", "cut"):
        with pytest.raises(InputError, match=f"{name}.npz: .*polycalib.npz"):
            ColourTable.load(tmp_path / f"{name}.npz")


def test_the_table_of_a_real_digit(shared):
    """A ball presses bright and coloured: tens of grey levels, each side of it in another colour."""
    table = ColourTable.load(shared / "data/digit_real/taxim_digit/polycalib.npz")
    rows, columns = np.mgrid[:160, :120]
    distance = np.hypot(rows - 80, columns - 60) * PIXEL
    height = np.maximum(0, 1e-3 - distance**2 / 8e-3).astype(np.float32)
    difference = table.difference(height, PIXEL)
    assert 20 < np.abs(difference).max() <= 130
    assert not difference[:20].any(), "flat gel"
    left, right = difference[70:90, 40:55].mean(axis=(0, 1)), difference[70:90, 65:80].mean(axis=(0, 1))
    assert np.abs(left - right).max() > 10


# mm in the camera frame (x right, y up, looking along -z), colours RGB
LIGHTS = (((-17.32, 10.0, -5.0), (0, 1, 0)), ((17.32, 10.0, -5.0), (1, 0, 0)), ((0.0, -20.0, -5.0), (0, 0, 1)))
INTENSITY = 2 / 255
BASE, METALLIC, ROUGHNESS = 0.3, 0.2, 0.8


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def written_out(depth, normals, sensor):
    """Grey levels (H, W, 3) of a surface at depth (H, W) m with normals (H, W, 3)."""
    tangent_x, tangent_y = sensor.rays
    points = np.stack([tangent_x * depth, tangent_y * depth, -depth], axis=-1)
    view = unit(-points)
    radiance = np.zeros((*depth.shape, 3))
    for position, colour in LIGHTS:
        position = 1e-3 * np.array(position)
        axis = -unit(np.array([position[0], position[1], 0.0]))
        to_light = position - points
        distance = np.linalg.norm(to_light, axis=-1)
        light = unit(to_light)
        cone = np.clip(2 * (-light @ axis) - 1, 0, 1) ** 2
        half = unit(light + view)
        nl = np.clip((normals * light).sum(-1), 1e-3, 1)
        nv = np.clip(np.abs((normals * view).sum(-1)), 1e-3, 1)
        nh, vh = (normals * half).sum(-1), (view * half).sum(-1)
        f0 = 0.04 * (1 - METALLIC) + BASE * METALLIC
        fresnel = f0 + (1 - f0) * (1 - vh) ** 5
        k = (ROUGHNESS + 1) ** 2 / 8
        geometry = nl / (nl * (1 - k) + k) * nv / (nv * (1 - k) + k)
        a2 = ROUGHNESS**4
        distribution = a2 / (np.pi * (nh**2 * (a2 - 1) + 1) ** 2)
        diffuse = BASE * (1 - 0.04) * (1 - METALLIC)
        reflected = (1 - fresnel) * diffuse / np.pi + fresnel * geometry * distribution / (4 * nl * nv + 1e-3)
        radiance += (INTENSITY * cone / distance**2 * nl * reflected)[..., None] * np.array(colour)
    return 255 * np.clip(radiance ** (1 / 2.2), 0, 1)


def test_gel_is_lit_as_by_tacto(sensor):
    """To a quarter of a grey level, as well as TACTO itself is known to agree with its description."""
    small, rng = sensor.scaled(0.125), np.random.default_rng(0)
    rendered = render_gel(np.zeros((40, 30), np.float32), None, small, Illumination.tacto())
    expected = written_out(small.gel_depth, gel_normals(small).astype(float), small)
    assert np.abs(rendered - expected).max() < 0.25
    assert 20 < expected.mean() < 200
    penetration = rng.uniform(1e-4, 2e-3, (40, 30)).astype(np.float32)
    tilt = rng.normal(0, 0.4, (40, 30, 2))
    normals = unit(np.concatenate([tilt, np.ones((40, 30, 1))], axis=-1))
    rendered = render_gel(penetration, normals.astype(np.float32), small, Illumination.tacto())
    assert np.abs(rendered - written_out(small.gel_depth - penetration, normals, small)).max() < 0.25

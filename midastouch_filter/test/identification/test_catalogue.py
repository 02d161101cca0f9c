from types import SimpleNamespace

import pytest
import trimesh
from filter_runs import meta_of

from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.identification.catalogue import FEWEST, Catalogue, poses_worth, read_catalogue
from midastouch_perception.codebook import Codebook
from midastouch_perception.sensor_model import SensorModel

CONFIG = FilterConfig(threads=1)
SENSOR = "digit_tacto"
OTHER_GEL = SensorModel.load(SENSOR).at_scale(15e3).as_json()


def described(mesh, poses, codes, derived=None, **other):
    meta = meta_of(mesh, tcn="fourier-test")
    return Codebook(poses, codes, meta | other, derived)


@pytest.fixture(scope="module")
def shelf(world, tmp_path_factory):
    """Meshes and codebooks of two objects as files, and functions that add more."""
    folder = tmp_path_factory.mktemp("shelf")

    def add(name, scale=1.0, **meta):
        path = folder / f"{name}.ply"
        ObjectMesh.from_arrays(scale * world.mesh.vertices, world.mesh.faces, name).save(path)
        mesh = ObjectMesh.load(path)
        poses = world.poses.copy()
        poses[:, :3, 3] *= scale
        book = folder / f"{name}.npz"
        derived = world.codebook.derived if scale == 1.0 else None
        described(mesh, poses, world.encode(poses), derived, **meta).save(book)
        return book

    return SimpleNamespace(folder=folder, add=add, books=[add("bumpy"), add("small", 0.8)])


def read(*sources, **room):
    def build(path):
        raise AssertionError(f"{path}: nothing is to be built")

    return read_catalogue(sources, build, CONFIG, SENSOR, **room)


def test_codebooks_name_their_meshes_and_are_read_in_part(shelf):
    catalogue = read(*shelf.books)
    assert [entry.name for entry in catalogue.entries] == ["bumpy", "small"]
    assert len(catalogue) == 2
    assert all(len(entry.model.lookup) == FEWEST for entry in catalogue.entries)
    assert catalogue.entry("small").mesh.diagonal == pytest.approx(0.8 * catalogue.entry("bumpy").mesh.diagonal)


def test_what_a_file_keeps_of_the_surface_is_not_made_again(shelf, monkeypatch):
    monkeypatch.setattr(ObjectMesh, "closest_points", lambda *_: pytest.fail("the surface was searched"))
    assert len(read(shelf.books[0])) == 1
    with pytest.raises(pytest.fail.Exception, match="searched"):
        read(shelf.books[1])


def test_a_catalogue_of_too_many_poses_is_refused(shelf):
    assert len(read(*shelf.books, room=2 * FEWEST)) == 2
    with pytest.raises(InputError, match=r"small\.npz.*2 objects.*10,000 poses.*9,999.*leave objects out"):
        read(*shelf.books, room=2 * FEWEST - 1)


def test_large_objects_are_worth_more_poses(world):
    large = [ObjectMesh.from_arrays(k * world.mesh.vertices, world.mesh.faces, "large") for k in (3, 6)]
    assert poses_worth(world.mesh) == FEWEST
    assert poses_worth(large[1]) == pytest.approx(4 * poses_worth(large[0]), rel=1e-2)


def test_a_mesh_without_codebook_gets_one(world, shelf):
    mesh = ObjectMesh.load(shelf.folder / "bumpy.ply")
    book = described(mesh, world.poses[:100], world.encode(world.poses[:100]), world.of_surface)
    catalogue = read_catalogue([shelf.folder / "bumpy.ply"], lambda path: (mesh, book), CONFIG, SENSOR)
    assert len(catalogue.entries[0].model.lookup) == 100


def test_a_folder_stands_for_its_codebooks(shelf, tmp_path):
    for book in shelf.books:
        (tmp_path / book.name).symlink_to(book)
    assert len(read(tmp_path)) == 2
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match=r"empty.*build-codebook"):
        read(tmp_path / "empty")


def test_of_a_folder_those_of_the_sensor_are_taken(shelf, tmp_path):
    """An object that is to be felt by two sensors has a codebook for each."""
    for name in ("bumpy_digit_real.npz", "bumpy_digit_tacto.npz"):
        book = Codebook.load(shelf.books[0])
        sensor = name.removeprefix("bumpy_").removesuffix(".npz")
        Codebook(book.poses, book.codes, book.meta | {"sensor": sensor}, book.derived).save(tmp_path / name)
    catalogue = read(tmp_path)
    assert [entry.source.name for entry in catalogue.entries] == ["bumpy_digit_tacto.npz"]
    assert not catalogue.duplicates
    (tmp_path / "bumpy_digit_tacto.npz").unlink()
    with pytest.raises(
        InputError, match=r"bumpy_digit_real\.npz: codebook of the sensor model digit_real.*build-codebook"
    ):
        read(tmp_path)


def test_the_same_mesh_for_another_sensor_is_no_duplicate(shelf):
    with pytest.raises(InputError, match=r"again\.npz: codebook of the sensor digit_real, that of bumpy"):
        read(*shelf.books, shelf.add("again", sensor="digit_real"))


def test_the_same_mesh_under_another_name_counts_once(shelf):
    catalogue = read(*shelf.books, shelf.add("again"))
    assert catalogue.duplicates == {"again": "bumpy"}
    assert len(catalogue) == 2


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda shelf: shelf.folder / "missing.npz", "missing.npz"),
        (lambda shelf: shelf.add("other_network", 0.7, tcn="another"), "other_network.npz.*network another"),
        (lambda shelf: shelf.add("other_sensor", 0.7, sensor="digit_real"), "other_sensor.npz.*sensor digit_real"),
        (lambda shelf: shelf.add("other_gel", 0.7, sensor_model=OTHER_GEL), "other_gel.npz.*digit_tacto"),
        (lambda shelf: shelf.add("moved", 0.7, mesh_path="/nowhere/moved.ply"), "moved.npz.*/nowhere"),
        (lambda shelf: shelf.add("changed", 0.7, mesh_sha256="0"), "changed.npz.*again"),
    ],
)
def test_what_cannot_be_used_is_named(shelf, make, said):
    with pytest.raises(InputError, match=said):
        read(*shelf.books, make(shelf))


@pytest.mark.parametrize(("factor", "said"), [(1000.0, "in millimetres"), (5e-3, "too small")])
def test_an_object_of_no_size_to_be_touched_is_refused(world, shelf, factor, said):
    path = shelf.folder / "of_no_size.ply"
    trimesh.Trimesh(factor * world.mesh.vertices, world.mesh.faces, process=False).export(path)
    with pytest.raises(InputError, match=rf"of_no_size\.ply: .*{said}"):
        read(shelf.add("of_size", 0.7, mesh_path=str(path)))


def test_two_objects_of_one_name_are_refused(shelf, tmp_path):
    mesh = ObjectMesh.load(shelf.folder / "small.ply")
    mesh.name = "bumpy"
    first = ObjectMesh.load(shelf.folder / "bumpy.ply")
    books = [Codebook.load(book) for book in shelf.books]
    with pytest.raises(InputError, match=r"small\.ply.*'bumpy'"):
        Catalogue.of([(first, books[0], None), (mesh, books[1], None)], CONFIG)


def test_an_empty_catalogue_is_refused():
    with pytest.raises(InputError, match=r"objects.*codebooks"):
        read()

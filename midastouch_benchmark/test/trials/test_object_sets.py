import pytest

from midastouch_benchmark.trials.object_sets import chosen_meshes
from midastouch_common.errors import InputError


def test_objects_are_named_by_how_they_begin():
    assert [mesh.name for mesh in chosen_meshes(None, ["eye", "ball"], "out")] == ["eyebolt", "ball"]
    with pytest.raises(InputError, match=r"'cup': .*ball.*--objects"):
        chosen_meshes(None, ["cup"], "out")
    with pytest.raises(InputError, match="nowhere: no such folder"):
        chosen_meshes("nowhere", None, "out")


def test_a_folder_without_meshes_is_named(tmp_path):
    with pytest.raises(InputError, match="no mesh file in it"):
        chosen_meshes(str(tmp_path), None, "out")


def test_a_set_made_by_code_is_written_where_results_go(tmp_path):
    meshes = chosen_meshes("nowhere", ["small_cad"], str(tmp_path))
    assert [mesh.path for mesh in meshes] == [tmp_path / "meshes" / f"{mesh.name}.ply" for mesh in meshes]
    assert "gear_16_keyed" in {mesh.name for mesh in meshes}

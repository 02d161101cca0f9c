import pytest

from midastouch_common.errors import InputError
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.loaded_object import build_object, load_object
from midastouch_filter.nodes.object_source import ObjectSource
from midastouch_perception.objects import bundled_objects


@pytest.mark.parametrize(("mesh", "named"), [("handle_tool", "handle_tool"), ("my mug", "'{folder}/my mug.ply'")])
def test_for_a_missing_codebook_the_very_command_is_named(mesh, named, tmp_path):
    file = tmp_path / f"{mesh}.ply"
    file.write_bytes(bundled_objects()["handle_tool"].read_bytes())
    path, codebook = bundled_objects().get(mesh, file), tmp_path / "book.npz"
    given = {"mesh": str(path), "codebook": str(codebook), "sensor_model": "digit_real", "tcn": "fast"}
    source = ObjectSource(
        load_object, build_object, {**given, "object_folders": "", "seed": 0, "preset": "balanced"}, FilterConfig()
    )
    with pytest.raises(InputError, match=r"book\.npz: no such codebook file") as caught:
        source.initial()
    options = f"--sensor digit_real --tcn fast --out {codebook}"
    assert str(caught.value).endswith(f": midastouch build-codebook {named.format(folder=tmp_path)} {options}")

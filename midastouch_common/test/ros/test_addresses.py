from __future__ import annotations

from pathlib import Path

import pytest

from midastouch_common.errors import InputError
from midastouch_common.ros.addresses import load_mesh, require_within, resolve


@pytest.fixture
def package(tmp_path, monkeypatch) -> Path:
    """A package `toys` in an overlay of its own."""
    (tmp_path / "share/ament_index/resource_index/packages").mkdir(parents=True)
    (tmp_path / "share/ament_index/resource_index/packages/toys").touch()
    (tmp_path / "share/toys").mkdir()
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    return tmp_path / "share/toys"


def test_paths_and_files():
    assert resolve("/data/mug.ply", "mesh") == Path("/data/mug.ply")
    assert resolve("file:///data/mug.ply", "mesh") == Path("/data/mug.ply")
    assert resolve(Path("/data/my mug.ply").as_uri(), "mesh") == Path("/data/my mug.ply")


def test_packages(package):
    assert resolve("package://toys/meshes/mug.ply", "mesh") == package / "meshes/mug.ply"


def test_a_package_may_link_to_its_sources(package, tmp_path):
    (tmp_path / "sources").mkdir()
    (package / "meshes").symlink_to(tmp_path / "sources")
    assert resolve("package://toys/meshes/mug.ply", "mesh") == package / "meshes/mug.ply"


@pytest.mark.parametrize(
    ("address", "complaint"),
    [
        ("", "mesh"),
        ("package://nothing/mug.ply", "'nothing'.*mesh"),
        ("package://toys/../../../etc/passwd", "package.*mesh"),
        ("package:///etc/passwd", "package.*mesh"),
        ("~nobody-of-this-name/mug.ply", "home directory"),
        ("file://[mug.ply", "IPv6"),
    ],
)
def test_refusals(package, address, complaint):
    with pytest.raises(InputError, match=complaint):
        resolve(address, "mesh")


def test_links_in_a_circle_are_refused(tmp_path):
    (tmp_path / "mug.ply").symlink_to("mug.ply")
    with pytest.raises(InputError, match=r"mug\.ply"):
        require_within("mug.ply", tmp_path / "mug.ply", [tmp_path / "objects"])


def test_what_is_no_mesh_is_refused_by_name(package):
    (package / "mug.ply").write_text("no mesh")
    with pytest.raises(InputError, match=r"toys/mug\.ply"):
        load_mesh("package://toys/mug.ply")

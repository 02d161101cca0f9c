"""Files that parameters and messages name: by a path, as file://, or as package://NAME/PATH."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import unquote, urlsplit

from ament_index_python.packages import PackageNotFoundError, get_package_share_directory

from ..errors import InputError
from ..mesh import ObjectMesh

_PACKAGE = "package://"
_FILE = "file://"


def load_mesh(address: str, what: str = "mesh") -> ObjectMesh:
    """The mesh at an address. Raises InputError as `resolve`, and for a file that is no mesh."""
    return ObjectMesh.load(resolve(address, what))


def resolve(address: str, what: str) -> Path:
    """The path an address means: a path itself, file:// or package://NAME/PATH.

    Raises InputError, which calls the address `what`, for an empty one, a package that is not installed, a path that
    leaves its package, a user that does not exist, and anything that is no address.
    """
    if not address:
        raise InputError(f"no {what} given; set it")
    if address.startswith(_PACKAGE):
        name, _, inside = address[len(_PACKAGE) :].partition("/")
        try:
            folder = Path(get_package_share_directory(name))
        except (PackageNotFoundError, ValueError) as error:
            raise InputError(f"{address}: no package '{name}' is installed; check {what}") from error
        # Without following links: `colcon build --symlink-install` fills a share folder with links to the sources.
        path = Path(os.path.normpath(folder / inside))
        if not path.is_relative_to(folder):
            raise InputError(f"{address}: leaves its package; check {what}")
        return path
    try:
        if address.startswith(_FILE):
            return Path(unquote(urlsplit(address).path))
        return Path(address).expanduser()
    except (ValueError, RuntimeError) as error:  # file://[, ~nobody
        raise InputError(f"{address}: {error}; check {what}") from error


def require_within(address: str, path: Path, folders: Sequence[Path]) -> None:
    """InputError unless `path`, which `address` means, lies in one of the folders, links followed.

    Addresses package:// are in their package already. No folders: everything is allowed.
    """
    if not folders or address.startswith(_PACKAGE):
        return
    try:
        real = path.resolve()
        inside = any(real.is_relative_to(folder.resolve()) for folder in folders)
    except RuntimeError as error:  # links in a circle
        raise InputError(f"{address}: {error}") from error
    if not inside:
        allowed = ", ".join(map(str, folders))
        raise InputError(f"{address}: outside of {allowed}; move it there, or change the parameter object_folders")

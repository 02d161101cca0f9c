"""Addresses of files in parameters and messages: a path, file:// or package://NAME/PATH."""

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
    """Load the mesh at an address. Raises InputError as `resolve` does, and for a file that is no mesh."""
    return ObjectMesh.load(resolve(address, what))


def resolve(address: str, what: str) -> Path:
    """Return the path that an address names: a path itself, file:// or package://NAME/PATH.

    Raises InputError if the address is empty or malformed, its package is not installed, its path leaves the package or
    its `~user` does not exist. `what` names the address in the message.
    """
    if not address:
        raise InputError(f"no {what} given; set it")
    if address.startswith(_PACKAGE):
        name, _, inside = address[len(_PACKAGE) :].partition("/")
        try:
            folder = Path(get_package_share_directory(name))
        except (PackageNotFoundError, ValueError) as error:
            raise InputError(f"{address}: no package '{name}' is installed; check {what}") from error
        # Do not follow links: `colcon build --symlink-install` fills a share folder with links to the sources.
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
    """Raise InputError unless `path`, to which `address` resolves, lies in one of the folders; links are followed.

    A package:// address is always allowed, because `resolve` keeps it in its package. Without folders every path is.
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

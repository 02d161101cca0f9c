"""Paths as users write them in parameters and services."""

from __future__ import annotations

from pathlib import Path

from ament_index_python.packages import PackageNotFoundError, get_package_share_directory

from midastouch_perception.errors import InputError

_PACKAGE = "package://"


def resolve(address: str, what: str) -> Path:
    """The path an address means: a path itself, file:// or package://NAME/PATH.

    Raises InputError naming `what` for an empty address, a package that is not installed and a path that
    leaves its package.
    """
    if not address:
        raise InputError(f"no {what} given: mesh and codebook belong together, set both")
    if address.startswith(_PACKAGE):
        name, _, inside = address[len(_PACKAGE) :].partition("/")
        try:
            share = Path(get_package_share_directory(name)).resolve()
        except (PackageNotFoundError, ValueError) as error:
            raise InputError(f"{address}: no package '{name}' is installed; check {what}") from error
        path = (share / inside).resolve()
        if not path.is_relative_to(share):
            raise InputError(f"{address}: leaves its package; check {what}")
        return path
    return Path(address.removeprefix("file://")).expanduser()

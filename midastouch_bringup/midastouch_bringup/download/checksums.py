"""SHA256SUMS: where nobody publishes a checksum, the first download is the one that later ones must equal."""

from __future__ import annotations

import re
from pathlib import Path

from midastouch_common.errors import InputError
from midastouch_common.files import atomic_path, sha256

NAME = "SHA256SUMS"


def recorded(folder: Path) -> dict[str, str]:
    """{file name: SHA-256} of a folder's list, in the format of `sha256sum`; InputError if it cannot be read."""
    path = folder / NAME
    if not path.is_file():
        return {}
    found = {}
    for line in path.read_text(errors="replace").splitlines():
        match = re.fullmatch(r"([0-9a-f]{64})  (.+)", line)
        if not match:
            raise InputError(f"{path}: not a list of SHA-256 sums, at '{line[:80]}'; mend or delete it")
        found[match[2]] = match[1]
    return found


def check_or_record(folder: Path, name: str, file: Path) -> None:
    """Compare the sum of `file` with the one recorded under `name`, or record it; InputError if they differ."""
    known, found = recorded(folder), sha256(file)
    if known.get(name, found) != found:
        raise InputError(
            f"{file}: is not the {name} of {folder / NAME}; if it was renewed on purpose, delete that line"
        )
    sums = known | {name: found}
    with atomic_path(folder / NAME) as temporary:
        temporary.write_text("".join(f"{digest}  {known}\n" for known, digest in sorted(sums.items())))

"""Finished trials on disk, one JSON line each, so that a long run goes on where it was stopped."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path

from midastouch_bringup.result_file import to_json


class TrialLog:
    """Trials by the key of what was run; only appended to. A line cut off by a crash is passed over."""

    def __init__(self, path: str | os.PathLike):
        self._path = Path(path)
        self._trials: dict[str, dict] = {}
        if self._path.is_file():
            for line in self._path.read_text().splitlines():
                try:
                    entry = json.loads(line)
                    self._trials[entry["key"]] = entry["trial"]
                except (ValueError, KeyError, TypeError):
                    continue

    def get(self, key: str) -> dict | None:
        """The trial, None if it was not run yet."""
        return self._trials.get(key)

    def add(self, key: str, trial: dict) -> None:
        """Keep a trial."""
        trial = to_json(trial)
        self._path.parent.mkdir(parents=True, exist_ok=True)
        with self._path.open("a") as stream:
            # on its own line even after one that was cut off
            lead = "" if stream.tell() == 0 or self._ends_with_newline() else "\n"
            stream.write(lead + json.dumps({"key": key, "trial": trial}, allow_nan=False) + "\n")
        self._trials[key] = trial

    def _ends_with_newline(self) -> bool:
        with self._path.open("rb") as stream:
            stream.seek(-1, os.SEEK_END)
            return stream.read(1) == b"\n"


def key_of(content: dict) -> str:
    """A name for everything that a trial depends on."""
    return hashlib.sha256(json.dumps(to_json(content), sort_keys=True).encode()).hexdigest()[:24]


def source_digest(*places: Path) -> str:
    """Hash of files, and of the Python files and compiled modules directly in folders: results of older code are not
    taken for those of the new."""
    digest = hashlib.sha256()
    inside = [path for place in places for pattern in ("*.py", "*.so") for path in place.glob(pattern)]
    for path in sorted([*inside, *(place for place in places if place.is_file())]):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:12]

"""Download of one file over HTTP: resumed where it broke off (RFC 9110, range requests), checked, then renamed."""

from __future__ import annotations

import errno
import http.client
import json
import re
import shutil
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from pathlib import Path

from midastouch_common.errors import InputError
from midastouch_common.files import atomic_path, sha256

from .archive import RESERVE

_BLOCK = 1 << 18
_TIMEOUT_S = 30.0
_PASSING_STATUSES = {408, 425, 429, 500, 502, 503, 504}


class _BrokeOff(Exception):
    """Raised if the transfer ended early; another attempt may continue from there."""


def fetch(
    url: str,
    path: Path,
    digest: str | None = None,
    attempts: int = 5,
    pause_s: float = 1.0,
    progress: Callable[[int, int | None], None] = lambda done, total: None,
) -> None:
    """Download `url` to `path`, which appears only once it is complete and, if given, has the SHA-256 `digest`.

    A broken transfer leaves `<path>.part`, which the next call continues if the server still has the same file and
    understands ranges; otherwise the transfer starts over. `progress(bytes so far, total or None)`.
    Raises InputError if there is no such file, no space or wrong content, or if `attempts` transfers broke off.
    """
    if not re.match(r"https?://", url):
        raise InputError(f"{url}: not an http or https address")
    part = _Part(path, url)
    for attempt in range(attempts):
        try:
            _receive(url, part, progress)
            break
        except _BrokeOff as error:
            problem = error
            if attempt + 1 < attempts:
                time.sleep(pause_s * 2**attempt)
    else:
        raise InputError(f"{url}: {problem}, after {attempts} attempts; call again to continue")
    if digest and (found := sha256(part.data)) != digest:
        part.remove()
        raise InputError(f"{url}: has SHA-256 {found}, expected {digest}: damaged or changed; nothing was kept")
    part.data.replace(path)
    part.note.unlink()


class _Part:
    """The beginning of a file, and a note of the server's name for the version it belongs to."""

    def __init__(self, path: Path, url: str):
        self.data, self.note, self._url = Path(f"{path}.part"), Path(f"{path}.part.json"), url

    def validator(self) -> str | None:
        """Return the server's name for the version that `data` belongs to; None if there is nothing to continue."""
        try:
            note = json.loads(self.note.read_text())
            return note["validator"] if note["url"] == self._url and self.data.stat().st_size else None
        except (OSError, ValueError, KeyError, TypeError):
            return None

    def begin(self, validator: str | None) -> None:
        """Start over, in this order, so that bytes of one version never stand next to the note of another."""
        self.remove()
        with atomic_path(self.note) as temporary:
            temporary.write_text(json.dumps({"url": self._url, "validator": validator}))
        self.data.touch()

    def remove(self) -> None:
        """Delete the partial file and its note."""
        self.data.unlink(missing_ok=True)
        self.note.unlink(missing_ok=True)


def _receive(url: str, part: _Part, progress: Callable) -> None:
    validator = part.validator()
    have = part.data.stat().st_size if validator else 0
    headers = {"Accept-Encoding": "identity", "User-Agent": "midastouch"}
    if have:
        headers |= {"Range": f"bytes={have}-", "If-Range": validator}
    try:
        response = urllib.request.urlopen(urllib.request.Request(url, headers=headers), timeout=_TIMEOUT_S)
    except urllib.error.HTTPError as error:
        if error.code == 416:  # our part is not the beginning of the server's file
            part.remove()
        elif error.code not in _PASSING_STATUSES:
            raise InputError(f"{url}: the server answers {error.code} {error.reason}; check the name") from error
        raise _BrokeOff(f"the server answers {error.code} {error.reason}") from error
    except (OSError, http.client.HTTPException) as error:
        raise _BrokeOff(f"no connection ({getattr(error, 'reason', error)})") from error
    with response:
        total = _total(response, have, part)
        if response.status != 206:
            have = 0
            part.begin(_validator_of(response))
        _require_space(part.data, total - have if total else 0)
        _write(response, part, have, total, progress)


def _total(response: http.client.HTTPResponse, have: int, part: _Part) -> int | None:
    """Size of the whole file; None if the server does not state it."""
    if response.status == 206:
        found = re.fullmatch(r"bytes (\d+)-\d+/(\d+)", response.headers.get("Content-Range", ""))
        if not found or int(found[1]) != have:
            part.remove()
            raise _BrokeOff("the server sent another part than the one asked for")
        return int(found[2])
    length = response.headers.get("Content-Length", "")
    return int(length) if length.isdecimal() else None


def _validator_of(response: http.client.HTTPResponse) -> str | None:
    """A strong ETag or the date of change; a weak ETag does not promise equal bytes."""
    etag = response.headers.get("ETag", "")
    return etag if etag and not etag.startswith("W/") else response.headers.get("Last-Modified")


def _require_space(file: Path, wanted: int) -> None:
    free = shutil.disk_usage(file.parent).free
    if wanted + RESERVE > free:
        raise InputError(f"{file.parent}: needs {wanted >> 20} MiB, but {free >> 20} MiB are free; make room")


def _write(response, part: _Part, have: int, total: int | None, progress: Callable) -> None:
    with part.data.open("ab") as file:
        while True:
            try:
                block = response.read(_BLOCK)
            except (OSError, http.client.HTTPException) as error:
                raise _BrokeOff(f"broke off after {have} bytes ({error})") from error
            if not block:
                break
            try:
                file.write(block)
                file.flush()
            except OSError as error:
                if error.errno != errno.ENOSPC:
                    raise
                part.remove()  # a full disk hurts more than a new start
                raise InputError(f"{part.data.parent}: the disk is full; make room and call again") from error
            have += len(block)
            progress(have, total)
    if total is not None and have != total:
        raise _BrokeOff(f"broke off after {have} of {total} bytes")

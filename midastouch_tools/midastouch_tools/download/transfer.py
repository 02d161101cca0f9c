"""Download of one file over HTTP: tried again when it breaks off, and renamed once it is whole."""

from __future__ import annotations

import errno
import http.client
import re
import shutil
import time
import urllib.error
import urllib.request
from pathlib import Path

from midastouch_common.errors import InputError
from midastouch_common.files import atomic_path

from ..progress import progress_bar
from .archive import RESERVE

_BLOCK = 1 << 18
_TIMEOUT_S = 30.0
_PASSING_STATUSES = {408, 425, 429, 500, 502, 503, 504}


class _BrokeOff(Exception):
    """Raised if the transfer ended early; another attempt may succeed."""


def fetch(url: str, path: Path, attempts: int = 5, pause_s: float = 1.0) -> None:
    """Download `url` to `path`, which appears only once it is complete, with a progress bar.

    Raises InputError if there is no such file or no space, or if `attempts` transfers broke off; then nothing is left.
    """
    if not re.match(r"https?://", url):
        raise InputError(f"{url}: not an http or https address")
    for attempt in range(attempts):
        try:
            with _open(url) as response, atomic_path(path) as temporary:
                _write(response, temporary, path.name)
            return
        except _BrokeOff as error:
            problem = error
            if attempt + 1 < attempts:
                time.sleep(pause_s * 2**attempt)
    raise InputError(f"{url}: {problem}, after {attempts} attempts; call again")


def _open(url: str) -> http.client.HTTPResponse:
    headers = {"Accept-Encoding": "identity", "User-Agent": "midastouch"}
    try:
        return urllib.request.urlopen(urllib.request.Request(url, headers=headers), timeout=_TIMEOUT_S)
    except urllib.error.HTTPError as error:
        if error.code not in _PASSING_STATUSES:
            raise InputError(f"{url}: the server answers {error.code} {error.reason}; check the name") from error
        raise _BrokeOff(f"the server answers {error.code} {error.reason}") from error
    except (OSError, http.client.HTTPException) as error:
        raise _BrokeOff(f"no connection ({getattr(error, 'reason', error)})") from error


def _write(response: http.client.HTTPResponse, path: Path, name: str) -> None:
    length = response.headers.get("Content-Length", "")
    total, have = int(length) if length.isdecimal() else None, 0
    if (total or 0) + RESERVE > (free := shutil.disk_usage(path.parent).free):
        raise InputError(f"{path.parent}: needs {(total or 0) >> 20} MiB, but {free >> 20} MiB are free; make room")
    with path.open("wb") as file, progress_bar(unit="B", unit_scale=True, desc=name, total=total) as bar:
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
                raise InputError(f"{path.parent}: the disk is full; make room and call again") from error
            have += len(block)
            bar.update(len(block))
    if total is not None and have != total:
        raise _BrokeOff(f"broke off after {have} of {total} bytes")

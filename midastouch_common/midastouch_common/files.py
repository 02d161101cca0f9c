"""File helpers: paths as users write them, content hashes, writes that never leave half a file behind."""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import itertools
import os
import shutil
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

from .errors import InputError


def expanded(path: str | os.PathLike, parameter: str) -> Path:
    """Return the path with `~` expanded; InputError naming the parameter if the home directory is unknown."""
    try:
        return Path(path).expanduser()
    except RuntimeError as error:
        raise InputError(f"{parameter}: {path}: {error}; give the whole path") from error


def sha256(path: str | os.PathLike) -> str:
    """Return the SHA-256 of a file's content, hexadecimal."""
    digest = hashlib.sha256()
    with Path(path).open("rb") as stream:
        while block := stream.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


def require_file(path: str | os.PathLike, what: str) -> Path:
    """Return `path` as a `Path` if it is a file; InputError naming `what` (such as "mesh") otherwise."""
    path = Path(path)
    try:
        found = path.is_file()
    except OSError as error:  # below a folder that may not be entered, a name too long
        raise InputError(f"{path}: {error.strerror}; check the path of the {what} file") from error
    if not found:
        raise InputError(f"{path}: no such {what} file; check the path")
    return path


def read_yaml(path: str | os.PathLike, what: str) -> Any:
    """Return the content of a YAML file; InputError naming `what` (such as "sensor model") if missing or not YAML."""
    path = require_file(path, what)
    try:
        return yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}; check the {what} file") from error
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError) as error:
        raise InputError(f"{path}: not YAML: {' '.join(str(error).split())}; correct the {what} file") from error


def require_new_folder(path: str | os.PathLike) -> Path:
    """Return `path`, absolute, if it does not exist or is an empty folder; InputError otherwise."""
    path = Path(path).absolute()
    if path.is_symlink() or (path.exists() and not (path.is_dir() and not any(path.iterdir()))):
        raise InputError(f"{path}: exists already; name another folder, or remove it")
    return path


def next_new_folder(path: str | os.PathLike) -> Path:
    """Return the first of PATH, PATH_2, PATH_3, ..., absolute, that is missing or empty; OSError if unreadable."""
    path = Path(path).absolute()
    numbered = (path.with_name(f"{path.name}_{number}") for number in itertools.count(2))
    return next(folder for folder in itertools.chain([path], numbered) if _holds_nothing(folder))


def _holds_nothing(folder: Path) -> bool:
    try:
        return not any(folder.iterdir())
    except FileNotFoundError:
        return True
    except NotADirectoryError:
        return False


def require_place(path: str | os.PathLike) -> Path:
    """Return `path`, ~ expanded; InputError if no file can be written there, even after its folders are made."""
    path = expanded(path, "file")
    above = next(folder for folder in (*path.absolute().parents, Path("/")) if os.access(folder, os.F_OK))
    if path.is_dir() or not above.is_dir() or not os.access(above, os.W_OK | os.X_OK):
        raise InputError(f"{path}: no file can be written there; name another")
    return path


@contextlib.contextmanager
def sole_use(folder: str | os.PathLike) -> Iterator[None]:
    """Make `folder` and lock it against other processes that call this; InputError while another one has it locked.

    The lock is on the file `.lock`, which stays. It ends with the process, even one that crashes.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / ".lock").open("a") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise InputError(
                f"{folder}: another run that is under way writes there; await its end, or start this one elsewhere"
            ) from error
        yield


@contextlib.contextmanager
def whole_folder(folder: str | os.PathLike) -> Iterator[Path]:
    """Yield a fresh folder for the files of a run. In the end they take the place of those of the run before, all at
    once; other files in `folder` stay.

    Of a run that fails the files are kept in a folder `failed` until the next that does not, of one that is interrupted
    or dies nothing. InputError while another process is at work there.
    """
    folder = Path(folder)
    fresh, listed = folder / ".unfinished", folder / ".made"
    with sole_use(folder):
        shutil.rmtree(fresh, ignore_errors=True)
        fresh.mkdir()
        there = {path.name for path in folder.iterdir()}
        former = there & set(listed.read_text().splitlines()) if listed.is_file() else set()
        try:
            yield fresh
            names = {path.name for path in fresh.iterdir()}
            listed.write_text("\n".join(former | names))  # all that is there if this process dies in the lines below
            for path in (folder / name for name in former | names):
                shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
            for name in names:
                (fresh / name).rename(folder / name)
            listed.write_text("\n".join(names))
        except Exception:
            listed.write_text("\n".join({*former, fresh.rename(next_new_folder(folder / "failed")).name}))
            raise
        finally:
            shutil.rmtree(fresh, ignore_errors=True)


@contextlib.contextmanager
def naming(path: str | os.PathLike) -> Iterator[None]:
    """Name `path` in an OSError raised inside that names no file, such as that of a full disk."""
    try:
        yield
    except OSError as error:
        if error.filename is None and error.errno is not None:
            raise OSError(error.errno, error.strerror, str(path)) from error
        raise


@contextlib.contextmanager
def _called(temporary: Path, path: Path) -> Iterator[None]:
    """Replace the name of `temporary`, which the user does not know, with that of `path` in errors raised inside."""
    try:
        yield
    except OSError as error:
        if error.errno is None or temporary.name not in str(error.filename):
            raise
        name = str(error.filename).replace(temporary.name, path.name)
        raise OSError(error.errno, error.strerror, name) from error
    except InputError as error:
        if temporary.name not in str(error):
            raise
        raise InputError(str(error).replace(temporary.name, path.name)) from error


@contextlib.contextmanager
def atomic_path(path: str | os.PathLike) -> Iterator[Path]:
    """Yield a temporary path next to `path`; rename it to `path` on success, remove it on any failure.

    The temporary name keeps the suffix (writers choose their format by it). Works for files and folders;
    an existing folder at `path` is replaced. An OSError that names no file, or an error that names the
    temporary path, is raised with the name of `path`.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.stem}.{uuid.uuid4().hex[:8]}{path.suffix}")
    try:
        with naming(path), _called(temporary, path):
            yield temporary
            if temporary.is_dir() and path.is_dir():
                shutil.rmtree(path)
            temporary.replace(path)
    except BaseException:
        if temporary.is_dir():
            shutil.rmtree(temporary, ignore_errors=True)
        else:
            temporary.unlink(missing_ok=True)
        raise

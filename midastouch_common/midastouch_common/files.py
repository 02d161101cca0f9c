"""File helpers: paths as users write them, content hashes, writes that never leave half a file behind."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import hashlib
import itertools
import os
import re
import shutil
import stat
import tempfile
import uuid
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import yaml

from .errors import InputError


def expanded(path: str | os.PathLike, parameter: str) -> Path:
    """Expand `~` in a path.

    Parameters
    ----------
    path
    parameter
        Name of the parameter, for the message.

    Raises
    ------
    InputError
        The home directory is unknown.
    """
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
        found, folder = path.is_file(), path.is_dir()
    except OSError as error:  # below a folder that may not be entered, a name too long
        raise InputError(f"{path}: {error.strerror}; check the path of the {what} file") from error
    if not found:
        fault = f"is a folder; give the {what} file" if folder else f"no such {what} file; check the path"
        raise InputError(f"{path}: {fault}")
    return path


def require_folder(path: str | os.PathLike, what: str) -> Path:
    """Return `path` as a `Path` if it is a folder; InputError naming `what` (such as "of meshes") otherwise."""
    path = Path(path)
    if not path.is_dir():
        fault = "is a file, not a folder" if path.exists() else "no such folder"
        raise InputError(f"{path}: {fault}; give a folder {what}")
    return path


@contextlib.contextmanager
def readable(path: str | os.PathLike, what: str, fix: str) -> Iterator[None]:
    """Raise any failure inside as an InputError that names `path`, `what` (such as "not a codebook"), reason and `fix`.

    For readers of binary files: NumPy, zipfile and zlib raise a different type for each way a file can be broken.
    """
    try:
        yield
    except Exception as error:
        # NumPy takes any other file for a pickle
        reason = "another format" if "allow_pickle" in str(error) else error
        raise InputError(f"{path}: {what} ({reason}); {fix}") from error


def read_yaml(path: str | os.PathLike, what: str) -> Any:
    """Return the content of a YAML file; InputError naming `what` (such as "sensor model") if missing or not YAML."""
    path = require_file(path, what)
    try:
        return yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}; check the {what} file") from error
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError) as error:
        raise InputError(f"{path}: not YAML: {error}; correct the {what} file") from error


def require_new(path: str | os.PathLike, what: str) -> None:
    """Raise InputError naming `what` (such as "bag") if something, also a link to nothing, has this path."""
    if os.path.lexists(path):
        raise InputError(f"{path}: exists already; name another {what} or remove it")


def require_new_folder(path: str | os.PathLike) -> Path:
    """Return `path`, absolute, if it does not exist or is an empty folder; InputError otherwise."""
    path = Path(path).absolute()
    if path.is_symlink() or not _holds_nothing(path):
        raise InputError(f"{path}: exists already; name another folder, or remove it")
    return path


def next_new_folder(path: str | os.PathLike) -> Path:
    """Return the first of PATH, PATH_2, PATH_3, ..., absolute, that is missing or empty; OSError if unreadable."""
    path = Path(path).absolute()
    numbered = (path.with_name(f"{path.name}_{number}") for number in itertools.count(2))
    return next(folder for folder in itertools.chain([path], numbered) if _holds_nothing(folder))


def _holds_nothing(folder: Path) -> bool:
    return not folder.exists() or (folder.is_dir() and not any(folder.iterdir()))


def require_place(path: str | os.PathLike, what: str = "file") -> Path:
    """Return `path` with ~ expanded.

    Parameters
    ----------
    path
    what
        "file", "folder" or "file or folder".

    Raises
    ------
    InputError
        It cannot be written there, even after the folders above it are made.
    """
    path = expanded(path, what)
    absolute = path.absolute()
    above = next(folder for folder in (absolute, *absolute.parents) if os.access(folder, os.F_OK))
    try:
        with contextlib.suppress(FileNotFoundError):
            is_folder = stat.S_ISDIR(path.stat().st_mode)
            if is_folder and what == "file":
                raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
            if not is_folder and what != "folder":
                above = absolute.parent
        with tempfile.TemporaryFile(dir=above):  # some file systems refuse although their permissions allow it
            pass
    except OSError as error:
        raise InputError(f"{path}: no {what} can be written there ({error.strerror}); name another") from error
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
                f"{folder}: another run is writing there; wait until it ends, or start this one from another folder"
            ) from error
        yield


@contextlib.contextmanager
def whole_folder(folder: str | os.PathLike, keep_failed: bool = False) -> Iterator[Path]:
    """Yield a fresh folder for the files of a run. In the end they take the place of those of the run before, all at
    once; other files in `folder` stay.

    Of a run that fails, is interrupted or dies nothing is kept; with `keep_failed` the files of one that fails are, in
    a folder `failed`, until the next that does not. InputError while another process is at work there.
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
            _keep_names(listed, former | names)  # all that is there if this process dies in the lines below
            for path in (folder / name for name in former | names):
                shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
            for name in names:
                (fresh / name).rename(folder / name)
            _keep_names(listed, names)
        except Exception:
            if keep_failed:
                _keep_names(listed, {*former, fresh.rename(next_new_folder(folder / "failed")).name})
            raise
        finally:
            shutil.rmtree(fresh, ignore_errors=True)


def _keep_names(path: Path, names: Iterable[str]) -> None:
    with atomic_path(path) as new:  # the names before, or these: never none, by which old files would stay for ever
        new.write_text("\n".join(names))


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
def temporary_beside(path: str | os.PathLike) -> Iterator[Path]:
    """Yield a free path next to `path`, with its suffix; a file or folder that is there in the end is removed.

    What processes that were killed left of the same `path` is removed first. Their locks are gone: each process that
    writes into a folder in this way has it locked with others, and removes only while it has it alone.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    name = f".{path.stem}.{{}}{path.suffix}"
    temporary = path.with_name(name.format(uuid.uuid4().hex[:8]))
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(OSError):  # a folder that cannot be listed, a file system without locks
            lock = os.open(path.parent, os.O_RDONLY)
            stack.callback(os.close, lock)
            with contextlib.suppress(BlockingIOError):
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                left = re.compile("[0-9a-f]{8}".join(map(re.escape, name.split("{}"))))
                for other in path.parent.iterdir():
                    if left.fullmatch(other.name):
                        _remove(other)
            fcntl.flock(lock, fcntl.LOCK_SH)
        stack.callback(_remove, temporary)
        yield temporary


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


@contextlib.contextmanager
def temporary_folder(use: str) -> Iterator[Path]:
    """Yield a new folder among the system's temporary files, removed in the end; that of a process of the same `use`
    that was killed is removed first. InputError if another user has taken the name of the folder around it."""
    around = Path(tempfile.gettempdir()) / f"midastouch_{use}_{os.getuid()}"
    around.mkdir(mode=0o700, exist_ok=True)
    if around.lstat().st_uid != os.getuid():
        raise InputError(f"{around}: belongs to another user; set TMPDIR to a folder of your own")
    with temporary_beside(around / use) as folder:
        folder.mkdir()
        yield folder


@contextlib.contextmanager
def atomic_path(path: str | os.PathLike) -> Iterator[Path]:
    """Yield a temporary path next to `path`; rename it to `path` on success, remove it on any failure.

    The temporary name keeps the suffix (writers choose their format by it). Works for files and folders;
    an existing folder at `path` is replaced. An OSError that names no file, or an error that names the
    temporary path, is raised with the name of `path`. What killed processes left is removed, as by `temporary_beside`.
    """
    path = Path(path)
    with temporary_beside(path) as temporary, naming(path), _called(temporary, path):
        yield temporary
        if temporary.is_dir() and path.is_dir():
            shutil.rmtree(path)
        temporary.replace(path)

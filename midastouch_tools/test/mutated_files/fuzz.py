"""Reading of mutated files, each in a forked process: `fuzz.py COUNT SEED FORMAT...` prints the outcomes as JSON.

This process has no threads of its own, unlike that of the tests, so it may fork at any time.
"""

from __future__ import annotations

import argparse
import dataclasses
import hashlib
import json
import multiprocessing
import os
import re
import resource
import signal
import sys
import tempfile
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np
from formats import FORMATS, Format

from midastouch_common.errors import InputError

SECONDS, MEGABYTES = 10, 2048
"""Most that reading may take; seconds of the processor, which a busy machine does not lengthen."""
_RIGHT = "refused", "the same", "other content", "read with a warning"
_BLOCKED = 120  # s
_ADDRESSES = 12 << 30  # bytes; a fault must not take the machine down
_NUMBER = re.compile(rb"-?\d+\.?\d*(?:[eE][-+]?\d+)?")
_NUMBERS = b"nan NaN .nan inf .inf Infinity 0 -1 1e-300 1e300 1e400 0.5 true null x [] {} '' 1e 0x10".split()
_NUMBERS += [b"9" * 20, b"9" * 400]
_INTEGERS = [
    bytes(8),
    b"\xff" * 8,
    b"\xff\xff\xff\x7f",
    b"\xff" * 4,
    b"\x00\x00\x00\x80",
    b"\x00\x00\xc0\x7f",
    b"\x00" * 6 + b"\xf0\x7f",
]


def mutated(content: bytes, rng: np.random.Generator, text: bool) -> bytes:
    """Return the content of a file with one to three faults."""
    for _ in range(rng.integers(1, 4)):
        kinds = [_flipped, _cut_off, _moved_block, _overwritten, _with_an_extreme]
        kinds += [_with_another_number, _with_other_lines, _with_other_lines] if text else []
        if content:
            content = kinds[rng.integers(len(kinds))](content, rng)
    return content


def _flipped(content: bytes, rng: np.random.Generator) -> bytes:
    out = bytearray(content)
    out[rng.integers(len(out))] ^= 1 << int(rng.integers(8))
    return bytes(out)


def _cut_off(content: bytes, rng: np.random.Generator) -> bytes:
    return content[: rng.integers(len(content))]


def _moved_block(content: bytes, rng: np.random.Generator) -> bytes:
    """A block removed, repeated or put elsewhere."""
    begin = int(rng.integers(len(content)))
    end = begin + int(rng.choice([1, 4, 8, 30, 200, 4096]))
    rest = content[:begin] + content[end:]
    at = [None, end, int(rng.integers(len(rest) + 1))][rng.integers(3)]
    if at is None:
        return rest
    return content[:end] + content[begin:] if at == end else rest[:at] + content[begin:end] + rest[at:]


def _overwritten(content: bytes, rng: np.random.Generator) -> bytes:
    begin, length = int(rng.integers(len(content))), int(rng.choice([1, 4, 16, 512, 4096]))
    block = [bytes(length), b"\xff" * length, rng.bytes(length)][rng.integers(3)]
    return content[:begin] + block + content[begin + length :]


def _with_an_extreme(content: bytes, rng: np.random.Generator) -> bytes:
    """Often in the first part, where headers are."""
    value = _INTEGERS[rng.integers(len(_INTEGERS))]
    begin = int(rng.integers(min(len(content), int(rng.choice([64, 1024, len(content)])))))
    return content[:begin] + value + content[begin + len(value) :]


def _with_another_number(content: bytes, rng: np.random.Generator) -> bytes:
    found = list(_NUMBER.finditer(content))
    if not found:
        return content
    span = found[rng.integers(len(found))].span()
    return content[: span[0]] + _NUMBERS[rng.integers(len(_NUMBERS))] + content[span[1] :]


def _with_other_lines(content: bytes, rng: np.random.Generator) -> bytes:
    """A line removed, repeated or exchanged with another one, or two words exchanged, such as keys."""
    parts = re.split(rb"(\n)" if rng.integers(2) else rb"(\W+)", content)
    one, two = 2 * rng.integers((len(parts) + 1) // 2, size=2)
    kind = rng.integers(3)
    if kind == 0:
        del parts[one]
    elif kind == 1:
        parts[one:one] = [parts[one], b"\n"]
    else:
        parts[one], parts[two] = parts[two], parts[one]
    return b"".join(parts)


def digest(value: object) -> str:
    """Return the same text for the same content. Raises AssertionError for numbers that are not finite."""
    out = hashlib.sha256()
    for part in _parts(value):
        out.update(part)
    return out.hexdigest()


def _parts(value: object) -> Iterator[bytes]:
    if isinstance(value, (float, complex, np.number, np.ndarray)) and np.asarray(value).dtype.kind in "biufc":
        array = np.asarray(value)
        assert np.isfinite(array).all(), "not finite"
        yield repr((array.shape, array.dtype.str)).encode() + array.tobytes()
    elif dataclasses.is_dataclass(value):
        yield from _parts([getattr(value, field.name) for field in dataclasses.fields(value)])
    elif isinstance(value, dict):
        yield from _parts([*value, *value.values()])
    elif isinstance(value, (list, tuple)):
        yield b"%d items" % len(value)
        for item in value:
            yield from _parts(item)
    else:
        yield repr(value).encode()


def outcome(work: Callable[[], object], folder: Path) -> str:
    """Return `read` with a digest, `refused`, or what is wrong about `work`, done in a process of its own."""
    receiver, sender = multiprocessing.Pipe(duplex=False)
    child = multiprocessing.get_context("fork").Process(target=_work, args=(work, folder, sender))
    child.start()
    sender.close()
    try:
        said, megabytes = receiver.recv()
    except EOFError:
        child.join()
        return f"died of {signal.Signals(-child.exitcode).name}"  # SIGXCPU after SECONDS
    child.join()
    return said if megabytes <= MEGABYTES else f"took {megabytes} MB: {said}"


def _work(work: Callable[[], object], folder: Path, sender: Connection) -> None:
    resource.setrlimit(resource.RLIMIT_AS, (_ADDRESSES, _ADDRESSES))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS + 1))
    signal.alarm(_BLOCKED)
    os.dup2(os.open(folder.parent / "warnings", os.O_CREAT | os.O_TRUNC | os.O_WRONLY), 2)
    os.dup2(2, 1)
    try:
        said = f"read {digest(work())}"
        sys.stderr.flush()
        said += " with a warning" if os.fstat(2).st_size else ""
    except InputError as error:
        said = "refused" if str(folder) in str(error) and "\n" not in str(error) else f"does not name the file: {error}"
    except BaseException:
        said = traceback.format_exc()
    sender.send((said, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss >> 10))


def search(kind: Format, count: int, seed: int, folder: Path) -> tuple[Counter[str], dict[str, bytes]]:
    """Read `count` mutations of a format; return the outcomes, and the content of a file for each that is wrong."""
    good = folder / "good"
    good.mkdir()
    path = kind.write(good)
    files = sorted(file for file in good.rglob(kind.files) if file.is_file())
    contents = [file.read_bytes() for file in files]
    whole = [outcome(lambda read=read: read(path), good) for read in kind.reads]
    assert all(each.startswith("read ") for each in whole), whole
    found: Counter[str] = Counter()
    wrong: dict[str, bytes] = {}
    rng = np.random.default_rng(seed)
    for _ in range(count):
        chosen = rng.integers(len(files))
        bad = mutated(contents[chosen], rng, kind.text)
        files[chosen].write_bytes(bad)
        for read, expected in zip(kind.reads, whole, strict=True):
            said = outcome(lambda read=read: read(path), good)
            if said == expected:
                said = "the same"
            elif said.endswith(" with a warning"):
                said = "read with a warning"
            elif said.startswith("read "):
                said = "other content" + (", which a checksum excludes" if kind.checked else "")
            found[said] += 1
            if said not in _RIGHT:
                wrong.setdefault(said, f"{files[chosen].name}\n".encode() + bad)
        files[chosen].write_bytes(contents[chosen])
    return found, wrong


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", type=int)
    parser.add_argument("seed", type=int)
    parser.add_argument("formats", nargs="*", default=list(FORMATS))
    parser.add_argument("--keep", help="folder for the files whose outcome is wrong")
    args = parser.parse_args()
    outcomes = {}
    for name in args.formats:
        with tempfile.TemporaryDirectory() as folder:
            outcomes[name], wrong = search(FORMATS[name], args.count, args.seed, Path(folder))
        for i, (said, content) in enumerate(wrong.items() if args.keep else ()):
            Path(args.keep, f"{name}_{args.seed}_{i}").write_bytes(said.encode() + b"\n=====\n" + content)
    json.dump(outcomes, sys.stdout, indent=1)


if __name__ == "__main__":
    main()

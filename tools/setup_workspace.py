"""Make an environment ready: ROS 2 from PyPI wheels, the pinned packages, our messages, our Python packages.

Every target of the Makefile calls it. The variable ROS names the distribution: jazzy, which lives in .venv, or another
one, which gets an environment of its own next to it. Each step that succeeds writes a stamp with a hash of its inputs.
A step whose stamp is right is skipped, so a second call takes a fraction of a second. If a set-up was interrupted while
it installed packages, the next one starts from an empty environment, because the state is unknown; pip's cache makes
that quick. Steps that do not need each other run at the same time.

It uses only the standard library of any Python 3, so that even an old Python can report that 3.10 is needed.
"""

import argparse
import fcntl
import hashlib
import os
import platform
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

from supported_machine import SetupError, check_machine, use_supported_python

ROOT = Path(__file__).resolve().parent.parent
ROS = os.environ.get("ROS", "jazzy")
VENV = ROOT / (".venv" if ROS == "jazzy" else f".venv-{ROS}")
PYTHON = VENV / "bin" / "python"
STAMPS = VENV / ".setup"
UNFINISHED = "unfinished"
"""Stamp of a step that is under way, or was when the set-up was killed."""
LOGS = VENV / "setup"
# Python compiles a module when it is first imported; pip would compile all of them, which takes as long as the rest.
PIP_INSTALL = [PYTHON, "-m", "pip", "--disable-pip-version-check", "install", "--no-compile"]

LOCK = ROOT / "tools" / "requirements" / f"lock_{ROS}.txt"
FIX_EXPORTS = ROOT / "tools" / "ros_wheels" / "fix_exports.py"
INTERFACES = [ROOT / "tools/ros_wheels/tf2_msgs", ROOT / "tools/ros_wheels/vision_msgs", ROOT / "midastouch_msgs"]
PYTHON_ONLY = ROOT / "tools" / "ros_wheels" / "python_only.cmake"
KERNELS = ROOT / "midastouch_kernels"
SHIMS = [ROOT / "tools/ros_wheels/launch", ROOT / "tools/ros_wheels/tf2_ros"]
"""Python parts of ROS that PyPI lacks."""
PACKAGES = sorted(manifest.parent for manifest in ROOT.glob("*/setup.py"))

# Python reads this at every start in the environment. It is the one place for the variables that ROS needs and the
# wheels do not set. Fast DDS is the only middleware among the wheels.
ENVIRONMENT_PTH = """\
import os, sys; os.environ.setdefault("AMENT_PREFIX_PATH", sys.prefix); \
os.environ["RMW_IMPLEMENTATION"] = "rmw_fastrtps_cpp"
"""


def content_hash(paths, *extra):
    """Return the SHA-256 over names and contents of files (folders: all files below), and over extra strings."""
    digest = hashlib.sha256()
    for path in paths:
        files = sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]
        for file in files:
            digest.update(str(file.relative_to(ROOT)).encode() + b"\0")
            digest.update(hashlib.sha256(file.read_bytes()).digest())
    for text in extra:
        digest.update(text.encode() + b"\0")
    return digest.hexdigest()


class Command:
    """A command of a step: its words, variables added to its environment, and the fix to show if it fails."""

    def __init__(self, words, fix, **environment):
        self.words = list(map(str, words))
        self.fix = fix
        self.environment = environment


class Clock:
    """Progress of the steps with the time: one line that a terminal overwrites, otherwise a line every few seconds."""

    _LINE_EVERY_S = 5

    def __init__(self):
        self._start = self._said = time.monotonic()
        self._terminal = sys.stdout.isatty()

    def tick(self, titles):
        now = time.monotonic()
        line = f"{now - self._start:5.0f} s  {'; '.join(titles)} ..."
        if self._terminal:
            print(f"\r\033[K{line[: shutil.get_terminal_size().columns - 1]}", end="", flush=True)
        elif now - self._said >= self._LINE_EVERY_S:
            self._said = now
            print(line, flush=True)

    def say(self, words):
        self._said = time.monotonic()
        clear = "\r\033[K" if self._terminal else ""
        print(f"{clear}{self._said - self._start:5.0f} s  {words}", flush=True)


class Task:
    """A step that is under way, one command after the other; their output goes into its log.

    A command inherits `lock`, which then outlasts this process if that is killed.
    """

    def __init__(self, name, title, commands, lock):
        self.title = title
        self._log = LOGS / f"{name}.log"
        self._commands, self._lock = iter(commands), lock
        self._process = None

    def goes_on(self):
        """Start the next command if the last one has ended; return whether one runs. SetupError if the last failed."""
        if self._process is not None and self._process.poll() is None:
            return True
        if self._process is not None and self._process.returncode:
            tail = self._log.read_bytes()[self._begin :].decode(errors="replace").rstrip().splitlines()[-25:]
            raise SetupError("\n".join(["", *("    " + line for line in tail), "", self._command.fix]))
        self._command = next(self._commands, None)
        if self._command is None:
            return False
        variables = {**os.environ, **self._command.environment}
        # The environment's Python re-executes itself once and marks that here; the mark of another Python must go.
        variables.pop("_ROS_WHEELS_BOOTSTRAP_COMPLETE", None)
        with self._log.open("ab") as log:
            log.write(f"\n$ {' '.join(self._command.words)}\n".encode())
            log.flush()
            self._begin = log.tell()
            self._process = subprocess.Popen(
                self._command.words,
                cwd=str(ROOT),
                env=variables,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                pass_fds=[self._lock.fileno()],
            )
        return True

    def end(self):
        """Terminate the command."""
        if self._process is not None:
            self._process.terminate()
            self._process.wait()


def make_environment():
    yield Command(
        [sys.executable, "-m", "venv", VENV],
        f"{sys.executable} -m venv failed. Is the disk full? Another Python: make PYTHON=python3.12 ...",
    )


def install_dependencies():
    # The lock names every dependency, so pip has nothing to resolve.
    yield Command(
        [*PIP_INSTALL, "--progress-bar", "off", "--no-deps", "--requirement", LOCK],
        "pip could not install the packages. Check the network (behind a proxy set HTTPS_PROXY, with an own "
        "index PIP_INDEX_URL) and the free disk space (2 GB), then run make again.",
        PIP_DEFAULT_TIMEOUT=os.environ.get("PIP_DEFAULT_TIMEOUT", "60"),
        PIP_USER="0",
    )
    site_packages = next(VENV.glob("lib/python3.*/site-packages"))
    (site_packages / "ros_wheels_environment.pth").write_text(ENVIRONMENT_PTH)
    yield Command([PYTHON, FIX_EXPORTS], "tools/ros_wheels/fix_exports.py failed.")


def build_interfaces():
    for source in INTERFACES:
        yield from build_with_cmake(source, f"-DCMAKE_PROJECT_INCLUDE={PYTHON_ONLY}")


def build_kernels():
    yield from build_with_cmake(KERNELS)


def build_with_cmake(source, *options):
    variables = {"AMENT_PREFIX_PATH": str(VENV), "CMAKE_PREFIX_PATH": str(VENV)}
    fix = f"Compiling {source.name} failed. If compiler or cmake have changed, rm -rf {VENV.name} and run make again."
    build = VENV / "build" / source.name
    # A message that was removed from the sources must be removed from the environment as well.
    manifest = build / "install_manifest.txt"
    for installed in manifest.read_text().splitlines() if manifest.exists() else []:
        Path(installed).unlink(missing_ok=True)
    shutil.rmtree(build, ignore_errors=True)
    configure = ["cmake", "-S", source, "-B", build, "-DCMAKE_BUILD_TYPE=Release", "-DBUILD_TESTING=OFF"]
    configure += [f"-DCMAKE_INSTALL_PREFIX={VENV}", f"-DPython3_EXECUTABLE={PYTHON}", *options]
    yield Command(configure, fix, **variables)
    install = ["cmake", "--build", build, "--target", "install", "--parallel", os.cpu_count() or 1]
    yield Command(install, fix, **variables)


def install_packages():
    # First, as a script that has moved to another package would be removed with the former one.
    uninstall = [PYTHON, "-m", "pip", "uninstall", "--yes", *(package.name for package in PACKAGES)]
    yield Command(uninstall, "Removing the former packages of this workspace failed.")
    command = [*PIP_INSTALL, "--no-deps", "--no-build-isolation"]
    command += [argument for package in [*SHIMS, *PACKAGES] for argument in ("--editable", package)]
    yield Command(command, "Installing the packages of this workspace failed.")
    # What colcon would install to share (package.xml, launch, config, ...) is linked, so that it is always current.
    index = VENV / "share" / "ament_index" / "resource_index" / "packages"
    for package in PACKAGES:
        for link, target in (
            (VENV / "share" / package.name, package),
            (index / package.name, package / "resource" / package.name),
        ):
            if link.is_symlink():
                link.unlink()
            link.symlink_to(target)


def remove_unusable_environment():
    """Remove an environment that was moved, has lost its Python, or whose installation was interrupted."""
    if not VENV.exists():
        return
    if not STAMPS.exists():
        raise SetupError(f"{VENV} was not made by this set-up. Move it away or remove it, then run make again.")
    made_for = STAMPS / "environment"
    reason = None
    interrupted = any(is_done(name, UNFINISHED) for name in ("environment", "dependencies"))
    if interrupted or not made_for.exists():
        reason = "an earlier set-up was interrupted"
    elif not PYTHON.exists():
        reason = "its Python is gone"
    elif made_for.read_text() != environment_key():
        reason = "it was made in another folder"
    if reason:
        print(f"{VENV.name} is made again: {reason}")
        shutil.rmtree(VENV)


def leave_environment():
    """Continue in the Python that the environment was made from, if the environment's own was called.

    The environment may have to be removed, and its own Python with it.
    """
    if Path(sys.prefix).resolve() == VENV.resolve():
        os.execv(sys._base_executable, [sys._base_executable, *sys.argv])


def environment_key():
    return content_hash([], str(ROOT))


def check_distribution():
    """Raise SetupError if there are no wheels of the ROS distribution."""
    if not LOCK.exists():
        known = ", ".join(sorted(file.stem.removeprefix("lock_") for file in LOCK.parent.glob("lock_*.txt")))
        raise SetupError(f"ROS={ROS}: there are wheels of these distributions only: {known}. See docs/platforms.md.")


def set_up(lock):
    check_distribution()
    remove_unusable_environment()
    dependencies_key = content_hash([LOCK, FIX_EXPORTS], ENVIRONMENT_PTH)
    described_by = [p / name for p in PACKAGES for name in ("setup.py", "setup.cfg", "package.xml")]
    described_by += [shim / "pyproject.toml" for shim in SHIMS]
    # the steps of a stage do not need each other
    stages = [
        [("environment", environment_key(), make_environment, "virtual environment")],
        [("dependencies", dependencies_key, install_dependencies, f"ROS 2 {ROS.title()} and libraries, about 1 GB")],
        [
            ("interfaces", content_hash([*INTERFACES, PYTHON_ONLY], dependencies_key), build_interfaces, "messages"),
            ("kernels", content_hash([KERNELS], dependencies_key), build_kernels, "compiled inner loops"),
        ],
        # after them: pip reads what is installed, and fails if another step is writing there
        [("packages", content_hash(described_by, dependencies_key), install_packages, "packages of the workspace")],
    ]
    stages = [[step for step in stage if not is_done(*step[:2])] for stage in stages]
    if not any(stages):
        return
    check_machine()
    STAMPS.mkdir(parents=True, exist_ok=True)
    shutil.rmtree(LOGS, ignore_errors=True)
    LOGS.mkdir()
    print(f"Setting up {VENV.name} with Python {platform.python_version()}, details in {LOGS.relative_to(ROOT)}/")
    clock = Clock()
    for stage in stages:
        take(stage, clock, lock)


def take(steps, clock, lock):
    """Take steps at the same time, and stamp each that is done. If one fails, the others are terminated."""
    tasks = {}
    try:
        for name, key, action, title in steps:
            (STAMPS / name).write_text(UNFINISHED)
            tasks[name, key] = Task(name, title, action(), lock)
        while tasks:
            for (name, key), task in list(tasks.items()):
                if not task.goes_on():
                    (STAMPS / name).write_text(key)
                    clock.say(f"{task.title}: done")
                    del tasks[name, key]
            if tasks:
                clock.tick([task.title for task in tasks.values()])
                time.sleep(0.1)
    except BaseException:
        for task in tasks.values():
            task.end()
        clock.say(f"{'; '.join(task.title for task in tasks.values())}: not finished")
        raise


def is_done(name, key):
    stamp = STAMPS / name
    return stamp.exists() and stamp.read_text() == key


def main():
    leave_environment()
    use_supported_python()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    with Path(__file__).open() as lock:
        try:
            # Of two makes at the same time the second waits, then finds everything done.
            fcntl.flock(lock, fcntl.LOCK_EX)
            set_up(lock)
        except SetupError as error:
            print(f"{error}\n", file=sys.stderr)
            return 1
        except KeyboardInterrupt:
            print("Interrupted: run make again to continue.", file=sys.stderr)
            return 130
    return 0


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter).parse_args()
    sys.exit(main())

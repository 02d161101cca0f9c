"""Make .venv ready: ROS 2 from PyPI wheels, the pinned packages, our messages, our Python packages.

Every target of the Makefile calls it. Each step that succeeds writes a stamp with a hash of its inputs. A step whose
stamp is right is skipped, so a second call takes a fraction of a second. A set-up that was interrupted while it
installed packages starts again from an empty environment, because its state is unknown; pip's cache makes that quick.

It uses nothing but the standard library of any Python 3, so that an old Python, too, can report that 3.10 is needed.
"""

import argparse
import contextlib
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
VENV = ROOT / ".venv"
PYTHON = VENV / "bin" / "python"
STAMPS = VENV / ".setup"
RUNNING = STAMPS / "running"
LOG = VENV / "setup.log"
PIP_INSTALL = [PYTHON, "-m", "pip", "--disable-pip-version-check", "install"]

LOCK = ROOT / "tools" / "requirements" / "lock.txt"
FIX_EXPORTS = ROOT / "tools" / "ros_wheels" / "fix_exports.py"
INTERFACES = [ROOT / "tools/ros_wheels/tf2_msgs", ROOT / "tools/ros_wheels/vision_msgs", ROOT / "midastouch_msgs"]
KERNELS = ROOT / "midastouch_kernels"
PACKAGES = sorted(manifest.parent for manifest in ROOT.glob("*/setup.py"))

# Python reads this at every start in the environment. It is the one place for the variables that ROS needs and the
# wheels do not set. Fast DDS is the only middleware among the wheels.
ENVIRONMENT_PTH = """\
import os, sys; os.environ.setdefault("AMENT_PREFIX_PATH", sys.prefix); \
os.environ["RMW_IMPLEMENTATION"] = "rmw_fastrtps_cpp"
"""


def content_hash(paths, *extra):
    """SHA-256 over names and contents of files (folders: all files below), and over extra strings."""
    digest = hashlib.sha256()
    for path in paths:
        files = sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]
        for file in files:
            digest.update(str(file.relative_to(ROOT)).encode() + b"\0")
            digest.update(hashlib.sha256(file.read_bytes()).digest())
    for text in extra:
        digest.update(text.encode() + b"\0")
    return digest.hexdigest()


class Progress:
    """One line per step: with a running clock on a terminal, otherwise written at the start and the end of the step."""

    def __init__(self, title, lock):
        self.lock = lock
        self._title = f"{title:<56}"
        self._start = time.monotonic()
        self._terminal = sys.stdout.isatty()
        print(self._title, end="", flush=True)

    def tick(self):
        if self._terminal:
            print(f"\r{self._title}{self._elapsed()}", end="", flush=True)

    def end(self, note=""):
        print((f"\r{self._title}" if self._terminal else "") + self._elapsed(), note, flush=True)

    def _elapsed(self):
        return f"{time.monotonic() - self._start:5.0f} s"


def run(command, progress, fix, **environment):
    """Run a command and write its output into the log. Raises SetupError with the end of that output and the fix."""
    variables = {**os.environ, **environment}
    # The environment's Python re-executes itself once and marks that here; the mark of another Python must go.
    variables.pop("_ROS_WHEELS_BOOTSTRAP_COMPLETE", None)
    with LOG.open("ab") as log:
        log.write(f"\n$ {' '.join(map(str, command))}\n".encode())
        log.flush()
        begin = log.tell()
        process = subprocess.Popen(
            [str(word) for word in command],
            cwd=str(ROOT),
            env=variables,
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=log,
            # The command inherits the lock, which then outlasts this process if that is killed.
            pass_fds=[progress.lock.fileno()],
        )
        try:
            while process.poll() is None:
                progress.tick()
                with contextlib.suppress(subprocess.TimeoutExpired):
                    process.wait(timeout=1)
        except BaseException:
            process.terminate()
            process.wait()
            raise
    if process.returncode:
        tail = LOG.read_bytes()[begin:].decode(errors="replace").rstrip().splitlines()[-25:]
        raise SetupError("\n".join(["", *("    " + line for line in tail), "", fix]))


def make_environment(progress):
    run(
        [sys.executable, "-m", "venv", VENV],
        progress,
        f"{sys.executable} -m venv failed. Is the disk full? Another Python: make PYTHON=python3.12 ...",
    )


def install_dependencies(progress):
    # The lock names every dependency, so pip has nothing to resolve.
    run(
        [*PIP_INSTALL, "--progress-bar", "off", "--no-deps", "--requirement", LOCK],
        progress,
        "pip could not install the packages. Check the network (behind a proxy set HTTPS_PROXY, with an own "
        "index PIP_INDEX_URL) and the free disk space (2 GB), then run make again.",
        PIP_DEFAULT_TIMEOUT=os.environ.get("PIP_DEFAULT_TIMEOUT", "60"),
        PIP_USER="0",
    )
    site_packages = next(VENV.glob("lib/python3.*/site-packages"))
    (site_packages / "ros_wheels_environment.pth").write_text(ENVIRONMENT_PTH)
    run([PYTHON, FIX_EXPORTS], progress, "tools/ros_wheels/fix_exports.py failed.")


def build_interfaces(progress):
    build_with_cmake(progress, INTERFACES)


def build_kernels(progress):
    build_with_cmake(progress, [KERNELS])


def build_with_cmake(progress, sources):
    variables = {"AMENT_PREFIX_PATH": str(VENV), "CMAKE_PREFIX_PATH": str(VENV)}
    for source in sources:
        fix = f"Compiling {source.name} failed. If the compiler or cmake has changed, rm -rf .venv and run make again."
        build = VENV / "build" / source.name
        # A message that was removed from the sources must be removed from the environment as well.
        manifest = build / "install_manifest.txt"
        for installed in manifest.read_text().splitlines() if manifest.exists() else []:
            Path(installed).unlink(missing_ok=True)
        shutil.rmtree(build, ignore_errors=True)
        configure = ["cmake", "-S", source, "-B", build, "-DCMAKE_BUILD_TYPE=Release", "-DBUILD_TESTING=OFF"]
        configure += [f"-DCMAKE_INSTALL_PREFIX={VENV}", f"-DPython3_EXECUTABLE={PYTHON}"]
        run(configure, progress, fix, **variables)
        install = ["cmake", "--build", build, "--target", "install", "--parallel", os.cpu_count() or 1]
        run(install, progress, fix, **variables)


def install_packages(progress):
    command = [*PIP_INSTALL, "--no-deps", "--no-build-isolation"]
    command += [argument for package in PACKAGES for argument in ("--editable", package)]
    run(command, progress, "Installing the packages of this workspace failed.")
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
    interrupted = RUNNING.exists() and RUNNING.read_text() in ("environment", "dependencies")
    if interrupted or not made_for.exists():
        reason = "an earlier set-up was interrupted"
    elif not PYTHON.exists():
        reason = "its Python is gone"
    elif made_for.read_text() != environment_key():
        reason = "it was made in another folder"
    if reason:
        print(f".venv is made again: {reason}")
        shutil.rmtree(VENV)


def leave_environment():
    """Continue in the Python that the environment was made from, if the environment's own was called.

    The environment may have to be removed, and its own Python with it.
    """
    if Path(sys.prefix).resolve() == VENV.resolve():
        os.execv(sys._base_executable, [sys._base_executable, *sys.argv])


def environment_key():
    return content_hash([], str(ROOT))


def set_up(lock):
    remove_unusable_environment()
    dependencies_key = content_hash([LOCK, FIX_EXPORTS], ENVIRONMENT_PTH)
    described_by = [p / name for p in PACKAGES for name in ("setup.py", "setup.cfg", "package.xml")]
    steps = [
        ("environment", environment_key(), make_environment, "virtual environment"),
        ("dependencies", dependencies_key, install_dependencies, "ROS 2 Jazzy and libraries, about 1 GB"),
        (
            "interfaces",
            content_hash(INTERFACES, dependencies_key),
            build_interfaces,
            "messages: " + ", ".join(source.name for source in INTERFACES),
        ),
        ("kernels", content_hash([KERNELS], dependencies_key), build_kernels, "compiled inner loops"),
        (
            "packages",
            content_hash(described_by, dependencies_key),
            install_packages,
            "packages of the workspace",
        ),
    ]
    todo = [step for step in steps if not is_done(*step[:2])]
    if not todo:
        return
    check_machine()
    STAMPS.mkdir(parents=True, exist_ok=True)
    LOG.write_text("")
    print(f"Setting up .venv with Python {platform.python_version()}, details in {LOG.relative_to(ROOT)}")
    for number, (name, key, action, title) in enumerate(todo, 1):
        progress = Progress(f"[{number}/{len(todo)}] {title}", lock)
        RUNNING.write_text(name)
        (STAMPS / name).unlink(missing_ok=True)
        try:
            action(progress)
        except BaseException:
            progress.end("failed")
            raise
        (STAMPS / name).write_text(key)
        RUNNING.unlink()
        progress.end()


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

"""Make an arm64 Python with our kernels, cross-compiled, that runs on this machine under qemu: out/arm64/python.

It needs Debian with its cross compiler and emulator: sudo apt install g++-aarch64-linux-gnu qemu-user

The Python is Debian's own for arm64, unpacked and not installed; NumPy and the libraries of tests come from the lock.
Nothing outside the folder is changed, so it needs no privileges.
"""

import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

from lock_requirements import ARM64
from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parent.parent
LOCK = ROOT / "tools" / "requirements" / "lock_jazzy.txt"
COMPILER, EMULATOR = "aarch64-linux-gnu-g++", "qemu-aarch64"
DEBIAN = ["python3-minimal", "libpython3-dev", "libstdc++6"]
LIBRARIES = {"numpy", "scipy", "pytest", "iniconfig", "packaging", "pluggy", "Pygments"}
# apt as on an arm64 machine on which nothing is installed, with the sources of this one.
APT = """\
APT::Architecture "arm64";
APT::Architectures {{"arm64";}};
Dir::State "{0}/state";
Dir::State::status "{0}/status";
Dir::Cache "{0}/cache";
"""


class NotHereError(RuntimeError):
    """Error that names what this machine lacks, and how to get it."""


def make(folder: Path) -> Path:
    """Make the Python in a folder that does not exist yet, and return its path.

    Raises NotHereError if this machine cannot do it, and RuntimeError if something fails.
    """
    missing = [program for program in (COMPILER, EMULATOR, "apt-get", "dpkg", "cmake") if not shutil.which(program)]
    if missing:
        raise NotHereError(
            f"no {' and no '.join(missing)}; Debian: sudo apt install g++-aarch64-linux-gnu qemu-user cmake"
        )
    folder.mkdir(parents=True)
    system = unpacked_debian(folder)
    python = folder / "python"
    site = folder / "site"
    kernels = folder / "kernels"
    python.write_text(f"""\
#!/bin/sh
export PYTHONPATH={kernels}/site:{site}:$PYTHONPATH
exec {EMULATOR} -L {system} {system}/usr/bin/python3 "$@"
""")
    python.chmod(0o755)
    version = run([python, "-c", "import sys; print('%d.%d' % sys.version_info[:2])"]).strip()
    install_libraries(version, folder / "requirements.txt", site)
    compile_kernels(python, system, folder / "build", kernels)
    (kernels / "site").symlink_to(kernels / "lib" / f"python{version}" / "site-packages")
    return python


def unpacked_debian(folder: Path) -> Path:
    """Unpack a system that holds only Python, and return its root."""
    for name in ("state/lists/partial", "cache/archives/partial"):
        (folder / "apt" / name).mkdir(parents=True)
    (folder / "apt" / "status").touch()
    settings = folder / "apt" / "apt.conf"
    settings.write_text(APT.format(folder / "apt"))
    try:
        run(["apt-get", "update"], APT_CONFIG=str(settings))
        download = ["apt-get", "install", "--yes", "--download-only", "--no-install-recommends", *DEBIAN]
        run(download, APT_CONFIG=str(settings))
    except RuntimeError as error:
        raise NotHereError(f"apt-get does not find {', '.join(DEBIAN)} for arm64: {error}") from error
    for package in (folder / "apt" / "cache" / "archives").glob("*.deb"):
        run(["dpkg", "-x", package, folder / "system"])
    return folder / "system"


def install_libraries(version: str, requirements: Path, site: Path) -> None:
    """Install the lock's libraries for a Python version on arm64, checked by their hashes."""
    pins = []
    for line in LOCK.read_text().splitlines():
        pin, _, sums = line.partition(" --hash=")
        requirement = Requirement(pin) if sums else None
        here = {"python_version": version, "platform_machine": "aarch64"}
        if requirement is None or requirement.name not in LIBRARIES:
            continue
        # pip would evaluate the markers for the Python that it runs in.
        if requirement.marker is None or requirement.marker.evaluate(here):
            pins.append(f"{requirement.name}{requirement.specifier} --hash={sums}")
    requirements.write_text("\n".join(pins))
    command = [sys.executable, "-m", "pip", "--disable-pip-version-check", "install", "--quiet", "--no-deps"]
    command += ["--only-binary", ":all:", *ARM64, "--python-version", version, "--target", site]
    run([*command, "--require-hashes", "--requirement", requirements])


def compile_kernels(python: Path, system: Path, build: Path, prefix: Path) -> None:
    """Compile and install midastouch_kernels. CMake asks the arm64 Python for its headers and names."""
    here = {
        "AMENT_PREFIX_PATH": sys.prefix,
        "CMAKE_PREFIX_PATH": sys.prefix,
        # ament and nanobind are pure Python there
        "PYTHONPATH": sysconfig.get_paths()["purelib"],
    }
    configure = ["cmake", "-S", ROOT / "midastouch_kernels", "-B", build, "-DCMAKE_BUILD_TYPE=Release"]
    configure += ["-DCMAKE_SYSTEM_NAME=Linux", "-DCMAKE_SYSTEM_PROCESSOR=aarch64", f"-DCMAKE_SYSROOT={system}"]
    configure += [f"-DCMAKE_CXX_COMPILER={COMPILER}", f"-DPython3_EXECUTABLE={python}", "-DBUILD_TESTING=OFF"]
    run([*configure, f"-DCMAKE_INSTALL_PREFIX={prefix}"], **here)
    run(["cmake", "--build", build, "--target", "install", "--parallel", os.cpu_count() or 1], **here)


def run(command: list, **environment: str) -> str:
    """Run a command and return its output; raises RuntimeError with the end of the output if it fails."""
    words = [str(word) for word in command]
    done = subprocess.run(words, env={**os.environ, **environment}, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{' '.join(words)} failed:\n{(done.stdout + done.stderr)[-2000:]}")
    return done.stdout


if __name__ == "__main__":
    folder = ROOT / "out" / "arm64"
    shutil.rmtree(folder, ignore_errors=True)
    try:
        print(make(folder))
    except RuntimeError as error:
        sys.exit(str(error))

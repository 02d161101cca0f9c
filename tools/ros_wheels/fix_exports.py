"""Fix the CMake exports of the ROS wheels so that interface packages can be built against them.

The ``*__rosidl_generator_pyExport.cmake`` files in the wheels name the Python and NumPy headers of the
machine they were built on (``/opt/python/cp*/...``), and CMake refuses a target whose include directory
does not exist. Those headers are found by the generator itself, so any existing directory serves.
"""

import re
import sys
from pathlib import Path

_BUILD_IMAGE_PATH = re.compile(r'/opt/python/cp[^;"]*')
_REPLACEMENT = "${_IMPORT_PREFIX}/include"


def fix_exports(prefix: Path) -> int:
    """Rewrite the exports under ``prefix/share``; idempotent. Returns the number of files changed."""
    changed = 0
    for path in sorted(prefix.glob("share/*/cmake/*Export.cmake")):
        text = path.read_text()
        fixed = _BUILD_IMAGE_PATH.sub(_REPLACEMENT, text)
        if fixed != text:
            path.write_text(fixed)
            changed += 1
    return changed


if __name__ == "__main__":
    print(f"{fix_exports(Path(sys.prefix))} CMake exports fixed")

"""Write the version and the maintainer that pyproject.toml names into every file that repeats them: package.xml, the
citation and the tags of the images.

ROS tools want both in each package.xml; pip and `midastouch --version` read the version from there.

    .venv/bin/python tools/stamp_release.py
"""

import re
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

ROOT = Path(__file__).resolve().parent.parent
_PATTERNS = "*/package.xml", "tools/ros_wheels/*/package.xml", "docker/*.yaml", "docker/Dockerfile", "CITATION.cff"
STAMPED = [path for pattern in _PATTERNS for path in sorted(ROOT.glob(pattern))]


def stamped(text: str, project: str) -> str:
    """Return the text of such a file with the version and the maintainer in the text of a pyproject.toml."""
    version = re.search(r'^version = "(.+)"$', project, flags=re.M)[1]
    name, email = re.search(r'^maintainers = \[{ name = "(.+)", email = "(.+)" }\]$', project, flags=re.M).groups()
    maintainer = f"<maintainer email={quoteattr(email)}>{escape(name)}</maintainer>"
    for pattern, new in (
        (r"<version>.*</version>", f"<version>{version}</version>"),
        (r"<maintainer .*</maintainer>", maintainer),
        (r"(?m)^version: [\d.]+$", f"version: {version}"),
        (r"\bmidastouch:[\d.]+-", f"midastouch:{version}-"),
    ):
        text = re.sub(pattern, lambda _, new=new: new, text)
    return text


if __name__ == "__main__":
    for path in STAMPED:
        path.write_text(stamped(path.read_text(), (ROOT / "pyproject.toml").read_text()))

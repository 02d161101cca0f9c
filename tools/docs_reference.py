"""Hooks of properdocs.yml: pages that are not in docs/, and links to files that are no pages.

The reference has one page for each Python package, with the public names of its modules. mkdocstrings reads the sources
without importing them, so that neither ROS nor PyTorch has to be installed. Of the compiled `midastouch_kernels` it
reads a stub, which nanobind makes of the module that is installed.
"""

import os
import re
import subprocess
import sys
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

import midastouch_kernels

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = sorted(path.parent.name for path in ROOT.glob("*/setup.py"))
KERNELS = "midastouch_kernels"
STUBS = ROOT / "out" / "stubs"
REFERENCE = "reference/{}.md"
COPIED = {"README.md": "index.md", "CONTRIBUTING.md": "contributing.md"}
COPIED |= {f"{package}/README.md": REFERENCE.format(package) for package in [*PACKAGES, KERNELS]}
"""Files outside docs/ that begin a page, and the page."""
_FILE = "file-of-the-clone:"
"""Scheme of links to files of the clone that are no pages, until the address of the page is known."""
_LINK = re.compile(r"\]\((?!https?:|#)([^)#\s]+)(#[^)\s]*)?\)")


def modules(package: str) -> list[str]:
    """Return the public modules of a package, in alphabetical order."""
    if package == KERNELS:
        return [KERNELS]
    folder = ROOT / package
    paths = [path.relative_to(folder).with_suffix("") for path in sorted((folder / package).rglob("*.py"))]
    named = [path.parts[:-1] if path.name == "__init__" else path.parts for path in paths]
    return sorted(".".join(parts) for parts in named if not any(part.startswith("_") for part in parts))


def on_config(config: MkDocsConfig) -> None:
    """Write the stub and tell mkdocstrings where the packages lie."""
    STUBS.mkdir(parents=True, exist_ok=True)
    # the one of its builds that is in use: both cannot be imported
    compiled = midastouch_kernels.render.__module__
    stub = [sys.executable, "-m", "nanobind.stubgen", "-q", "-m", compiled, "-o", STUBS / f"{KERNELS}.pyi"]
    subprocess.run(stub, check=True)
    paths = [*(ROOT / name for name in PACKAGES), STUBS]
    config.plugins["mkdocstrings"].config.handlers["python"]["paths"] = [str(path) for path in paths]


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that begin with a file from outside docs/."""
    for source, page in COPIED.items():
        text = (ROOT / source).read_text()
        if page.startswith("reference/"):
            text += "\n" + "\n".join(f"::: {name}\n" for name in modules(Path(page).stem))
        files.append(File.generated(config, page, content=text))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Make links point to the page of a file, if it has one, and otherwise to the file in the clone."""
    uri = page.file.src_uri
    source = {page: source for source, page in COPIED.items()}.get(uri, f"docs/{uri}")

    def moved(link: re.Match) -> str:
        target = os.path.normpath(Path(source).parent / link[1])
        within = COPIED.get(target, target.removeprefix("docs/") if target.startswith("docs/") else "")
        if within and files.get_file_from_path(within):
            return f"]({os.path.relpath(within, Path(uri).parent)}{link[2] or ''})"
        return f"]({_FILE}{target}{link[2] or ''})"

    return _LINK.sub(moved, markdown)


def on_page_content(html: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Replace the scheme of links to files of the clone by the path from the page to the clone."""
    up = os.path.relpath(ROOT, Path(page.file.abs_dest_path).parent)
    return html.replace(f'="{_FILE}', f'="{up}/')

"""The site of `make docs`: it can be built, its links lead somewhere, and the reference shows what docstrings say."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
SHOWN = {
    "midastouch_filter.filter.ParticleFilter": ["mesh", "codebook", "config", "seed", "clock", "open_gates"],
    "midastouch_perception.pipeline.DepthStage.process": ["image", "background"],
    "midastouch_common.mesh.ObjectMesh.load": ["path"],
    "midastouch_motion.control.controller.Controller.step": ["now"],
    "digit_driver.camera_model.CameraModel.load": ["name_or_path"],
    "midastouch_simulation.slide.simulate_slide": ["mesh", "rng"],
    "midastouch_kernels.render": ["scene", "poses", "penetration", "faces"],
}
"""Qualified names, and some of their parameters."""


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    """The site, built from the sources."""
    pytest.importorskip("properdocs", reason="`make docs` has not been called")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "properdocs", "build", "--quiet", "--site-dir", str(folder)]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    return folder


def shown(page: str, name: str) -> str:
    """What a page shows about a name, without its members."""
    start = page.index(f'id="{name}"')
    return page[start : page.find('class="doc doc-heading"', start + 100)]


@pytest.mark.slow
@pytest.mark.parametrize("name", SHOWN)
def test_the_reference_shows_names_with_their_parameters(site, name):
    page = (site / "reference" / f"{name.split('.')[0]}.html").read_text()
    words = re.sub(r"<[^>]*>", " ", shown(page, name))
    assert [each for each in SHOWN[name] if not re.search(rf"\b{each}\b", words)] == []


@pytest.mark.slow
def test_private_names_and_tests_are_not_shown(site):
    anchors = {
        each for page in site.glob("reference/*.html") for each in re.findall(r'id="([\w.]+)"', page.read_text())
    }
    assert len(anchors) > 1000
    assert [each for each in anchors if "._" in each or ".test" in each] == []


@pytest.mark.slow
def test_links_of_the_site_lead_to_files(site):
    pages = list(site.rglob("*.html"))
    assert len(pages) > 30
    for page in pages:
        for target in re.findall(r'href="(?!https?:)([^"#]+)', page.read_text()):
            # the page for what is not found is written for a server
            assert (page.parent / target).exists() or page.name == "404.html", f"{page.name}: {target}"

from pathlib import Path

import pytest
import yaml

from digit_driver.camera_info import load_intrinsics
from midastouch_common.errors import InputError

CONTENT = {
    "image_width": 240,
    "image_height": 320,
    "camera_name": "digit",
    "camera_matrix": {"rows": 3, "cols": 3, "data": [277.0, 0, 120, 0, 277.0, 160, 0, 0, 1]},
    "distortion_model": "plumb_bob",
    "distortion_coefficients": {"rows": 1, "cols": 5, "data": [0.1, 0, 0, 0, 0]},
    "rectification_matrix": {"rows": 3, "cols": 3, "data": [1, 0, 0, 0, 1, 0, 0, 0, 1]},
    "projection_matrix": {"rows": 3, "cols": 4, "data": [277.0, 0, 120, 0, 0, 277.0, 160, 0, 0, 0, 1, 0]},
}


@pytest.mark.parametrize("scheme", ["", "file://"])
def test_reads_what_ros_tools_write(tmp_path: Path, scheme) -> None:
    path = tmp_path / "my calibration.yaml"
    path.write_text(yaml.safe_dump(CONTENT))
    intrinsics = load_intrinsics(f"{scheme}{path}", (240, 320))
    assert intrinsics.k[:3] == (277.0, 0.0, 120.0)
    assert intrinsics.d[0] == 0.1
    assert len(intrinsics.p) == 12


@pytest.mark.parametrize(
    ("content", "url", "words"),
    [
        ("[1, 2", "{}", "c.yaml"),
        ("just a string", "{}", "camera_info_manager"),
        (yaml.safe_dump({**CONTENT, "camera_matrix": {"data": [1, 2]}}), "{}", "instead of 9"),
        (yaml.safe_dump({**CONTENT, "image_width": 640}), "{}", "640x320 images.*240x320"),
        (yaml.safe_dump({**CONTENT, "camera_matrix": {"data": [float("nan")] * 9}}), "{}", "not finite"),
        (yaml.safe_dump({**CONTENT, "image_width": float("inf")}), "{}", "infinity"),
        ("!!python/object/apply:os.system ['true']", "{}", "python/object"),
        ("", "/nowhere/absent.yaml", r"absent\.yaml"),
        ("", "http://somewhere/c.yaml", "file://"),
    ],
)
def test_bad_files_are_refused_with_a_reason(tmp_path: Path, content, url, words) -> None:
    path = tmp_path / "c.yaml"
    path.write_text(content)
    with pytest.raises(InputError, match=rf"camera_info_url: [\s\S]*{words}"):
        load_intrinsics(url.format(path), (240, 320))

import cv2
import numpy as np
import pytest

from midastouch_benchmark.perception.press_quality import measure_presses
from midastouch_benchmark.report.results_page import write_results_page
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn import load_tdn
from midastouch_tools.datasets.ball_presses import load_ball_presses
from midastouch_tools.result_file import to_json


@pytest.fixture
def result(tmp_path) -> dict:
    """What `evaluate-perception presses` says of a blob painted in three colours."""
    folder = tmp_path / "presses"
    folder.mkdir()
    rows, columns = np.mgrid[:320, :240]
    free = np.full((320, 240, 3), 100, np.uint8)
    cv2.imwrite(str(folder / "background.png"), free)
    for i in range(3):
        bump = np.exp(-((rows - 160 - 9 * i) ** 2 + (columns - 120) ** 2) / 900.0)
        change = np.stack([bump * (columns - 120), bump * (160 + 9 * i - rows), bump * 15], axis=-1)
        cv2.imwrite(str(folder / f"{i}.png"), np.clip(free + 3 * change, 0, 255).astype(np.uint8))
    tdn = load_tdn("fast", SensorModel.load("digit_real"))
    presses, summary = measure_presses(tdn, load_ball_presses(folder), 4e-3)
    content = {"folder": str(folder), "ball_diameter": 8e-3, "px_per_mm": 18.7, "sensor": "digit_real"}
    network = {"tdn": "fast", "network": tdn.network_id}
    return to_json({**content, **network, "presses": presses, "summary": summary})


def write(result, folder) -> str:
    return write_results_page([("presses.json", result)], folder).read_text()


def test_the_section_shows_presses(result, tmp_path):
    content = write(result, tmp_path)
    assert result["network"] in content
    picture = "evaluate_perception_presses_0.png"
    assert f'src="{picture}"' in content
    assert (tmp_path / picture).stat().st_size > 5000


def test_without_images_or_with_another_network_it_says_so(result, tmp_path):
    assert "network is now" in write({**result, "network": "tdn_fast-old"}, tmp_path)
    content = write({**result, "folder": "/nowhere"}, tmp_path)
    assert "no pictures of the presses: /nowhere" in content
    assert "presses_0.png" not in content

"""Parameters at the start and at run time, over real DDS."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from digit_driver.nodes.parameters import PARAMETERS
from midastouch_common.errors import InputError

pytestmark = pytest.mark.dds
README = Path(__file__).parents[2] / "README.md"


def test_simulated_time_is_refused_while_it_runs(graph, start, camera) -> None:
    start()
    refused, taken = graph.set_parameters("/digit_test/digit_driver", use_sim_time=True, jpeg_quality=80)
    assert not refused.successful
    assert re.search("use_sim_time.*midastouch replay", refused.reason)
    assert taken.successful


@pytest.mark.parametrize(
    ("parameters", "reason"),
    [
        ({"resolution": "HD"}, "resolution.*QVGA, VGA"),
        ({"fps": 61}, "fps.*60 or 30"),
        ({"camera_model": "none.yaml"}, "none.yaml: no such camera model file"),
        ({"resolution": "VGA", "fps": 60}, "fps.*30 or 15"),
        ({"use_sim_time": True}, "use_sim_time.*midastouch replay"),
        ({"serial": "../../etc"}, "serial '../../etc': not a serial number"),
        ({"camera_info_url": "/nowhere.yaml"}, "camera_info_url: /nowhere.yaml"),
    ],
)
def test_bad_parameters_stop_the_start_with_a_reason(start, parameters, reason) -> None:
    with pytest.raises(InputError, match=reason):
        start(**parameters)


def test_intensity_reaches_the_leds_at_run_time(graph, start, camera) -> None:
    start(intensity=15, intensity_rgb=[15, 0, 0])
    results = graph.set_parameters("/digit_test/digit_driver", intensity_rgb=[0, 15, 15], intensity=5)
    assert all(result.successful for result in results)
    assert camera.led_values == [0xF00, 0x0FF, 0x055]


def test_readme_tables_equal_the_node() -> None:
    rows = dict(re.findall(r"^\| `([^`]+)` \| `?([^|`]+)`? \|", README.read_text(), re.MULTILINE))
    for parameter in PARAMETERS:
        shown = rows.pop(parameter.name)
        default = parameter.default
        expected = str(default).lower() if isinstance(default, bool) else str(default) or "''"
        assert shown == expected, parameter.name
    assert {name: kind.strip() for name, kind in rows.items()} == {
        "image_raw": "sensor_msgs/Image",
        "image_raw/compressed": "sensor_msgs/CompressedImage",
        "camera_info": "sensor_msgs/CameraInfo",
        "/diagnostics": "diagnostic_msgs/DiagnosticArray",
        "set_capture": "std_srvs/SetBool",
    }

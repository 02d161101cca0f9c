import re

import pytest

from midastouch_bringup.ros.launch_parameters import parameters
from midastouch_common.errors import InputError


@pytest.mark.parametrize(
    ("argument", "value", "expected"),
    [
        ("rate", "fast", "a number"),
        ("rate", "nan", "a number"),
        ("rate", "inf", "a number"),
        ("seed", "1.5", "a whole number"),
        ("seed", "[1]", "a whole number"),
        ("seed", "[", "a whole number"),
        ("seed", "1e3", "a whole number"),
        ("loop", "[", "true or false"),
        ("loop", "1", "true or false"),
    ],
)
def test_values_of_the_wrong_type_are_refused(argument, value, expected):
    with pytest.raises(InputError, match=f"{re.escape(f'{argument}:={value}')}.*{expected}"):
        parameters({argument: value})


@pytest.mark.parametrize(
    ("argument", "value", "node", "meant"),
    [
        ("rate", "1e3", "replay", 1000.0),
        ("rate", "2", "replay", 2.0),
        ("rate", ".5", "replay", 0.5),
        ("seed", "7", "particle_filter", 7),
        ("loop", "true", "replay", True),
        ("loop", "false", "replay", False),
    ],
)
def test_values_are_read_as_their_type(argument, value, node, meant):
    found = parameters({argument: value})[node][argument]
    assert (type(found), found) == (type(meant), meant)


def test_what_an_overlay_has_for_every_node_is_laid_over_the_files_before(tmp_path):
    setup, overlay = tmp_path / "setup.yaml", tmp_path / "overlay.yaml"
    setup.write_text("contact_controller: {ros__parameters: {max_force: 8.0, speed: 0.01}}\n")
    overlay.write_text(
        "/**: {ros__parameters: {max_force: 5.0, base_frame_id: arm}}\n"
        "explorer: {ros__parameters: {base_frame_id: own}}\n"
    )
    found = parameters({"setup_file": str(setup), "params_overlay": str(overlay)})
    assert (found["contact_controller"]["max_force"], found["contact_controller"]["speed"]) == (5.0, 0.01)
    assert [found[node]["base_frame_id"] for node in ("contact_controller", "explorer", "**")] == ["arm", "own", "arm"]

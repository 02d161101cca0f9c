import pytest

from midastouch_common.names import require_name


@pytest.mark.parametrize(
    ("kind", "names"),
    [
        ("namespace", ["/", "left", "/left", "robot/left/", "a_1/_b"]),
        ("topic", ["image_raw", "/image_raw", "/left/image_raw", "/a_1/_b"]),
        ("frame", ["tool0", "left_tool0", "/base", "ur5e/tool-0", "wrist.3"]),
        ("serial number", ["D20123", "28G1-AB_3.4"]),
    ],
)
def test_usual_names_are_taken(kind, names):
    assert [require_name(kind, name, "a") for name in names] == names

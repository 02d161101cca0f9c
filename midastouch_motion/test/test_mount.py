from pathlib import Path

import numpy as np
import pytest
import yaml

from midastouch_common.errors import InputError
from midastouch_motion.mount import read_mount

SHIPPED = Path(__file__).parents[2] / "midastouch_bringup/config" / "frames.yaml"


def test_the_shipped_file_is_read_entry_by_entry():
    entries = yaml.safe_load(SHIPPED.read_text())
    mount = read_mount(SHIPPED)
    assert [(parent, child) for parent, child, _ in mount] == [
        ("tool0", "digit_link"),
        ("digit_link", "digit_gel_frame"),
        ("digit_link", "digit_optical_frame"),
    ]
    for (_, _, transform), entry in zip(mount, entries.values(), strict=True):
        np.testing.assert_array_equal(transform[:3, 3], entry["xyz"])
    # half a turn about x: y and z look the other way
    np.testing.assert_allclose(mount[1][2][:3, :3], np.diag([1.0, -1.0, -1.0]), atol=1e-15)


def test_angles_turn_about_the_fixed_axes_of_the_parent(tmp_path):
    entries = yaml.safe_load(SHIPPED.read_text())
    entries["hand_eye"]["rpy"] = [np.pi / 2, 0.0, np.pi / 2]
    path = tmp_path / "frames.yaml"
    path.write_text(yaml.safe_dump(entries))
    rotation = read_mount(path)[0][2][:3, :3]
    # y of the child: after the turn about x it is the parent's z, which the turn about z leaves alone
    np.testing.assert_allclose(rotation @ [0, 1, 0], [0, 0, 1], atol=1e-15)


def changed(name, **values):
    entries = yaml.safe_load(SHIPPED.read_text())
    entries[name].update(values)
    return yaml.safe_dump(entries)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("a: [", "not YAML"),
        ("- 1", "must hold hand_eye, gel, optical"),
        ("hand_eye: {}", "must hold hand_eye, gel, optical"),
        ("{hand_eye: {}, gel: {}, optical: {}}", "hand_eye: 'parent'"),
        ("{hand_eye: 3, gel: {}, optical: {}}", "hand_eye: .*wanted are parent"),
        (changed("gel", xyz=[0.0, 0.0]), "gel: xyz and rpy are three finite numbers"),
        (changed("gel", rpy=[0.0, float("nan"), 0.0]), "gel: xyz and rpy are three finite numbers"),
        (changed("optical", xyz="far"), "optical: "),
    ],
)
def test_a_file_that_does_not_say_where_the_sensor_is(tmp_path, text, reason):
    path = tmp_path / "frames.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=f"frames.yaml: {reason}"):
        read_mount(path)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(InputError, match=r"nothing\.yaml: no such frames file"):
        read_mount(tmp_path / "nothing.yaml")

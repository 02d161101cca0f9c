import pytest
import rclpy
import yaml

from midastouch_bringup.parameter_files import merged, read_parameters, written
from midastouch_common.errors import InputError


@pytest.fixture
def file(tmp_path):
    def write(text):
        path = tmp_path / "parameters.yaml"
        path.write_text(text)
        return path

    return write


def test_nested_names_are_joined_by_dots(file):
    path = file("/filter:\n  ros__parameters:\n    start: {x: 1.0, spread: {t: 0.1}}\n    seed: 3\n")
    assert read_parameters(path) == {"filter": {"start.x": 1.0, "start.spread.t": 0.1, "seed": 3}}


def test_later_layers_win():
    layers = [{"a": {"x": 1, "y": 2}}, {"a": {"y": 3}, "b": {"z": 4}}]
    assert merged(layers) == {"a": {"x": 1, "y": 3}, "b": {"z": 4}}
    assert layers[0] == {"a": {"x": 1, "y": 2}}


@pytest.mark.parametrize(
    ("namespace", "key"), [("", "/tdn"), ("/", "/tdn"), ("left", "/left/tdn"), ("/arm/left/", "/arm/left/tdn")]
)
def test_written_keys_are_full_names(namespace, key):
    assert yaml.safe_load(written({"tdn": {"serial": "20025"}}, namespace)) == {
        key: {"ros__parameters": {"serial": "20025"}}
    }


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("- a\n", "holds no nodes"),
        ("a: [\n", "not YAML"),
        ("tdn: {queue_depth: 1}\n", "node 'tdn' must hold ros__parameters"),
        ("tdn:\n  ros__parameters: {}\n  ros_parameters: {a: 1}\n", "nothing else"),
        ("tdn:\n", "node 'tdn'"),
    ],
)
def test_bad_files_are_named_with_what_is_wrong(file, text, message):
    path = file(text)
    with pytest.raises(InputError, match=message) as caught:
        read_parameters(path)
    assert str(path) in str(caught.value)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match=r"none\.yaml: no such parameter file"):
        read_parameters(tmp_path / "none.yaml")


@pytest.mark.parametrize("serial", ["20123E45", "1e5", "20025", "nan", "1_000", "y", "0x1p3"])
def test_text_that_looks_like_something_else_stays_text(serial):
    line = next(line for line in written({"tdn": {"serial": serial}}, "").splitlines() if "serial" in line)
    assert line.strip() == f"'serial': '{serial}'"


def test_a_list_of_two_nodes_is_written_twice(tmp_path):
    """As rcl reads it, which knows no aliases."""
    corner = [0.2, -0.3, 0.0]
    path = tmp_path / "parameters.yaml"
    path.write_text(written({"contact_controller": {"box_low": corner}, "explorer": {"reach_low": corner}}, ""))
    context = rclpy.Context()
    context.init(args=["--ros-args", "--params-file", str(path)])
    try:
        for node, name in (("contact_controller", "box_low"), ("explorer", "reach_low")):
            found = rclpy.create_node(node, context=context, automatically_declare_parameters_from_overrides=True)
            assert list(found.get_parameter(name).value) == corner
            found.destroy_node()
    finally:
        context.shutdown()

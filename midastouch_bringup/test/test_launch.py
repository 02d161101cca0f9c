"""What the launch files start, by their arguments."""

from pathlib import Path

import pytest
from fake_launch import (
    FILES,
    OURS,
    Command,
    Launched,
    executables_of_setup_py,
)
from launch_rig import AN_ARM, BOX, carry_out, given_to, names, own_parameters, parameters


@pytest.mark.usefixtures("stand_ins")
def test_live_starts_the_chain_and_no_arm_unless_asked():
    chain = {"digit_driver", "tdn", "tcn", "particle_filter", "robot_state_publisher", "rviz2"}
    assert names(carry_out("live_ur")) == chain
    assert names(carry_out("live_ur", use_rviz="false", **AN_ARM)) == chain - {"rviz2"} | {"ur_tf"}
    driver = carry_out("live_ur", arm="ur_driver", robot_ip="10.0.0.7", ur_type="ur10e")
    assert names(driver) == chain | {"launch/ur_control.launch.py"}
    arguments = driver["ur_robot_driver", "launch/ur_control.launch.py"]
    assert arguments["robot_ip"] == "10.0.0.7"
    assert arguments["ur_type"] == "ur10e"
    assert arguments["launch_rviz"] == "false"


ARMS = {"live_ur": ["running", "rtde"], "explore_ur": ["running", "rtde"], "explore": ["finger", "mujoco"]}


@pytest.mark.usefixtures("stand_ins")
@pytest.mark.parametrize("composed", ["true", "false"])
@pytest.mark.parametrize(
    ("name", "arm"), [(name, arm) for name in FILES if name != "rviz" for arm in ARMS.get(name, ["running"])]
)
def test_run_starts_what_the_launch_file_starts(name, composed, arm, tmp_path, monkeypatch):
    """The same processes, and each of their nodes with the same parameters."""
    from midastouch_bringup.ros.launch_parameters import explored
    from midastouch_bringup.ros.launch_parameters import parameters as of_run
    from midastouch_bringup.ros.setups import SETUPS, executables

    monkeypatch.chdir(tmp_path)
    (tmp_path / "background.png").touch()
    setup = SETUPS[name]
    some = {
        "robot_ip": "the.arm",
        "serial": "20025",
        "sensor_model": "gelsight_mini",
        "object": "ball",
        "seed": "7",
        "tf_prefix": "a_",
        "sensor_prefix": "b_",
        "namespace": "left",
        "autostart": "true",
        "preset": "fast",
        "fingers": "/right:right_digit_gel_frame",
        "bag": str(tmp_path),
        "rate": "0",
        "init_mode": "wait",
        "use_respawn": "true",
        "log_level": "warn",
    }
    given = setup.values() | some | given_to(name) | {"composed": composed, "arm": arm}
    given = {key: value for key, value in given.items() if key in setup.arguments}
    started = carry_out(name, **given)
    # PyPI has neither: a node of ours has the same TF, and midastouch view shows the same
    instead = {"robot_state_publisher": {("midastouch_motion", "mount_tf")}, "rviz2": set()}
    expected = set().union(*(instead.get(one[1], {one}) for one in started))
    ran = {(one.package, one.name): one for one in executables(name, given)}
    assert ran.keys() == expected
    assert ran.keys() <= executables_of_setup_py()
    if name == "explore":
        given |= explored(given)
    if name == "demo":
        given["bag"] = "out/slides/ball"
    meant = of_run(given)
    for key in ran.keys() & started.keys():
        found, kwargs = parameters(started[key]), started[key]
        nodes = ("tdn", "tcn", "particle_filter") if key[1] == "all_in_one" else (key[1],)
        assert {node: found.get(f"/left/{node}", {}) for node in nodes} == {node: meant.get(node, {}) for node in nodes}
        assert kwargs["namespace"] == "left"
        assert kwargs["arguments"][-1] == "warn"
        assert kwargs["respawn"] != ran[key].ends


@pytest.mark.usefixtures("stand_ins")
def test_composed_runs_perception_and_filter_in_one_process():
    started = names(carry_out("replay", composed="true", bag="x"))
    assert "all_in_one" in started
    assert not {"tdn", "tcn", "particle_filter"} & started


@pytest.mark.usefixtures("stand_ins")
def test_arguments_become_parameters_only_when_given():
    plain = parameters(carry_out("live_ur")["digit_driver", "digit_driver"])
    assert plain["/digit_driver"]["serial"] == ""
    given = carry_out(
        "live_ur", serial="20025", seed="7", init_mode="wait", preset="fast", mesh="a.ply", codebook="a.npz"
    )
    assert parameters(given["digit_driver", "digit_driver"])["/digit_driver"]["serial"] == "20025"
    assert parameters(given["midastouch_perception", "tdn"])["/tdn"]["serial"] == "20025"
    filter_ = parameters(given["midastouch_filter", "particle_filter"])["/particle_filter"]
    assert (filter_["seed"], filter_["init_mode"], filter_["preset"]) == (7, "wait", "fast")
    assert (filter_["mesh"], filter_["codebook"]) == ("a.ply", "a.npz")


@pytest.mark.usefixtures("stand_ins")
def test_an_object_by_name_gives_mesh_and_codebook():
    from midastouch_perception.objects import bundled_objects

    started = carry_out("filter", object="handle_tool")
    values = parameters(started["midastouch_filter", "particle_filter"])["/particle_filter"]
    assert values["mesh"] == str(bundled_objects()["handle_tool"])
    assert values["codebook"].endswith("out/codebooks/handle_tool.npz")
    values = parameters(carry_out("live_ur", object="handle_tool")["midastouch_filter", "particle_filter"])
    assert values["/particle_filter"]["codebook"].endswith("out/codebooks/handle_tool_digit_real.npz")


@pytest.mark.usefixtures("stand_ins")
def test_objects_by_name_are_their_meshes_until_they_have_codebooks(tmp_path, monkeypatch):
    from midastouch_perception.objects import bundled_objects

    monkeypatch.chdir(tmp_path)
    book = tmp_path / "out/codebooks/eyebolt.npz"
    book.parent.mkdir(parents=True)
    book.touch()
    started = carry_out("filter", objects="handle_tool, eyebolt,/data/cup.npz")
    values = parameters(started["midastouch_filter", "particle_filter"])["/particle_filter"]
    assert values["objects"] == f"{bundled_objects()['handle_tool']},{book},/data/cup.npz"
    assert values["mesh"] == values["codebook"] == ""


@pytest.mark.usefixtures("stand_ins")
def test_namespace_and_prefixes_reach_every_node():
    started = carry_out("live_ur", namespace="left", sensor_prefix="left_", tf_prefix="a_", **AN_ARM)
    for (package, executable), kwargs in started.items():
        if package in OURS:
            assert kwargs["namespace"] == "left"
            assert f"/left/{executable}" in parameters(kwargs)
    values = {one: parameters(kw)[f"/left/{one}"] for (package, one), kw in started.items() if package in OURS}
    assert values["particle_filter"]["sensor_frame_id"] == "left_digit_gel_frame"
    assert values["particle_filter"]["base_frame_id"] == "a_base_link"
    assert values["tdn"]["sensor_frame_id"] == "left_digit_gel_frame"
    assert values["digit_driver"]["frame_id"] == "left_digit_optical_frame"
    assert values["ur_tf"]["tf_prefix"] == "a_"
    mount = started["robot_state_publisher", "robot_state_publisher"]["parameters"][0]["robot_description"]
    command = mount.args[0].perform({"frames_file": "f", "tool_frame": "", "tf_prefix": "a_", "sensor_prefix": "b_"})
    assert command.endswith("/f tool_frame:= tf_prefix:=a_ prefix:=b_")


@pytest.mark.usefixtures("stand_ins")
def test_a_recording_is_played_without_loss_in_its_own_time():
    started = carry_out("replay", bag="slide", rate="0", loop="true")
    values = own_parameters(started)
    assert values["replay"]["source"] == "slide"
    assert values["replay"]["rate"] == 0.0
    assert isinstance(values["replay"]["rate"], float)
    assert values["replay"]["loop"] is True
    assert values["replay"]["clock"] is True
    assert values["replay"]["ack_topic"] == "filter_status"
    for node in ("tdn", "tcn", "particle_filter"):
        assert values[node]["use_sim_time"] is True
        assert values[node]["reliable"] is True
        assert values[node]["queue_depth"] > 1


@pytest.mark.usefixtures("stand_ins")
@pytest.mark.parametrize(
    ("inside", "used"),
    [
        (["background.png", "tactile_images"], "background.png"),
        (["tactile_images"], "tactile_images"),
        (["frames"], "frames"),
        ([], ""),
    ],
)
def test_a_sequence_brings_its_background(tmp_path, inside, used):
    for name in inside:
        (tmp_path / name).mkdir()
    values = own_parameters(carry_out("replay", bag=str(tmp_path)))
    assert values["tdn"]["background"] == (str(tmp_path / used) if used else "")
    given = own_parameters(carry_out("replay", bag=str(tmp_path), background="mine.png"))
    assert given["tdn"]["background"] == "mine.png"


@pytest.mark.usefixtures("stand_ins")
def test_the_demo_has_midastouch_make_what_is_missing_then_plays_it():
    from midastouch_tools.cli import build_parser

    launched = Launched()
    launched.carry_out("demo", object="eyebolt", use_rviz="false")
    assert launched.ran == [["run", "demo", "object:=eyebolt", "--prepare"]]
    assert build_parser().parse_args(launched.ran[0]).prepare
    values = own_parameters(launched.started)
    assert values["replay"]["source"] == "out/slides/eyebolt"
    assert values["particle_filter"]["codebook"] == str(Path("out/codebooks/eyebolt.npz").resolve())


@pytest.mark.usefixtures("stand_ins")
@pytest.mark.parametrize(
    ("given", "mesh", "codebook"),
    [
        ({"object": "eyebolt"}, "eyebolt.ply", "out/cache/codebooks/eyebolt_10000.npz"),
        ({"mesh": "/data/cup.ply"}, "/data/cup.ply", "out/cache/codebooks/cup_10000.npz"),
        ({"mesh": "/data/cup.ply", "codebook": "/data/cup.npz"}, "/data/cup.ply", "/data/cup.npz"),
    ],
    ids=["bundled", "mesh", "codebook"],
)
def test_an_exploration_gives_all_nodes_one_object(given, mesh, codebook):
    launched = Launched()
    started = launched.carry_out("explore", use_rviz="false", **given, objects="")
    assert [words[:2] + words[-1:] for words in launched.ran] == [["run", "explore", "--prepare"]]
    assert names(started) == {"digit_sim", "tdn", "tcn", "particle_filter", "simulated_finger", "explorer"}
    own = own_parameters(started)
    meshes = {Path(own[node]["mesh"]).name for node in ("digit_sim", "simulated_finger", "explorer", "particle_filter")}
    assert meshes == {Path(mesh).name}
    assert own["particle_filter"]["codebook"] == str(Path(codebook).resolve())
    assert own["tdn"]["reliable"]


@pytest.mark.usefixtures("stand_ins")
def test_an_arm_that_explores_keeps_to_its_box_and_waits_to_be_let_go(tmp_path):
    assert "ur_speed" not in names(carry_out("explore_ur", **BOX))
    started = carry_out("explore_ur", mesh="a.ply", tf_prefix="a_", sensor_prefix="b_", **AN_ARM, **BOX)
    assert {"ur_tf", "ur_speed", "contact_controller", "recorder", "explorer"} < names(started)
    own = own_parameters(started)
    assert own["explorer"]["start_paused"] is True
    assert own["explorer"]["reach_low"] == own["contact_controller"]["box_low"] == [0.2, -0.3, 0.0]
    assert own["explorer"]["reach_high"] == own["contact_controller"]["box_high"]
    assert own["explorer"]["max_tilt"] == own["contact_controller"]["max_tilt"] == 0.87
    assert own["contact_controller"]["sensor_model"] == own["tdn"]["sensor_model"]
    assert own["ur_speed"]["robot_ip"] == own["ur_tf"]["robot_ip"] == "the.arm"
    assert own["ur_speed"]["tool_frame_id"] == "a_tool0"
    assert own["ur_speed"]["tcp_offset"] == own["ur_tf"]["tcp_offset"]
    for node in ("ur_speed", "contact_controller", "explorer"):
        assert own[node]["sensor_frame_id"] == "b_digit_gel_frame"
    nearer = tmp_path / "mine.yaml"
    nearer.write_text(
        Path(BOX["params_overlay"]).read_text() + "explorer: {ros__parameters: {reach_low: [0.3, -0.1, 0.1]}}"
    )
    own = own_parameters(carry_out("explore_ur", params_overlay=str(nearer)))
    assert own["explorer"]["reach_low"] == [0.3, -0.1, 0.1]


@pytest.mark.usefixtures("stand_ins")
def test_live_sensors_keep_wall_time():
    values = own_parameters(carry_out("live_ur", **AN_ARM))
    assert values["particle_filter"]["use_sim_time"] is False
    assert not values["digit_driver"].get("use_sim_time", False)
    assert not values["ur_tf"].get("use_sim_time", False)


@pytest.mark.usefixtures("stand_ins")
def test_respawn_and_log_level():
    kwargs = carry_out("driver", use_respawn="true", log_level="debug")["digit_driver", "digit_driver"]
    assert kwargs["respawn"] is True
    assert kwargs["arguments"] == ["--ros-args", "--log-level", "debug"]
    assert carry_out("driver")["digit_driver", "digit_driver"]["respawn"] is False
    # a recording that has ended has not died
    assert carry_out("replay", use_respawn="true")["midastouch_tools", "replay"]["respawn"] is False


@pytest.mark.usefixtures("stand_ins")
def test_lifecycle_nodes_are_launched_as_such():
    launched = Launched()
    launched.carry_out("live_ur", namespace="left", **AN_ARM)
    lifecycle = {name for name, kind in launched.kinds.items() if kind == "LifecycleNode"}
    assert lifecycle == {"digit_driver", "tdn", "tcn", "particle_filter"}
    for (_, executable), kwargs in launched.started.items():
        if executable in lifecycle:
            assert (kwargs["name"], kwargs["namespace"]) == (executable, "left")
    # a name given to that process would be the name of all its nodes
    launched.carry_out("localization", composed="true")
    assert launched.kinds["all_in_one"] == "Node"


@pytest.mark.usefixtures("stand_ins")
def test_a_live_sensor_is_a_real_one_unless_it_is_said_otherwise():
    def sensors(name, **given):
        found = own_parameters(carry_out(name, **given))
        return {found[node].get("sensor_model") for node in ("tdn", "tcn", "particle_filter")}

    assert sensors("live_ur") == {"digit_real"}
    assert sensors("live_ur", sensor_model="gelsight_mini") == {"gelsight_mini"}
    assert sensors("replay", bag="x", sensor_model="digit_real") == {"digit_real"}
    assert sensors("replay", bag="x") == {None}  # what is simulated: the nodes' default


@pytest.mark.usefixtures("stand_ins")
def test_an_overlay_lies_over_what_the_launch_file_changes(tmp_path):
    overlay = tmp_path / "mine.yaml"
    overlay.write_text("tdn: {ros__parameters: {queue_depth: 7}}")
    given = parameters(carry_out("replay", bag="x", params_overlay=str(overlay))["midastouch_perception", "tdn"])
    assert given["/tdn"]["queue_depth"] == 7
    assert given["/tdn"]["reliable"] is True


@pytest.mark.usefixtures("stand_ins")
def test_a_frames_file_is_found_from_where_the_launch_is_started(tmp_path, monkeypatch):
    lines = []
    monkeypatch.setattr(Command, "ran", staticmethod(lambda line: lines.append(line) or "<robot/>"))
    monkeypatch.chdir(tmp_path)
    carry_out("live_ur", frames_file="mine.yaml")
    assert f"frames_file:={tmp_path}/mine.yaml" in lines[0]
    carry_out("live_ur", frames_file="/etc/frames.yaml")
    assert "frames_file:=/etc/frames.yaml" in lines[-1]

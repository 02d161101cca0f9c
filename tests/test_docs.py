"""What the documents say, against the code and the reports: commands, launch files, topics, links, figures, ..."""

import argparse
import ast
import importlib.metadata
import importlib.util
import re
import shlex
import sys
from pathlib import Path

import pytest
import yaml
from rclpy.action import get_action_server_names_and_types_by_node

from midastouch_bringup.cli import add_commands, build_parser

sys.path.insert(0, str(Path(__file__).parent))

from every_node import make_node

ROOT = Path(__file__).resolve().parent.parent
DOCUMENTS = {
    path.relative_to(ROOT).as_posix(): path.read_text()
    for path in sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("*/README.md")])
    if path.name != "CHANGELOG.md"  # which also names what is gone
}
ALL = "\n".join(DOCUMENTS.values())
CODE_BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```$", ALL, flags=re.M | re.S)
LINES = [line.strip() for language, block in CODE_BLOCKS if not language for line in block.splitlines()]
SPANS = re.findall(r"`([^`\n]+)`", re.sub(r"^```.*?^```$", "", ALL, flags=re.M | re.S))
TOP_FOLDERS = "|".join(
    sorted(
        {p.parent.name for p in ROOT.glob("*/package.xml")}
        | {"docker", "docs", "examples", "reports", "tests", "tools"}
    )
)


def table(document: str, heading: str) -> list[list[str]]:
    """Cells of the first table under a heading, without its header."""
    section = f"\n{DOCUMENTS[document]}".split(f"\n{heading}\n", 1)[1]
    rows = re.search(r"(?:^\|.*\n)+", section, flags=re.M)[0].splitlines()[2:]
    return [[cell.strip() for cell in row.strip("|").split(" | ")] for row in rows]


def commands(program: str) -> list[list[str]]:
    """Arguments of every call of a program: in blocks, and in running text where it is more than a name."""
    calls = [shlex.split(line) for line in LINES] + [call for span in SPANS if len(call := span.split()) > 2]
    return [call[1:] for call in calls if call[:1] == [program]]


def test_every_midastouch_command_parses():
    calls = commands("midastouch")
    assert len(calls) > 10
    for arguments in calls:
        try:
            build_parser().parse_args(arguments)
        except SystemExit as exit_:
            pytest.fail(f"midastouch {' '.join(arguments)}: exit {exit_.code}")


def test_the_command_table_is_complete():
    described = {shlex.split(row[0].strip("`"))[1] for row in table("docs/commands.md", "## midastouch")}
    assert described == set(add_commands(argparse.ArgumentParser()))


def test_every_make_target_exists():
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), flags=re.M))
    wanted = set(re.findall(r"^make (?:\w+=\S+ )?([a-z-]+)", "\n".join([*LINES, *SPANS]), flags=re.M))
    assert wanted <= targets
    assert {row[0].strip("`").removeprefix("make ") for row in table("docs/commands.md", "## make")} == targets


def test_launch_files_and_their_arguments_exist():
    folder = ROOT / "midastouch_bringup" / "launch"
    described = {row[0].strip("`") for row in table("docs/commands.md", "## ros2 launch midastouch_bringup")}
    assert described == {path.name for path in folder.glob("*.launch.py")}
    from midastouch_bringup.ros.launch_arguments import ARGUMENTS

    for call in commands("ros2"):
        if call[0] == "launch":
            assert call[1] == "midastouch_bringup"
            assert call[2] in described
            for argument in call[3:]:
                assert argument == "--show-args" or argument.partition(":=")[0] in ARGUMENTS
    for argument, _ in re.findall(r"`(\w+):=(\w+)`", ALL):
        assert argument in ARGUMENTS


def test_what_is_run_without_launch_can_be_started():
    from midastouch_bringup.ros.run import values

    calls = [call[1:] for call in commands("midastouch") if call[0] == "run" and call[1].islower()]
    assert calls
    for setup, *words in calls:
        values(setup, [word for word in words if word != "--show-args"])


@pytest.mark.parametrize("document", DOCUMENTS)
def test_links_lead_somewhere(document):
    for target in re.findall(r"\]\(([^)]+)\)", DOCUMENTS[document]):
        if target.startswith("https://"):
            continue
        name, _, heading = target.partition("#")
        path = (ROOT / document).parent / name if name else ROOT / document
        assert path.exists(), target
        if heading:
            assert heading in anchors(path.read_text()), target


def anchors(text: str) -> set[str]:
    """What GitHub calls the headings of a document."""
    headings = re.findall(r"^#+ (.*)$", text, flags=re.M)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_files_that_are_named_exist():
    """By their path in the tree, or as Python names them, without the package's outer folder."""
    paths = {span for span in SPANS if re.fullmatch(rf"({TOP_FOLDERS})/[\w./-]+", span)}
    assert len(paths) > 5
    candidates = {path: (ROOT / path, ROOT / path.split("/")[0] / path) for path in sorted(paths)}
    assert [path for path, places in candidates.items() if not any(place.exists() for place in places)] == []


def test_walks_are_short_and_name_what_is_there():
    text = DOCUMENTS["docs/architecture.md"].split("\n## Four walks\n")[1].split("\n## ")[0]
    walks = re.split(r"^\*\*.*\*\*$", text, flags=re.M)[1:]
    assert len(walks) == 4
    for walk in walks:
        stations = re.findall(r"^\d\. \[[^\]]+\]\(\.\./([^)]+)\): `([\w.]+)`$", walk, flags=re.M)
        assert 1 < len(stations) <= 6
        for path, name in stations:
            assert name in defined_names((ROOT / path).read_text()), f"{path}: {name}"


def defined_names(source: str) -> set[str]:
    """Classes, functions and methods (`Class.method`) of a module."""
    kinds = ast.ClassDef | ast.FunctionDef
    top = [node for node in ast.parse(source).body if isinstance(node, kinds)]
    return {node.name for node in top} | {
        f"{node.name}.{inner.name}" for node in top for inner in node.body if isinstance(inner, kinds)
    }


def test_the_readme_is_short():
    assert len(DOCUMENTS["README.md"].encode()) <= 9000


def test_frames_are_those_of_the_mount_and_of_the_nodes():
    from midastouch_bringup.bags.messages import BASE_FRAME, GEL_FRAME, TRUTH_FRAME, TRUTH_GEL_FRAME
    from midastouch_bringup.ros.parameter_tables import TABLES

    mount = yaml.safe_load((ROOT / "midastouch_bringup/config/frames.yaml").read_text())
    of_mount = {entry[end] for entry in mount.values() for end in ("parent", "child")}
    of_nodes = {p.default for table_ in TABLES.values() for p in table_ if p.name.endswith("frame_id")}
    described = {row[0].strip("`") for row in table("docs/interfaces.md", "## Frames")}
    assert described == (of_mount | of_nodes) - {"tool0"}
    tree = DOCUMENTS["docs/interfaces.md"].split("\n## Frames\n", 1)[1].split("```")[1]
    for frame in described | {"tool0", BASE_FRAME, GEL_FRAME, TRUTH_FRAME, TRUTH_GEL_FRAME}:
        assert frame in tree, frame


def test_every_package_is_in_the_table():
    packages = {p.parent.name for p in ROOT.glob("*/package.xml")}
    assert {re.search(r"`(\w+)`", row[0])[1] for row in table("README.md", "## Packages")} == packages
    assert all(f"{name}/README.md" in DOCUMENTS for name in packages)


def test_states_are_those_of_the_message():
    message = (ROOT / "midastouch_msgs" / "msg" / "FilterStatus.msg").read_text()
    states = set(re.findall(r'STATE_\w+ = "(\w+)"', message)) - {"waiting"}
    for document, heading in (("docs/interfaces.md", "## States"), ("docs/trust.md", "## What each state promises")):
        assert {row[0].strip("`") for row in table(document, heading)} == states


def test_every_dependency_is_listed_with_its_licence():
    rows = {re.split(r"[ (]", row[0])[0].lower(): row for row in table("docs/dependencies.md", "# Dependencies")}
    listed = {re.sub(r".*\((\S+)\)", r"\1", row[0]).lower().replace(" ", "") for row in rows.values()}
    pinned = re.findall(r"^([\w-]+)==", (ROOT / "tools/requirements/base.txt").read_text(), flags=re.M)
    assert {name.lower().replace("-", "") for name in pinned} <= {name.replace("-", "") for name in listed}
    for row in rows.values():
        assert len(row) == 3
        assert all(row)


@pytest.mark.parametrize("document", ["README.md", "docs/evaluation.md", "docs/trust.md"])
def test_figures_are_those_of_the_reports(document, load_tool):
    tool = load_tool("evaluation_tables")
    assert document in tool.DOCUMENTS
    assert DOCUMENTS[document].count("<!-- table ") == DOCUMENTS[document].count("<!-- end -->") > 0
    assert DOCUMENTS[document] == tool.filled(document), "run: .venv/bin/python tools/evaluation_tables.py"


def test_pictures_of_trust_show_the_newest_reports(load_tool, tmp_path):
    from PIL import Image

    tool = load_tool("trust_plots")
    wanted = tool.digest(tool.shown())
    tool.write(tmp_path)
    for name in tool.FIGURES:
        for folder in (tool.FOLDER, tmp_path):
            with Image.open(folder / name) as image:
                assert image.text[tool.DIGEST] == wanted, "run: .venv/bin/python tools/trust_plots.py"


def test_trust_is_claimed_by_whole_intervals_only(load_tool, monkeypatch):
    load_tool("evaluation_tables")
    from report_tables import trust as tool

    monkeypatch.setattr(tool, "PROMISED_WRONG", 0.05)
    report = {"trials": 200, "converged_frames_wrong": {"share": 0.04, "interval": [0.03, 0.049]}}
    none = {"share": None, "interval": None}
    report |= {"right_if_converged_at_end": none, "right_if_converged_modulo_symmetry_at_end": none, "regions": {}}
    monkeypatch.setattr(tool, "reported", lambda: ["kidnap"])
    monkeypatch.setattr(tool, "benchmark_summary", lambda name: {"trust": report})

    def cells() -> list[str]:
        (row,) = (row for row in tool.converged()[1] if row[0] == tool.PROTOCOLS["kidnap"])
        return row[1:3]

    assert cells() == ["4.0 % (3.0%...4.9%)", "kept"]
    report["converged_frames_wrong"] = {"share": 0.04, "interval": [0.03, 0.06]}
    assert cells()[1] == "not shown"
    report["converged_frames_wrong"] = {"share": 0.08, "interval": [0.06, 0.1]}
    assert cells()[1] == "*not kept*"
    report["trials"] = 99
    assert cells() == ["too few (99)", "too few (99)"]
    monkeypatch.setattr(tool, "reported", list)
    assert cells()[0] == tool.UNMEASURED


def test_the_front_marks_the_default_and_presets_and_claims_nothing_below_100_trials(load_tool, monkeypatch):
    load_tool("evaluation_tables")
    from report_tables import accuracy as tool

    from midastouch_bringup.evaluation.variants import VARIANTS

    def compared(variant: str, cpu: float, error: float) -> dict:
        same = dict.fromkeys(("difference_mm", "wrong_converged", "e_rot_deg"), 0.0)
        one = {"variant": variant, "trials": 100, "cpu_ms_filter": cpu, "e_trans_mm": error, "verdict": "-"}
        return one | same | {"difference_mm_interval": None, "right": 0.9}

    rows = [compared("default", 6, 2), compared("fast", 3, 4), compared("5k", 4, 5)]
    about = {one["variant"]: VARIANTS[one["variant"]].describe() for one in rows}
    monkeypatch.setattr(tool, "reported", lambda: ["front"])
    monkeypatch.setattr(tool, "report", lambda name: {"comparison": rows, "variants": about})
    table = [(row[0].startswith("**"), row[1]) for row in tool.front()[1]]
    assert table == [(True, "yes"), (False, ""), (True, "yes")]
    rows[:] = [one | {"trials": 99} for one in rows]
    ((what, *cells, _),) = tool.front()[1]
    assert (what, set(cells)) == ("3 variants", {"too few (99)"})
    monkeypatch.setattr(tool, "reported", list)
    assert tool.front()[1][0][0] == tool.UNMEASURED


def test_an_ablation_that_is_not_measured_yet_is_in_the_table(load_tool, monkeypatch):
    load_tool("evaluation_tables")
    from report_tables import accuracy as tool

    monkeypatch.setattr(tool, "reported", list)
    header, rows = tool.variants()
    by_report = {row[-1]: row for row in rows}
    assert by_report["`ablation_rest`"][:2] == ["at rest in contact for 20 s", tool.UNMEASURED]
    assert {len(row) for row in rows} == {len(header)}


def test_parameter_tables_are_those_of_the_nodes():
    from midastouch_bringup.ros.parameter_tables import markdown

    mend = "run: python -m midastouch_bringup.ros.parameter_tables > docs/parameters.md"
    assert (ROOT / "docs" / "parameters.md").read_text() == markdown(), mend


# --- topics, against running nodes


# What rclpy gives every node, and every lifecycle node.
EVERY_NODE = {
    "/parameter_events", "/rosout", "/diagnostics", "describe_parameters", "get_parameter_types",
    "get_parameters", "list_parameters", "set_parameters", "set_parameters_atomically",
    "get_type_description",
    "change_state", "get_state", "get_available_states", "get_available_transitions", "get_transition_graph",
    "transition_event",
}  # fmt: skip


def interfaces(node, listed) -> set[tuple[str, str]]:
    """(name as in the table, type) of what a node has of one kind."""
    found = set()
    for name, types in listed:
        name = name.replace(f"/{node.get_name()}/", "~/")
        of_action = "/_action/" in name  # actions are made of topics and services
        if name.removeprefix("~/") not in EVERY_NODE and not of_action:
            short = name if name in ("/tf", "/tf_static", "/clock") else name.removeprefix("/")
            found |= {(short, one.rpartition("/")[2]) for one in types}
    return found


def cell(text: str) -> set[tuple[str, str]]:
    found = set(re.findall(r"`([\w/~]+)` (\w+)", text))
    assert found or text == "-"
    return found


NODES = {row[0].strip("`"): row[1:] for row in table("docs/interfaces.md", "## Topics and services")}


def test_every_node_has_a_row():
    from midastouch_bringup.ros.parameter_tables import TABLES

    assert set(NODES) == set(TABLES)


@pytest.mark.dds
@pytest.mark.parametrize("name", NODES)
def test_topics_and_services_are_those_of_the_running_node(name, context, tmp_path):
    node = make_node(name, context, tmp_path)
    try:
        subscribed, published, served = map(cell, NODES[name])
        graph = node.get_name(), node.get_namespace()
        assert interfaces(node, node.get_publisher_names_and_types_by_node(*graph)) == published
        assert interfaces(node, node.get_subscriber_names_and_types_by_node(*graph)) == subscribed
        actions = interfaces(node, get_action_server_names_and_types_by_node(node, *graph))
        assert interfaces(node, node.get_service_names_and_types_by_node(*graph)) | actions == served
    finally:
        node.destroy_node()


def test_python_versions_are_those_of_the_packages():
    assert "Python 3.10 to 3.13" in DOCUMENTS["README.md"]
    assert importlib.metadata.metadata("midastouch_bringup")["Requires-Python"] == ">=3.10"
    assert sys.version_info >= (3, 10)

"""The rooms of the package depend on each other in one direction; a module at the top is a room of its own."""

import ast
from collections import defaultdict
from graphlib import TopologicalSorter
from pathlib import Path

import midastouch_filter

PACKAGE = Path(midastouch_filter.__file__).parent


def rooms_used() -> dict[str, set[str]]:
    """The other rooms that each room imports."""
    used = defaultdict(set)
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = path.relative_to(PACKAGE).with_suffix("").parts
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and node.level:
                package = parts[: len(parts) - node.level]
                for name in node.names:
                    target = (*package, *(node.module.split(".") if node.module else ()), name.name)
                    used[parts[0]].add(target[0])
    return {room: others - {room} for room, others in used.items()}


ROOMS = ("core", "filter", "paper_filter", "active_touch", "localiser", "identification")


def test_no_room_depends_on_itself_by_way_of_others():
    graph = rooms_used()
    TopologicalSorter(graph).prepare()  # raises CycleError
    assert {*ROOMS, "nodes"} <= set(graph)
    assert not graph["core"], "everything may rest on it"
    for k, room in enumerate(ROOMS):
        assert graph[room].isdisjoint(ROOMS[k:]), room

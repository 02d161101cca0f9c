"""The node `tdn` on a fake network, and what it warns of."""

from __future__ import annotations

from collections.abc import Callable

from diagnostic_msgs.msg import DiagnosticArray
from perception_fakes import FakeDepthStage

from midastouch_perception.nodes.tdn import TdnNode

REPLAY = {"queue_depth": 100, "reliable": True}


def start(graph, depth: FakeDepthStage, **parameters) -> TdnNode:
    """The node, ready for a replay without loss."""
    return graph.add(lambda **options: TdnNode(depth=depth, **options), {**REPLAY, **parameters})


def warnings_of(graph) -> Callable[[], list[str]]:
    """Gives the messages of all statuses so far that warn."""
    warned: list[str] = []
    statuses = graph.listen(DiagnosticArray, "/diagnostics")

    def collect() -> list[str]:
        warned.extend(s.message for m in statuses for s in m.status if s.level != b"\x00")
        statuses.clear()
        return warned

    return collect

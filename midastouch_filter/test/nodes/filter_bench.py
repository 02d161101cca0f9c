"""The filter node on a fake filter, with its inputs and what it says."""

from __future__ import annotations

import subprocess
from collections.abc import Callable

import numpy as np
from filter_fakes import code_msg, loader_of
from process_rig import started
from tf2_msgs.msg import TFMessage
from tf_messages import tf_msg, translation

from midastouch_common.message_arrays import stamp_ns
from midastouch_filter.core.state import WAITING
from midastouch_filter.nodes.particle_filter import ParticleFilterNode
from midastouch_msgs.msg import FilterStatus, TactileCode

REPLAY = {"queue_depth": 100, "reliable": True, "view_rate": 0.0, "input_timeout": 1000.0, "transform_timeout": 300.0}
OBJECT = {"mesh": "/data/mug.ply", "codebook": "/data/mug.npz"}
T_BASE_OBJ = translation(0.4, 0.1, 0.2)


def is_answer(status: FilterStatus) -> bool:
    """Whether it is more than the word that an answer is still to come."""
    return status.state != WAITING


def skipped(status: FilterStatus) -> dict[str, int]:
    """How often each thing was skipped, by name."""
    return dict(zip(status.skipped_names, status.skipped_counts, strict=True))


def executable(*parameters: str) -> subprocess.Popen:
    """The node as a process, with parameters as `name:=value`."""
    words = [word for parameter in parameters for word in ("-p", parameter)]
    return started("midastouch_filter.nodes.particle_filter", *words)


class Bench:
    """A node with its inputs and the statuses it has published since its start; `waits` are those that are no answers.

    load: replaces the one that hands out fake filters; `filters` are those that were handed out. options: of the node.
    """

    def __init__(self, graph, load: Callable | None = None, options: dict | None = None, **parameters):
        self.graph, self.filters = graph, []
        load = load or loader_of(self.filters)
        self.node = graph.add(
            lambda **given: ParticleFilterNode(load=load, **(options or {}), **given),
            {**REPLAY, "refinement": False, **parameters},  # codes alone, unless told: none waits for a map
        )
        self.statuses = graph.listen(FilterStatus, "filter_status", latched=True, wanted=is_answer)
        self.waits = graph.listen(FilterStatus, "filter_status", wanted=lambda status: not is_answer(status))
        self.codes = graph.publisher(TactileCode, "tactile/code")
        self.tf = graph.publisher(TFMessage, "/tf")
        # the last one it says before it hears codes
        graph.spin_until(
            lambda: self.statuses and not self.statuses[-1].reason.startswith("loading"), "the status at start"
        )
        self.statuses.clear()

    @property
    def filter(self):
        return self.filters[-1]

    def answered(self) -> list[int]:
        """Stamps [ns] of the statuses."""
        return [stamp_ns(status.header.stamp) for status in self.statuses]

    def waited(self, stamp: int) -> bool:
        """Whether it was said of the code of a stamp [ns] that it waits."""
        return stamp in [stamp_ns(status.header.stamp) for status in self.waits]

    def delay(self, stamp: int) -> None:
        """Send the code of a stamp [ns], which waits for its transform."""
        self.codes.publish(code_msg(stamp))
        self.graph.spin_until(lambda: self.waited(stamp), "the word that it waits")

    def answers(self, stamp: int) -> list[FilterStatus]:
        """The statuses of a stamp [ns]."""
        return [status for status in self.statuses if stamp_ns(status.header.stamp) == stamp]

    def frame(self, stamp: int, T_base_gel: np.ndarray = T_BASE_OBJ, **code) -> FilterStatus:
        """Send transform and code of one frame; the status that answers it."""
        before = len(self.statuses)
        self.tf.publish(tf_msg(stamp, T_base_gel))
        self.codes.publish(code_msg(stamp, **code))
        self.graph.spin_until(lambda: stamp in self.answered()[before:], f"the answer to {stamp}")
        return self.statuses[-1]

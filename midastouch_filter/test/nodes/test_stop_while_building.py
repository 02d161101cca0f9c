"""The executable `particle_filter`, stopped while it builds the codebook of its object."""

from __future__ import annotations

import signal

import pytest
from filter_bench import executable
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState

from midastouch_msgs.msg import FilterStatus
from midastouch_perception.objects import bundled_objects

pytestmark = [pytest.mark.dds, pytest.mark.slow]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_before_the_codebook_is_whole(graph, number):
    # told to build only once it is discovered: that takes up to 4 s, and building no longer
    process = executable(f"mesh:={bundled_objects()['handle_tool']}", "autostart:=false", "threads:=1")
    try:
        statuses = graph.listen(FilterStatus, "filter_status", latched=True)
        configure = Transition(id=Transition.TRANSITION_CONFIGURE)
        graph.request(ChangeState, "particle_filter/change_state", ChangeState.Request(transition=configure))
        graph.spin_until(lambda: any("building a codebook" in status.reason for status in statuses), "the building")
        process.send_signal(number)
        said = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 0, said
    assert said == ("", "")  # not "active"

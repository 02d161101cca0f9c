"""Parameters of the `replay` node."""

from __future__ import annotations

from midastouch_common.ros.parameters import Parameter

PARAMETERS = (
    Parameter("source", "", "Bag (.mcap file or rosbag2 folder), YCB-Slide sequence, folder of images or video"),
    Parameter(
        "rate", 1.0, "Recorded seconds per second; 0: as fast as it goes", minimum=0.0, maximum=1000.0, read_only=False
    ),
    Parameter("clock", False, "Publish /clock, for nodes with use_sim_time"),
    Parameter("loop", False, "Start again at the end; time jumps back", read_only=False),
    Parameter("start_paused", False, "Wait for the service resume or step"),
    Parameter("start_offset", 0.0, "Leave out this much of the beginning", "s", minimum=0.0, maximum=1e6),
    Parameter(
        "seek_to",
        0.0,
        "Each time it is set, go on this long after the beginning; a pause stays",
        "s",
        minimum=0.0,
        maximum=1e6,
        read_only=False,
    ),
    Parameter("wait_for_nodes", "", "Lifecycle nodes to be active before anything is sent, separated by spaces"),
    Parameter("wait_for_subscribers", 0, "Start when so many listen to the image", minimum=0, maximum=100),
    Parameter(
        "ack_topic",
        "",
        "FilterStatus topic of the filter: the next image waits until the one before is answered there, so that none "
        "is lost however slow the filter is; empty: do not wait",
    ),
    Parameter(
        "ack_timeout",
        5.0,
        "An image of which the filter, though it is at work, says nothing for so long is given up; the time in which "
        "it is busy or loads does not count",
        "s",
        minimum=0.05,
        maximum=3600.0,
    ),
    Parameter("topics", "", "Topics of a bag to play, separated by spaces; empty: the pipeline's inputs"),
)

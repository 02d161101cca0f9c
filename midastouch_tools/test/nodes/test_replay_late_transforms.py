"""A replay to a filter node of recordings whose transforms come late, with gaps or by another clock; over real DDS."""

import dataclasses

import pytest
from filter_fakes import code_msg, loader_of
from recorded import edited, write
from replay_rig import answers, frames, paced, play
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Image
from std_srvs.srv import Trigger

from midastouch_common.message_arrays import stamp_ns
from midastouch_common.ros import qos
from midastouch_filter.nodes.particle_filter import ParticleFilterNode
from midastouch_msgs.msg import FilterStatus, TactileCode
from midastouch_tools.bags.messages import sequence_messages

pytestmark = pytest.mark.dds
MS = 1_000_000


class Chain:
    """A filter node with a fake filter, by the replay's clock, and codes made of its images as soon as they come."""

    def __init__(self, graph, transform_timeout=10.0):
        self.graph, self.filters, self.sent = graph, [], []
        given = {"mesh": "/data/a.ply", "codebook": "/data/a.npz", "queue_depth": 100, "reliable": True}
        given |= {"refinement": False, "use_sim_time": True, "transform_timeout": transform_timeout}
        self.node = graph.add(lambda **options: ParticleFilterNode(load=loader_of(self.filters), **options), given)
        self.statuses = graph.listen(FilterStatus, "filter_status", latched=True)
        codes = graph.companion.create_publisher(TactileCode, "tactile/code", qos.stage_publisher(100))
        graph.spin_until(lambda: codes.get_subscription_count() > 0, "the filter")

        def feel(image):
            self.sent.append(stamp_ns(image.header.stamp))
            codes.publish(code_msg(self.sent[-1]))

        graph.companion.create_subscription(Image, "image_raw", feel, qos.stream_subscriber(100, reliable=True))

    def answers(self, path, messages) -> list[str]:
        """Play the messages; return the only answer to each image, in order. No image is repeated or lost."""
        node = paced(self.graph, written(path, messages), clock=True)
        play(self.graph, node)
        assert frames(node) == (len(self.sent), 0, 0)
        # the filter has an answer before its status arrives here
        self.graph.spin_until(lambda: all(answers(self.sent, self.statuses)), "an answer to each")
        said = answers(self.sent, self.statuses)
        assert [len(each) for each in said] == [1] * len(self.sent)
        return [each[0].state for each in said]


def written(path, messages):
    return write(path, *sorted(messages, key=lambda m: m.stamp_ns))


def with_late_transforms(sequence, late_ns):
    """The messages of a sequence, recorded transforms so much later."""
    for message in sequence_messages(sequence):
        late = message.topic == "/tf"
        yield dataclasses.replace(message, stamp_ns=message.stamp_ns + late_ns) if late else message


def test_a_gap_in_transforms_is_bridged_and_both_ends_are_stale(graph, tmp_path, simulated_sequence):
    """A bag whose arm came 1 s after the camera, had a gap of 1 s, and left 0.4 s earlier, at 10 Hz."""
    sequence = simulated_sequence(n=33)
    present = {*sequence.stamps_ns[10:15].tolist(), *sequence.stamps_ns[25:30].tolist()}
    messages = [m for m in sequence_messages(sequence) if m.topic != "/tf" or m.stamp_ns in present]
    chain = Chain(graph)
    # what lies within the gap is interpolated over it; only before and after there is nothing
    assert chain.answers(tmp_path / "x.mcap", messages) == ["stale"] * 10 + ["ambiguous"] * 20 + ["stale"] * 3
    assert chain.sent == sequence.stamps_ns.tolist()
    assert len(chain.filters[0].measurements) == 20


@pytest.mark.parametrize("late_ms", [5, 250, 1900])
def test_transforms_recorded_after_their_images(graph, tmp_path, simulated_sequence, late_ms):
    """Between this image and the next one, after the next one, or after many."""
    n = 8 + late_ms // 100  # at 10 Hz
    sequence, chain = simulated_sequence(n=n), Chain(graph)
    messages = with_late_transforms(sequence, late_ms * MS)
    assert chain.answers(tmp_path / "x.mcap", messages) == ["ambiguous"] * n
    assert chain.sent == sequence.stamps_ns.tolist()
    assert len(chain.filters[0].measurements) == n


def restamped(message, by_ns):
    """With the stamps of its headers moved."""

    def move(content):
        for header in [t.header for t in content.transforms] if message.topic == "/tf" else [content.header]:
            stamp = header.stamp.sec * 1000 * MS + header.stamp.nanosec + by_ns
            header.stamp.sec, header.stamp.nanosec = divmod(stamp, 1000 * MS)

    return edited(message, move)


@pytest.mark.parametrize("ahead", ["/tf", "/image_raw"])
def test_an_arm_of_another_clock_makes_answers_stale_not_lost(graph, tmp_path, simulated_sequence, ahead):
    sequence = simulated_sequence(n=12)
    messages = [restamped(m, 60_000 * MS) if m.topic == ahead else m for m in sequence_messages(sequence)]
    assert Chain(graph, transform_timeout=0.5).answers(tmp_path / "x.mcap", messages) == ["stale"] * 12


def test_a_step_includes_the_transforms_that_its_frame_waits_for(graph, tmp_path, simulated_sequence):
    sequence = simulated_sequence(n=4)
    chain = Chain(graph)
    source = written(tmp_path / "x.mcap", with_late_transforms(sequence, 5 * MS))
    node = paced(graph, source, clock=True, start_paused=True)
    clock = graph.listen(Clock, "/clock")
    node.start()
    for n in (1, 2):
        assert graph.call(Trigger, "replay/step", Trigger.Request()).success
        graph.spin_until(lambda n=n: len(chain.filters[0].measurements) == n, "the frame")
        graph.spin_for(0.2)
        assert chain.sent == sequence.stamps_ns[:n].tolist()
        assert stamp_ns(clock[-1].clock) <= sequence.stamps_ns[n]

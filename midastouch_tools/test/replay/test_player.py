"""What is sent, in which order and at what recorded time; the ROS node around it has its own tests."""

import weakref
from types import SimpleNamespace

import pytest
from recorded import compressed, cut_off, write

from midastouch_tools.bags.messages import sequence_messages
from midastouch_tools.replay.flow_control import FlowControl
from midastouch_tools.replay.playback import Playback
from midastouch_tools.replay.player import Player
from midastouch_tools.replay.source import ReplaySource


def make_player(path, send=None):
    """A player as fast as it goes, for which nobody answers, and what it has done."""
    done = SimpleNamespace(sent=[], told=[], playback=Playback(rate=0.0), lost=[])
    flow = FlowControl(done.playback, 1, lambda: True, lambda *told: done.lost.append(told))
    source = ReplaySource(path)
    done.player = Player(source, done.playback, flow, False, send or done.sent.append, done.told.append)
    return done


def test_each_message_goes_out_once_in_order_and_time_goes_on(simulated_sequence):
    sequence = simulated_sequence(n=5)
    done = make_player(sequence.path)
    done.player.play(lambda: False)
    assert [m.data for m in done.sent] == [m.data for m in sequence_messages(sequence)]
    assert done.told == sequence.stamps_ns.tolist()
    assert (done.player.frames_sent, done.player.frames_repeated, done.player.frames_lost) == (5, 0, 0)
    assert done.player.summary() == "sent 5 frames, 0 repeated, 0 lost"
    assert done.player.position == pytest.approx(1e-9 * (sequence.stamps_ns[-1] - sequence.stamps_ns[0]))


def test_a_loop_begins_anew_and_a_seek_leaves_out(simulated_sequence):
    sequence = simulated_sequence(n=4)
    again = iter([True, False])
    done = make_player(sequence.path)
    second = 1e-9 * (sequence.stamps_ns[1] - sequence.stamps_ns[0])
    done.playback.seek(second)  # before anything is sent
    done.player.play(lambda: next(again))
    assert done.told == [*sequence.stamps_ns[1:].tolist(), *sequence.stamps_ns.tolist()]
    assert done.player.frames_sent == 7


def test_a_frame_whose_image_is_broken_is_left_out_and_counted(tmp_path, simulated_sequence):
    messages = [compressed(m) if m.topic == "/image_raw" else m for m in sequence_messages(simulated_sequence(n=3))]
    broken = next(i for i, m in enumerate(messages) if m.topic.startswith("/image_raw"))
    messages[broken] = cut_off(messages[broken])
    write(tmp_path / "x.mcap", *messages)
    done = make_player(tmp_path / "x.mcap")
    done.player.play(lambda: False)
    assert (done.player.frames_sent, done.player.frames_broken) == (2, 1)
    assert done.player.summary() == "sent 2 frames, 0 repeated, 0 lost, 1 left out as their images are broken"


def test_an_interrupted_playback_sends_nothing_more(simulated_sequence):
    sent = []

    def stop_after_four(message):
        sent.append(message)
        if len(sent) == 4:
            done.playback.stop()

    done = make_player(simulated_sequence(n=9).path, send=stop_after_four)
    done.player.play(lambda: True)
    assert len(sent) == 4


def test_what_was_sent_is_forgotten(tmp_path, simulated_sequence):
    """A long bag with one image only must not end up in memory."""
    messages = list(sequence_messages(simulated_sequence(n=50)))
    image = next(m for m in messages if m.topic == "/image_raw")
    write(tmp_path / "x.mcap", image, *(m for m in messages if m.topic == "/tf"))
    sent, kept = [], []

    def send(message):
        kept.append(sum(one() is not None for one in sent))
        sent.append(weakref.ref(message))

    make_player(tmp_path / "x.mcap", send).player.play(lambda: False)
    assert len(sent) == 51
    assert max(kept) < 5

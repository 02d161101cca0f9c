import numpy as np

from midastouch_common import se3
from midastouch_filter.core.keyframes import KeyframeWindow, independence
from midastouch_filter.core.touch import Measurement

STEP = se3.exp([0.01, 0, 0, 0, 0, 0.1])
SILENT = [np.zeros(5)]


def keep(window, number):
    for _ in range(number):
        window.moved(STEP, 0.02, in_contact=True)
        window.keep([Measurement(True)], SILENT)


def test_a_touch_is_due_at_the_start_and_after_some_path():
    window = KeyframeWindow(4, 0.02, correlation=0.01, shortlist=3)
    assert window.due
    window.keep([Measurement(True)], SILENT)
    window.moved(STEP, 0.015, in_contact=True)
    assert not window.due
    window.moved(STEP, 0.015, in_contact=True)
    assert window.due


def test_of_touches_that_count_in_full_the_oldest_goes_and_motion_is_from_the_start():
    window = KeyframeWindow(4, 0.02, correlation=0.01, shortlist=3)
    keep(window, 6)
    assert len(window) == 4
    np.testing.assert_allclose(window.keyframes[0].motion, np.linalg.matrix_power(STEP, 3), atol=1e-12)
    np.testing.assert_allclose(window.motion, np.linalg.matrix_power(STEP, 6), atol=1e-12)


def test_touches_that_others_stand_for_go_first_and_then_the_oldest():
    window = KeyframeWindow(4, 0.01, correlation=0.025, shortlist=3)
    kept = []
    for x in range(9):
        window.motion = se3.translation([0.01 * x, 0, 0])
        window.keep([Measurement(True)], SILENT)
        kept.append([round(100 * float(each.motion[0, 3])) for each in window.keyframes])
    assert kept[3:] == [[0, 1, 2, 3], [0, 2, 3, 4], [0, 2, 4, 5], [0, 2, 4, 6], [2, 4, 6, 7], [2, 4, 6, 8]]


def test_touches_before_a_lift_go_before_any_after_it():
    window = KeyframeWindow(4, 0.01, correlation=0.025, shortlist=3)
    for _ in range(3):
        for _ in range(3):
            window.moved(se3.translation([0.01, 0, 0]), 0.01, in_contact=True)
            window.keep([Measurement(True)], SILENT)
        window.moved(np.eye(4), 0.02, in_contact=False)
    assert [each.stretch for each in window.keyframes] == [1, 2, 2, 2]


def test_a_touch_replaces_one_nearby():
    window = KeyframeWindow(8, 0.02, correlation=0.01, shortlist=3)
    keep(window, 3)
    there, back = window.motion, np.linalg.inv(STEP)
    for step in (back, STEP):
        window.moved(step, 0.02, in_contact=True)
        window.keep([Measurement(True)], SILENT)
    assert len(window) == 3
    np.testing.assert_allclose(window.keyframes[-1].motion, there, atol=1e-12)


def test_after_a_lift_nothing_is_nearby():
    window = KeyframeWindow(8, 0.02, correlation=0.01, shortlist=3)
    keep(window, 3)
    window.moved(STEP, 0.006, in_contact=False)
    window.moved(np.linalg.inv(STEP), 0.006, in_contact=False)
    window.moved(np.eye(4), 0.0, in_contact=True)
    window.keep([Measurement(True)], SILENT)
    assert len(window) == 4
    assert window.lifted
    window.keep([Measurement(True)], SILENT)  # rubs the spot
    assert len(window) == 4
    assert not window.lifted
    assert independence(window.keyframes, 0.5)[-1] == 1


def test_a_short_gap_is_no_lift():
    window = KeyframeWindow(8, 0.02, correlation=0.01, shortlist=3)
    keep(window, 2)
    window.moved(STEP, 0.008, in_contact=False)
    keep(window, 1)
    assert not window.lifted


def test_touches_count_by_their_distance_to_all_earlier_ones():
    window = KeyframeWindow(8, 0.01, correlation=0.01, shortlist=3)
    for x in (0.0, 0.01, 0.03, 0.02):
        window.motion = se3.translation([x, 0, 0])
        window.keep([Measurement(True)], SILENT)
    np.testing.assert_allclose(independence(window.keyframes, 0.04), [1, 0.25, 0.5, 0.25])
    np.testing.assert_allclose(independence(window.keyframes, 0.005), 1)


def test_further_fingers_are_aligned_to_once_the_pose_is_settled():
    window = KeyframeWindow(2, 0.02, correlation=0.01, shortlist=3)
    blind, first, second = (Measurement(True, penetration=p) for p in (None, np.zeros(1), np.ones(1)))
    window.keep([blind, first, second], 3 * SILENT)
    (keyframe,) = window.keyframes
    assert keyframe.maps(settled=False) == [first]
    assert keyframe.maps(settled=True) == [first, second]


def test_fingers_share_a_shortlist_of_what_fits_best():
    window = KeyframeWindow(2, 0.02, correlation=0.01, shortlist=4)
    log_ratios = [np.array([0.0, 3.0, 1.0, 2.0]), np.array([5.0, 0.0, 6.0, 1.0])]
    window.keep([Measurement(True), Measurement(True)], log_ratios)
    (keyframe,) = window.keyframes
    assert [set(best.tolist()) for best in keyframe.shortlists] == [{1, 3}, {0, 2}]


def test_kept_touches_are_scored_anew_for_other_entries():
    window = KeyframeWindow(4, 0.02, correlation=0.01, shortlist=4)
    for code in (1.0, 2.0):
        window.moved(STEP, 0.02, in_contact=True)
        window.keep([Measurement(True, np.array([code])), Measurement(True, np.array([-code]))], [np.zeros(5)] * 2)
    motion = window.motion
    scores = np.empty(7)

    def log_ratio_of(touch):
        scores[:] = touch.code[0] * np.arange(7.0)
        return scores  # the same for every touch, as it is valid until the next one

    window.score_anew(log_ratio_of)
    newest = window.keyframes[-1]
    np.testing.assert_array_equal(newest.log_ratios, [2 * np.arange(7), -2 * np.arange(7)])
    assert [set(best) for best in newest.shortlists] == [{5, 6}, {0, 1}]
    np.testing.assert_array_equal(newest.motion, motion)


def test_another_window_goes_on_where_one_is():
    window, other = (KeyframeWindow(length, 0.02, correlation=0.01, shortlist=2) for length in (6, 3))
    keep(window, 5)
    window.moved(STEP, 0.015, in_contact=True)
    other.take(window, lambda touch: np.arange(4.0))
    np.testing.assert_array_equal(other.motion, window.motion)
    assert [each.motion.tolist() for each in other.keyframes] == [
        each.motion.tolist() for each in window.keyframes[-3:]
    ]
    assert {tuple(sorted(each.shortlists[0])) for each in other.keyframes} == {(2, 3)}
    assert not other.due
    other.moved(STEP, 0.015, in_contact=True)
    assert other.due
    assert len(window) == 5

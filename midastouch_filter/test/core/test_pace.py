import pytest

from midastouch_filter.core.pace import always, until_next_frame


def test_work_ends_well_before_the_next_frame():
    now = [5.0]
    in_time = until_next_frame(0.1, clock=lambda: now[0])
    assert in_time()
    now[0] = 5.02
    assert in_time()
    now[0] = 5.09
    assert not in_time()


@pytest.mark.parametrize("elapsed", [0.0, -0.03])
def test_there_is_no_time_between_frames_of_one_stamp(elapsed):
    assert not until_next_frame(elapsed, clock=lambda: 5.0)()


def test_where_the_time_between_frames_is_not_known_nothing_ends():
    assert until_next_frame(None) is always
    assert always()

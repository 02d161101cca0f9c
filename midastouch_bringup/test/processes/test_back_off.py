from midastouch_bringup.processes.back_off import BackOff


def test_the_pause_grows_to_a_limit_and_begins_anew_after_a_long_life():
    back_off = BackOff(first=2.0, longest=10.0)
    assert [back_off.after(1.0) for _ in range(5)] == [2.0, 4.0, 8.0, 10.0, 10.0]
    assert back_off.after(10.0) == 2.0
    assert back_off.after(0.0) == 4.0

import os

import numpy as np
import pytest

from midastouch_motion.ur.orders import Order, Orders


@pytest.fixture
def pipe():
    reading, writing = os.pipe()
    yield Orders(reading), lambda data: os.write(writing, data), lambda: os.close(writing)
    os.close(reading)


def order(sent: float) -> Order:
    return Order(sent, np.array([0.1, -1e-17, 1 / 3, 0, 0, 2.0]))


def test_an_order_arrives_as_it_was_sent(pipe):
    orders, write, close = pipe
    write(order(12.25).line())
    arrived = orders.wait(60.0)
    assert arrived.sent == 12.25
    np.testing.assert_array_equal(arrived.twist, order(0).twist)
    close()


def test_of_several_the_newest_counts_and_half_a_line_waits(pipe):
    orders, write, close = pipe
    line = order(3.0).line()
    write(order(1.0).line() + order(2.0).line() + line[:7])
    assert orders.wait(60.0).sent == 2.0
    assert orders.wait(0.0).sent == 2.0
    write(line[7:])
    assert orders.wait(60.0).sent == 3.0
    close()


def test_none_before_the_first_and_an_end_after_the_last(pipe):
    orders, _, close = pipe
    assert orders.wait(0.0) is None
    close()
    with pytest.raises(EOFError):
        orders.wait(60.0)

import signal

from midastouch_bringup.processes.wake_up import woken_by_signals


def test_no_signal_is_lost_between_two_steps_of_listening(monkeypatch):
    """As soon as SIGINT does nothing by itself, `wait` knows of it."""
    set_handler = signal.signal

    def interrupted(number, handler):
        former = set_handler(number, handler)
        if number == signal.SIGINT and handler is not former and not raised:
            raised.append(number)
            signal.raise_signal(number)
        return former

    raised = []
    monkeypatch.setattr(signal, "signal", interrupted)
    with woken_by_signals() as wait:
        assert raised
        assert wait(0.0)

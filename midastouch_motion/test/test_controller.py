import numpy as np

from midastouch_motion.contact_servo import ContactServo, Limits
from midastouch_motion.controller import Controller
from midastouch_motion.guard import Guard, Seen
from midastouch_motion.skills import Lift


def test_a_pause_of_the_controller_is_no_fault_of_the_arm():
    """Which stops by itself meanwhile."""
    controller = Controller(ContactServo(Limits(), 0.05), Guard(np.full(3, -1.0), np.full(3, 1.0), 1e-3))
    controller.begin(Lift(0.1))
    for now in (0.0, 0.01, 1.0):
        seen = Seen(enabled=now, image=now, pose=now, listeners=1, commanders=1)
        twist, ended = controller.step(now, seen)
        assert ended is None, ended.message
    assert twist[2] > 0

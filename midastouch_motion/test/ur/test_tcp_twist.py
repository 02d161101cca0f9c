import numpy as np
import pytest

from midastouch_common import se3
from midastouch_motion.ur.tcp_twist import TwistLimits, along_base, twist_of_tcp


def test_the_gel_moves_as_asked():
    """By finite differences: the tool moves as the TCP's twist says, and the gel on it as its own twist says."""
    rng = np.random.default_rng(0)
    base_from_tcp, tcp_from_gel = se3.exp(rng.uniform(-1, 1, (2, 6)))
    twist = rng.uniform(-1, 1, 6)
    velocity = along_base(twist_of_tcp(twist, tcp_from_gel), base_from_tcp)
    dt = 1e-6
    turn = se3.exp(np.concatenate([np.zeros(3), dt * velocity[3:]]))[:3, :3]
    moved = se3.make(turn @ base_from_tcp[:3, :3], base_from_tcp[:3, 3] + dt * velocity[:3])
    gel = se3.log(se3.inverse(base_from_tcp @ tcp_from_gel) @ moved @ tcp_from_gel) / dt
    np.testing.assert_allclose(gel, twist, atol=1e-5)


@pytest.mark.parametrize(
    ("frame", "twist", "reason"),
    [
        ("gel", [0.06, 0.08, 0, 0, 0, 1.0], ""),
        ("base", [0, 0, 0, 0, 0, 0], "a twist in 'base', not in 'gel'"),
        ("gel", [0, np.nan, 0, 0, 0, 0], "not finite"),
        ("gel", [0, 0, 0, 0, np.inf, 0], "not finite"),
        ("gel", [0.07, 0.08, 0, 0, 0, 0], "faster than max_speed, 0.1 m/s"),
        ("gel", [0, 0, 0, 1, 1, 0], "1.41 rad/s, faster than max_turn_speed"),
    ],
)
def test_what_is_refused(frame, twist, reason):
    refusal = TwistLimits("gel", 0.1, 1.0).refusal(frame, np.array(twist))
    assert reason in refusal
    assert bool(refusal) == bool(reason)

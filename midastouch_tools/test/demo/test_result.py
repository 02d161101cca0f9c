import cv2
import numpy as np

from midastouch_tools.demo.result import calibrated_touches


def test_touches_are_felt_better_after_the_calibration(tool):
    result, rows = calibrated_touches(tool)
    assert result.calibration.presses >= 8

    def error(which: int) -> float:
        """Root mean square over all touches, mm."""
        maps = [(row.penetrations[which], row.penetrations[2]) for row in rows]
        pairs = [(measured, cv2.resize(truth, measured.shape[::-1])) for measured, truth in maps]
        return 1e3 * float(np.sqrt(np.mean([(measured - truth) ** 2 for measured, truth in pairs])))

    assert error(1) < 0.7 * error(0)

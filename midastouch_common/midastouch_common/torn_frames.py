"""Detection of torn frames, whose upper rows are of one frame and whose lower rows are of another.

A DIGIT at 60 frames/s hands out such frames, and nothing in the stream marks them. Where the two parts meet, the image
steps from one row to the next. Optics blur every edge of a contact over some rows. So a step that is one row wide, that
lies at the same row in many columns, and that is in neither of the two frames before, is a seam. As a driver may have
turned the images, seams between columns are looked for, too.
"""

from __future__ import annotations

import cv2
import numpy as np

_BLOCK = 16  # px along a seam whose mean is one number, so that noise averages out
_STEP = np.array([[0.5, -1.5, 1.5, -0.5]], np.float32) / _BLOCK
"""Step into a line, less the mean of those into the two lines next to it: 0 where the image varies smoothly."""
_BESIDE = np.array([[1, 1, 0, 0, 0, 1, 1]], np.float32) / 4
_BEFORE, _AFTER = np.array([[1, 0.5, 0]], np.float32), np.array([[0, 0.5, 1]], np.float32)
"""What a step that is one line wide does not leave in the lines next to it."""
_CODEC = 8  # px, side of the blocks of JPEG and of videos, at whose borders every frame has small steps
_ALIKE = np.zeros((1, 6 * _CODEC + 1), np.float32)
_ALIKE[0, [0, _CODEC, 2 * _CODEC, 4 * _CODEC, 5 * _CODEC, 6 * _CODEC]] = 1 / 12
_CODED = 2.0  # times the evidence of other lines, from which the borders of blocks show that a codec is at work
_CLEAR = 6.0  # times the energy around it, from which a block's step counts
_FAINT = 0.5  # grey levels squared, added to energies: rounding and codecs make steps of about that
_EDGE = 4  # lines at the image's border, where lenses and filters of cameras make steps: half of the evidence counts
_SHARED = 2  # lines on either side of a seam that have a part in its step
_COPIES = 3  # of a torn frame from a slow reader; an image that comes more often is what a simulator shows at rest
_EVIDENCE = 5.0
"""Evidence, the sum over blocks and colours of the logarithm of a step's energy over that around it, by which one line
of a torn frame exceeds all others; twice as much at the border of a codec's blocks."""
_EVIDENCE_OF_ONE = 50.0
"""The same for a seam in a single image: up to 4 in 24 no-contact images, which have none, and 115 or more in them
rolled."""

Steps = tuple[np.ndarray, np.ndarray]


class TornFrames:
    """Detector of torn frames in a stream."""

    def __init__(self) -> None:
        self._image: np.ndarray | None = None
        self._torn, self._copies = False, 0
        self._former: list[Steps] = []  # steps of the last two images

    def torn(self, image: np.ndarray) -> bool:
        """Take the next image (H, W, 3) uint8 and return whether it is torn; do not write into it later.

        The first image counts as whole. From the third on it makes no difference whether the last one was torn, because
        its seam is not in the one before it. An image of another size begins a new stream.
        """
        if self._image is not None and self._image.shape != image.shape:
            self._image, self._former = None, []
        if self._image is not None and np.array_equal(self._image, image):
            self._copies += 1
            return self._torn and self._copies <= _COPIES
        steps = _steps(image)
        self._torn = self._has_seam(steps)
        self._image, self._copies, self._former = image, 0, [steps, *self._former[:1]]
        return self._torn

    def _has_seam(self, steps: Steps) -> bool:
        evidence: list[np.ndarray] = []
        for before in self._former:
            newer = [_evidence(now - then) for now, then in zip(steps, before, strict=True)]
            evidence = [np.minimum(*each) for each in zip(evidence, newer, strict=True)] if evidence else newer
            if max(float(each.max()) for each in evidence) <= _EVIDENCE:  # nearly every frame ends here
                return False
        return bool(evidence) and _seam(evidence, _EVIDENCE) is not None


def single_seam(image: np.ndarray) -> tuple[int, int] | None:
    """Return axis (0 for rows, 1 for columns) and line of a seam across an image (H, W, 3) uint8; None without one.

    By itself an image shows only a seam between parts that differ everywhere, such as opposite sides of a rolled image.
    """
    return _seam([_evidence(steps) for steps in _steps(image)], _EVIDENCE_OF_ONE)


def _steps(image: np.ndarray) -> Steps:
    """Return the steps between rows and those between columns, (blocks, lines, 3) float32 grey levels each."""
    height, width = (side - side % _BLOCK for side in image.shape[:2])
    whole = np.ascontiguousarray(image[:height, :width])
    return _along(cv2.transpose(whole)), _along(whole)


def _along(image: np.ndarray) -> np.ndarray:
    blocks, lines = image.shape[0] // _BLOCK, image.shape[1]
    sums = image.reshape(blocks, _BLOCK, -1).sum(axis=1, dtype=np.uint16).reshape(blocks, lines, 3)
    grown = cv2.copyMakeBorder(sums.astype(np.float32), 0, 0, 2, 1, cv2.BORDER_CONSTANT)
    grown[:, 1], grown[:, -1] = 2 * grown[:, 2] - grown[:, 3], 2 * grown[:, -2] - grown[:, -3]
    steps = np.ascontiguousarray(cv2.filter2D(grown, -1, _STEP, anchor=(2, 0))[:, 2:-1])
    steps[:, 0] = 0  # there is no line before it
    return steps


def _seam(evidence: list[np.ndarray], least: float) -> tuple[int, int] | None:
    """Return axis and line of the one line that stands out by evidence (lines,) of both axes; None if none does.

    A drawn shape has sharp edges along both axes, so none of them stands out.
    """
    axis = int(evidence[1].max() > evidence[0].max())
    line, others = int(evidence[axis].argmax()), evidence[axis].copy()
    others[max(line - _SHARED, 0) : line + _SHARED + 1] = 0
    borders = others[::_CODEC]
    coded = borders.mean() > _CODED * (others.sum() - borders.sum()) / (len(others) - len(borders))
    if coded and line % _CODEC == 0:
        least *= 2
    return (axis, line) if evidence[axis][line] - max(others.max(), evidence[1 - axis].max()) > least else None


def _evidence(change: np.ndarray) -> np.ndarray:
    """Return the evidence (lines,) of a seam at each line by the change (blocks, lines, 3) of the steps."""
    blocks, lines, _ = change.shape
    energy, reach = change * change, _ALIKE.shape[1] // 2
    around = cv2.copyMakeBorder(energy, 0, 0, reach, reach, cv2.BORDER_WRAP)
    usual = np.maximum(cv2.filter2D(around, -1, _BESIDE), cv2.filter2D(around, -1, _ALIKE))[:, reach:-reach]
    wider = cv2.filter2D(change, -1, _BEFORE) ** 2 + cv2.filter2D(change, -1, _AFTER) ** 2
    ratio = (energy + _FAINT) / (_CLEAR * (np.maximum(usual, wider / 2) + _FAINT / 2))
    evidence = cv2.log(np.maximum(ratio, 1)).reshape(blocks, -1).sum(axis=0).reshape(lines, 3).sum(axis=1)
    evidence[:_EDGE] /= 2
    evidence[-_EDGE:] /= 2
    return evidence

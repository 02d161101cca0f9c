"""What can go wrong between a camera and its user, by who has to act."""


class DeviceError(RuntimeError):
    """The camera is absent, busy, unplugged or misbehaves; trying again may help."""


class CorruptFrameError(RuntimeError):
    """One frame was damaged on its way; the next one may be good."""

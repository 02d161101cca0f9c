"""Particle filter over the pose of the sensor on a known object."""

from midastouch_common.lazy_exports import lazy_exports

__getattr__, __all__ = lazy_exports(
    __name__,
    {
        "Estimate": ".core.estimate",
        "FilterConfig": ".core.config",
        "Measurement": ".core.touch",
        "Mode": ".core.estimate",
        "ParticleFilter": ".filter",
        "Status": ".core.state",
        "measurement_of": ".core.touch",
        "preset": ".core.presets",
    },
)

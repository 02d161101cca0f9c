"""Particle filter over the pose of the sensor on a known object."""

from midastouch_common.lazy_exports import lazy_exports

__getattr__, __all__ = lazy_exports(
    __name__,
    {
        "Estimate": ".core.estimate",
        "FilterConfig": ".core.config",
        "Measurement": ".core.touch",
        "Mode": ".core.estimate",
        "MotionModel": ".core.motion_model",
        "Odometry": ".core.motion_model",
        "ParticleFilter": ".filter",
        "Particles": ".core.particles",
        "Policies": ".policies",
        "Propagation": ".core.motion_model",
        "Status": ".core.state",
        "Workers": ".core.workers",
        "default_policies": ".policies",
        "measurement_of": ".core.touch",
        "preset": ".core.presets",
    },
)

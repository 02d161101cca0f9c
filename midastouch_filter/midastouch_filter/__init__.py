"""Particle filter over the pose of the sensor on a known object."""

from midastouch_common.lazy_exports import lazy_exports

__getattr__, __all__ = lazy_exports(
    __name__,
    {
        "Estimate": ".estimate",
        "FilterConfig": ".config",
        "Measurement": ".touch",
        "Mode": ".estimate",
        "MotionModel": ".motion_model",
        "Odometry": ".motion_model",
        "ParticleFilter": ".filter",
        "Particles": ".particles",
        "Policies": ".policies",
        "Propagation": ".propagation",
        "Status": ".state",
        "Workers": ".workers",
        "default_policies": ".policies",
        "measurement_of": ".perceived",
        "preset": ".presets",
    },
)

"""Perception, from tactile images to codes: penetration maps, contact, clouds, calibration, simulation, codebooks and
training."""

from midastouch_common.lazy_exports import lazy_exports

__getattr__, __all__ = lazy_exports(
    __name__,
    {
        "Codebook": ".codebook",
        "DepthNet": ".tdn",
        "InputError": "midastouch_common.errors",
        "ObjectMesh": "midastouch_common.mesh",
        "SensorModel": ".sensor_model",
        "TactileCodeNet": ".tcn",
        "TouchReading": ".pipeline",
        "TouchPipeline": ".pipeline",
        "build_codebook": ".codebook_build",
        "bundled_objects": ".objects",
        "estimate_background": ".tdn",
        "load_tcn": ".tcn",
        "load_tdn": ".tdn",
    },
)

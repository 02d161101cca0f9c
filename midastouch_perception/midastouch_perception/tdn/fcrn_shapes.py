"""Names and shapes of FCRN's weights: ResNet-50 without its classifier, then four up-projections."""

from __future__ import annotations

BLOCKS = (3, 4, 6, 3)  # bottlenecks of each ResNet level
# kernel (height, width) and zero padding (top, left, bottom, right) of the four convolutions of an up-projection,
# each of which gives one pixel of every 2 x 2 of the output
QUARTERS = (((3, 3), (1, 1, 1, 1)), ((2, 3), (1, 1, 0, 1)), ((3, 2), (1, 1, 1, 0)), ((2, 2), (1, 1, 0, 0)))
NORM = ("weight", "bias", "running_mean", "running_var")


def expected_shapes() -> dict[str, tuple[int, ...]]:
    """Names and shapes of the official state dict, without the batch counters."""
    kernels, norms, biases = {"conv1": (64, 3, 7, 7)}, {"bn1": 64}, {"conv3": 1}
    inner = 64
    for level, blocks in enumerate(BLOCKS):
        width = 64 << level
        for block in range(blocks):
            name = f"layer{level + 1}.{block}"
            kernels[f"{name}.conv1"] = (width, inner, 1, 1)
            kernels[f"{name}.conv2"] = (width, width, 3, 3)
            kernels[f"{name}.conv3"] = (4 * width, width, 1, 1)
            norms |= {f"{name}.bn1": width, f"{name}.bn2": width, f"{name}.bn3": 4 * width}
            if block == 0:
                kernels[f"{name}.downsample.0"] = (4 * width, inner, 1, 1)
                norms[f"{name}.downsample.1"] = 4 * width
            inner = 4 * width
    kernels["conv2"], norms["bn2"] = (1024, 2048, 1, 1), 1024
    for level in range(1, 5):
        inner, width = 2048 >> level, 1024 >> level
        for branch in (1, 2):
            for k, (size, _) in enumerate(QUARTERS, 1):
                kernels[f"up{level}.conv{branch}_{k}"] = (width, inner, *size)
        kernels[f"up{level}.conv3"] = (width, width, 3, 3)
        norms |= {f"up{level}.{norm}": width for norm in ("bn1_1", "bn1_2", "bn2")}
    kernels["conv3"] = (1, 64, 3, 3)
    biases |= {name: shape[0] for name, shape in kernels.items() if name.startswith("up")}
    shapes = {f"{name}.weight": shape for name, shape in kernels.items()}
    shapes |= {f"{name}.bias": (channels,) for name, channels in biases.items()}
    return shapes | {f"{name}.{part}": (channels,) for name, channels in norms.items() for part in NORM}

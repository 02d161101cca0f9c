"""The structures against the system's own header."""

import ctypes
import shutil
import subprocess
from pathlib import Path

import pytest

from digit_driver import videodev2 as v4l2

HEADER = Path("/usr/include/linux/videodev2.h")
STRUCTURES = {
    "v4l2_capability": v4l2.Capability,
    "v4l2_pix_format": v4l2.PixFormat,
    "v4l2_format": v4l2.Format,
    "v4l2_streamparm": v4l2.StreamParm,
    "v4l2_captureparm": v4l2.CaptureParm,
    "v4l2_requestbuffers": v4l2.RequestBuffers,
    "v4l2_buffer": v4l2.Buffer,
    "v4l2_control": v4l2.Control,
}
OFFSETS = {
    ("v4l2_capability", "device_caps"): v4l2.Capability.device_caps,
    ("v4l2_format", "fmt"): v4l2.Format.fmt,
    ("v4l2_streamparm", "parm"): v4l2.StreamParm.parm,
    ("v4l2_buffer", "timestamp"): v4l2.Buffer.timestamp,
    ("v4l2_buffer", "sequence"): v4l2.Buffer.sequence,
    ("v4l2_buffer", "m"): v4l2.Buffer.m,
    ("v4l2_buffer", "length"): v4l2.Buffer.length,
}
NUMBERS = [name for name in vars(v4l2) if name.startswith("VIDIOC_")] + [
    "BUF_TYPE_VIDEO_CAPTURE",
    "MEMORY_MMAP",
    "FIELD_NONE",
    "CAP_VIDEO_CAPTURE",
    "CAP_STREAMING",
    "CAP_DEVICE_CAPS",
    "BUF_FLAG_ERROR",
    "BUF_FLAG_TIMESTAMP_MASK",
    "BUF_FLAG_TIMESTAMP_MONOTONIC",
    "CID_ZOOM_ABSOLUTE",
    "PIX_FMT_YUYV",
    "PIX_FMT_MJPEG",
]


@pytest.mark.skipif(not shutil.which("cc") or not HEADER.exists(), reason="needs a C compiler and kernel headers")
def test_structures_and_numbers_equal_the_kernels(tmp_path: Path) -> None:
    expressions = [f"sizeof(struct {name})" for name in STRUCTURES]
    expressions += [f"offsetof(struct {name}, {member})" for name, member in OFFSETS]
    expressions += [name if name.startswith("VIDIOC_") else f"V4L2_{name}" for name in NUMBERS]
    prints = "\n".join(f'printf("%lu\\n", (unsigned long)({expression}));' for expression in expressions)
    source = tmp_path / "probe.c"
    source.write_text(
        f"#include <stddef.h>\n#include <stdio.h>\n#include <linux/videodev2.h>\nint main(void) {{ {prints} }}"
    )
    subprocess.run(["cc", source, "-o", tmp_path / "probe"], check=True)
    probe = subprocess.run([tmp_path / "probe"], check=True, capture_output=True, text=True)
    kernel = dict(zip(expressions, map(int, probe.stdout.split()), strict=True))
    ours = [ctypes.sizeof(structure) for structure in STRUCTURES.values()]
    ours += [member.offset for member in OFFSETS.values()]
    ours += [getattr(v4l2, name) for name in NUMBERS]
    assert kernel == dict(zip(expressions, ours, strict=True))

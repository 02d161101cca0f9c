"""Chooses the source that the user's words mean."""

from __future__ import annotations

from midastouch_common.errors import InputError
from midastouch_common.user_paths import expanded

from .frame_source import FrameSource
from .image_folder import ImageFolder
from .v4l2_device import V4l2Camera, V4l2Settings
from .video_file import VideoFile


def make_source(device: V4l2Settings, replay_path: str = "", fps: float = 0.0, loop: bool = True) -> FrameSource:
    """A sensor if ``replay_path`` is empty, else the recording there: a folder of images or a video.

    Raises:
        InputError: nothing exists at ``replay_path``.
    """
    if not replay_path:
        return V4l2Camera(device)
    path = expanded(replay_path, "replay_path")
    if path.is_dir():
        return ImageFolder(path, fps, loop)
    if path.is_file():
        return VideoFile(path, fps, loop)
    raise InputError(f"replay_path: {path} does not exist; give an image folder, a YCB-Slide sequence or a video")

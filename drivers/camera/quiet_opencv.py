"""OpenCV that keeps its complaints to itself: what is wrong with a picture our own messages say."""

from __future__ import annotations

import os


def quiet_opencv() -> None:
    """Let OpenCV and FFmpeg write nothing between our messages; whoever wants that sets OPENCV_LOG_LEVEL."""
    import cv2

    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    if "OPENCV_LOG_LEVEL" not in os.environ:
        cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)

"""OpenCV, which pictures need and bodies do not: the one place that imports it for them."""

from __future__ import annotations

from taichi_soft.core.required_packages import require_packages

require_packages("a picture", "film", {"cv2": "opencv-python-headless"})

import cv2  # noqa: E402

__all__ = ["cv2"]

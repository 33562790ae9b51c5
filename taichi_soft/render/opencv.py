"""OpenCV, which pictures need and bodies do not: the one place that imports it for them."""

from __future__ import annotations

from taichi_soft.core.extras import require_extra

require_extra("film", "a picture needs", "cv2")

import cv2  # noqa: E402

__all__ = ["cv2"]

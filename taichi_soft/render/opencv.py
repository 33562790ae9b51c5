"""Import OpenCV. Only rendering needs OpenCV, and the other modules of `render` import it from here."""

from __future__ import annotations

from taichi_soft.core.extras import require_extra

require_extra("film", "rendering needs", "cv2")

import cv2  # noqa: E402

__all__ = ["cv2"]

"""Perspective camera that looks at a point."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.core.checks import as_array, as_count, as_number
from taichi_soft.core.errors import OptionError
from taichi_soft.render.arguments import as_point

Point = tuple[float, float, float]

# Depth of the near plane, as a fraction of the distance to the target.
NEAREST = 1e-3
# Largest elevation of a camera that frames a box [degrees].
STEEP = 89.0
# Sine of the smallest allowed angle between the line of sight and `up`.
STEEPEST = 1e-4


@dataclass(frozen=True)
class Camera:
    """Perspective camera at `eye` that looks at `target`. The z axis of the world points up.

    Args:
        eye: position of the camera [m].
        target: point at the centre of the image [m].
        up: direction that points up in the image, of any length.
        fov_degrees: field of view across the shorter side of the image, 1 to 150. An object that
            fits in a square image therefore fits in every image.
    Raises: OptionError for numbers that are not finite, an eye at the target, `up` along the line of sight
        or an angle out of range.
    """

    eye: Point
    target: Point = (0.0, 0.0, 0.0)
    up: Point = (0.0, 0.0, 1.0)
    fov_degrees: float = 40.0
    distance: float = field(init=False, repr=False)  # distance from the eye to the target [m]

    def __post_init__(self) -> None:
        for name in ("eye", "target", "up"):
            object.__setattr__(self, name, as_point(getattr(self, name), name))
        fov = as_number(self.fov_degrees, "fov_degrees", 1.0, 150.0)
        object.__setattr__(self, "fov_degrees", fov)
        distance = math.dist(self.eye, self.target)
        if not 1e-6 < distance < 1e6:
            raise OptionError(
                f"eye {self.eye} is {distance:g} m from target {self.target}: keep 1e-6 to 1e6 m"
            )
        object.__setattr__(self, "distance", distance)
        length = math.hypot(*self.up)
        forward = (np.array(self.target) - self.eye) / distance
        if length == 0.0 or float(np.linalg.norm(np.cross(forward, self.up))) < STEEPEST * length:
            raise OptionError(f"up {self.up} must have a length and not lie along the line of sight")

    @classmethod
    def framing(
        cls,
        lower: ArrayLike,
        upper: ArrayLike,
        *,
        azimuth: float = -60.0,
        elevation: float = 18.0,
        fov_degrees: float = 30.0,
        margin: float = 1.1,
        aspect: float = 1.0,
    ) -> Camera:
        """Return the closest camera that sees the whole box.

        Args:
            lower, upper: opposite corners of the box [m].
            azimuth: direction from the box to the eye in the ground plane, measured from the x axis towards
                the y axis [degrees].
            elevation: angle of the eye above the horizon, -89 to 89 [degrees].
            fov_degrees: see `Camera`.
            margin: size of the view relative to the box, 1 to 10.
            aspect: width divided by height of the image; with 1, the box fits in images of any aspect.
        Raises: OptionError for a box without extent or numbers out of range.
        """
        low, high = np.array(as_point(lower, "lower")), np.array(as_point(upper, "upper"))
        if (low > high).any() or not (low < high).any():
            raise OptionError(f"the box from {low.tolist()} to {high.tolist()} has no extent to frame")
        a = math.radians(as_number(azimuth, "azimuth", -1e4, 1e4))
        e = math.radians(as_number(elevation, "elevation", -STEEP, STEEP))
        half = math.tan(math.radians(as_number(fov_degrees, "fov_degrees", 1.0, 150.0)) / 2.0)
        half /= as_number(margin, "margin", 1.0, 10.0)
        ratio = as_number(aspect, "aspect", 0.05, 20.0)
        # Tangents of half the angle of view, horizontal and vertical. `fov_degrees` is the angle across the
        # shorter side.
        reach = half * np.array([max(ratio, 1.0), max(1.0 / ratio, 1.0)])
        outward = np.array([math.cos(a) * math.cos(e), math.sin(a) * math.cos(e), math.sin(e)])
        target = (low + high) / 2.0
        probe = cls(tuple(target + outward), tuple(target), fov_degrees=fov_degrees)
        corners = np.array(np.meshgrid(*zip(low, high, strict=True), indexing="ij")).reshape(3, -1).T
        seen = (corners - target) @ probe.axes.T
        # From distance d, a corner (x, y, z) is visible if |x| and |y| are at most reach * (d + z).
        distance = float(((np.abs(seen[:, :2]) / reach).max(axis=1) - seen[:, 2]).max())
        return cls(tuple(target + distance * outward), tuple(target), fov_degrees=fov_degrees)

    def seeing(
        self, lower: ArrayLike, upper: ArrayLike, *, margin: float = 1.1, aspect: float = 1.0
    ) -> Camera:
        """Return a camera with the same direction and angle, just far enough away to see the whole box.

        Args:
            lower, upper: opposite corners of the box [m].
            margin: size of the view relative to the box, 1 to 10.
            aspect: width divided by height of the image.
        Raises: the errors of `framing`.

        A camera that looks straight up or down is tilted slightly.
        """
        x, y, z = np.subtract(self.eye, self.target)
        return Camera.framing(
            lower,
            upper,
            azimuth=math.degrees(math.atan2(y, x)),
            elevation=min(max(math.degrees(math.asin(z / self.distance)), -STEEP), STEEP),
            fov_degrees=self.fov_degrees,
            margin=margin,
            aspect=aspect,
        )

    @property
    def axes(self) -> NDArray[np.float64]:
        """Unit vectors that point right, down and forward in the image, as rows (3, 3)."""
        forward = (np.array(self.target) - self.eye) / self.distance
        right = np.cross(forward, self.up)
        right /= np.linalg.norm(right)
        return np.array([right, np.cross(forward, right), forward])

    @property
    def near(self) -> float:
        """Depth of the near plane [m]."""
        return NEAREST * self.distance

    def matrix(self, width: int, height: int) -> NDArray[np.float64]:
        """Return the matrix (3, 4) that maps (x, y, z, 1) to (u d, v d, d).

        u is measured from the left and v from the top of the image [pixels]; d is the depth [m]. The first
        pixel covers u and v from 0 to 1.
        Args:
            width, height: size of the image [pixels].
        """
        width, height = as_count(width, "width"), as_count(height, "height")
        focal = min(width, height) / (2.0 * math.tan(math.radians(self.fov_degrees) / 2.0))
        lens = np.array([[focal, 0.0, width / 2.0], [0.0, focal, height / 2.0], [0.0, 0.0, 1.0]])
        turn = self.axes
        matrix: NDArray[np.float64] = lens @ np.column_stack([turn, -turn @ np.array(self.eye)])
        return matrix

    def project(self, points: ArrayLike, width: int, height: int) -> NDArray[np.float64]:
        """Project points into an image. Returns: pixels from the left and the top, and depth [m], (n, 3).

        Args:
            points: (n, 3) [m].
            width, height: size of the image [pixels].

        The pixels of points closer than `near` or behind the camera are NaN.
        """
        rows = as_array(points, "points", (None, 3), "m")
        seen = np.column_stack([rows, np.ones(len(rows))]) @ self.matrix(width, height).T
        depth = np.where(seen[:, 2] >= self.near, seen[:, 2], np.nan)
        return np.column_stack([seen[:, 0] / depth, seen[:, 1] / depth, seen[:, 2]])

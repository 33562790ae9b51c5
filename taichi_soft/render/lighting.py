"""Light, air and floor: the numbers behind what a picture looks like, all in linear light."""

from __future__ import annotations

import numpy as np

from taichi_soft.core.runtime import ti

vec3 = ti.types.vector(3, ti.f32)

# Light of a surface of albedo 1: the sun straight on, the sky on what faces up, the floor on what faces down.
# Their sum stays near 1, so that colours come out about as bright as they were asked for.
SUN = vec3(0.80, 0.75, 0.67)
SKY_LIGHT = vec3(0.42, 0.46, 0.52)
FLOOR_LIGHT = vec3(0.22, 0.20, 0.185)
HIGHLIGHT = 0.16  # mirror reflection of the sun, at its brightest
RIM = 0.10  # reflection of the sky at grazing angles

HORIZON = vec3(0.74, 0.78, 0.83)
ZENITH = vec3(0.27, 0.39, 0.56)
FLOOR_BRIGHT = vec3(0.60, 0.61, 0.62)
FLOOR_DARK = vec3(0.42, 0.44, 0.465)

# Direction to the sun when seen from the camera: over its left shoulder.
SUN_ELEVATION = np.radians(52.0)
SUN_AZIMUTH = np.radians(62.0)  # from the direction target to eye, positive to the left of the picture

# What the floor keeps of its light in the sun's full shadow: the sky's share.
SHADED = vec3(0.40, 0.43, 0.49)
# What it keeps right under a body that touches it, of what is left.
CONTACT = 0.45

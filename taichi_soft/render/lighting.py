"""Light, air and floor: the numbers behind what a picture looks like, all in linear light."""

from __future__ import annotations

import numpy as np

from taichi_soft.core.runtime import ti

vec3 = ti.types.vector(3, ti.f32)

# Light of a surface of albedo 1: the warm key straight on, the cool sky on what faces up, a weak cool fill
# from the side that the key leaves dark, and what the floor throws back on what faces down. What faces the
# key gets a little more than 1, which `tone` presses together.
SUN = vec3(1.10, 0.97, 0.80)
SKY_LIGHT = vec3(0.34, 0.39, 0.47)
FILL = vec3(0.085, 0.105, 0.14)
FLOOR_LIGHT = vec3(0.33, 0.295, 0.25)

# Matte: mirror reflection of the key at its brightest, and of the sky at grazing angles.
HIGHLIGHT = 0.10
RIM = 0.09
# Jelly: the same, how far light goes round the edge of the lit side, what is kept in shadow, what comes out
# on the far side.
JELLY_HIGHLIGHT = 0.65
JELLY_RIM = 0.55
JELLY_WRAP = 0.55
JELLY_KEPT = 0.45
JELLY_THROUGH = 0.42
# The share of what is seen of a jelly that is behind it, straight on; and how far its surface shifts what is
# seen through it [heights of the picture].
JELLY_CLEAR = 0.60
JELLY_BEND = 0.09
# Cloth: what its fibres throw back at grazing angles, what comes through, and how its back differs: so much
# of its colour is that of unbleached thread.
CLOTH_SHEEN = 0.22
CLOTH_THROUGH = 0.42
CLOTH_PLAIN = 0.62
THREAD = vec3(0.62, 0.58, 0.52)

HORIZON = vec3(0.93, 0.94, 0.95)  # what a rim mirrors
POOL = 0.14  # the floor is brighter by this share where the camera looks

# Direction to the key when seen from the camera: over its left shoulder. The fill comes from the right.
SUN_ELEVATION = np.radians(52.0)
SUN_AZIMUTH = np.radians(62.0)  # from the direction target to eye, positive to the left of the picture

# What the floor keeps of its light in the key's full shadow: the sky's share.
SHADED = vec3(0.36, 0.40, 0.47)
# What it keeps right under a body that touches it, of what is left.
CONTACT = 0.35

"""Constants of light, haze and floor, in linear light."""

from __future__ import annotations

import numpy as np

from taichi_soft.core.runtime import ti

vec3 = ti.types.vector(3, ti.f32)

# Light on a surface of albedo 1: the warm key at normal incidence, the cool sky on surfaces that face up, a
# weak cool fill opposite the key, and the floor's bounce light on surfaces that face down. A surface that
# faces the key receives slightly more than 1, which `tone` compresses.
SUN = vec3(1.10, 0.97, 0.80)
SKY_LIGHT = vec3(0.34, 0.39, 0.47)
FILL = vec3(0.085, 0.105, 0.14)
FLOOR_LIGHT = vec3(0.33, 0.295, 0.25)

# Matte: peak specular reflection of the key, and of the sky at grazing angles.
HIGHLIGHT = 0.10
RIM = 0.09
# Jelly: peak specular reflection of the key, and of the sky at grazing angles; light that wraps around the
# edge of the lit side; light that remains in shadow; light transmitted to the far side.
JELLY_HIGHLIGHT = 0.65
JELLY_RIM = 0.55
JELLY_WRAP = 0.55
JELLY_KEPT = 0.45
JELLY_THROUGH = 0.42
# Transparency of a jelly at normal incidence, and the refraction offset of its background [image heights].
JELLY_CLEAR = 0.60
JELLY_BEND = 0.09
# Cloth: sheen at grazing angles, transmission, and the weight of unbleached thread in the colour of its back.
CLOTH_SHEEN = 0.22
CLOTH_THROUGH = 0.42
CLOTH_PLAIN = 0.62
THREAD = vec3(0.62, 0.58, 0.52)

HORIZON = vec3(0.93, 0.94, 0.95)  # colour that rims reflect
POOL = 0.14  # relative extra brightness of the floor at the camera's target

# Direction to the key: over the camera's left shoulder. The fill comes from the right.
SUN_ELEVATION = np.radians(52.0)
SUN_AZIMUTH = np.radians(62.0)  # angle to the direction from target to eye, positive to the left in the image

# Fraction of light that remains on the floor in full shadow of the key: the light of the sky.
SHADED = vec3(0.36, 0.40, 0.47)
# Fraction of the light on the floor that is left directly under a touching body.
CONTACT = 0.35

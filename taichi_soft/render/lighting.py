"""Constants of light, haze and floor, in linear light."""

from __future__ import annotations

import numpy as np

from taichi_soft.core.runtime import ti

vec3 = ti.types.vector(3, ti.f32)

# Light that a surface of albedo 1 reflects. SUN: warm key light at normal incidence. SKY_LIGHT: cool light of
# the sky on surfaces that face up. FILL: weak cool light from the side opposite the key. FLOOR_LIGHT: light
# of the floor on surfaces that face down. A surface that faces the key reflects slightly more than 1 in
# total, and `tone` compresses the sum.
SUN = vec3(1.10, 0.97, 0.80)
SKY_LIGHT = vec3(0.34, 0.39, 0.47)
FILL = vec3(0.085, 0.105, 0.14)
FLOOR_LIGHT = vec3(0.33, 0.295, 0.25)

# Matte bodies. HIGHLIGHT: largest specular reflection of the key. RIM: reflection of the sky at grazing
# angles.
HIGHLIGHT = 0.10
RIM = 0.09
# Jelly. JELLY_HIGHLIGHT: largest specular reflection of the key. JELLY_RIM: reflection of the sky at grazing
# angles. JELLY_WRAP: light also reaches points beyond the edge of the lit side, until the cosine between
# normal and key is -JELLY_WRAP. JELLY_KEPT: fraction of light that remains in shadow. JELLY_THROUGH: weight
# of the light that is transmitted to the far side.
JELLY_HIGHLIGHT = 0.65
JELLY_RIM = 0.55
JELLY_WRAP = 0.55
JELLY_KEPT = 0.45
JELLY_THROUGH = 0.42
# JELLY_CLEAR: transparency at normal incidence. JELLY_BEND: largest distance by which refraction shifts the
# image behind a jelly [image heights].
JELLY_CLEAR = 0.60
JELLY_BEND = 0.09
# Cloth. CLOTH_SHEEN: sheen at grazing angles. CLOTH_THROUGH: fraction of the key light that is transmitted.
# CLOTH_PLAIN: weight of THREAD in the colour of the back. THREAD: colour of unbleached thread.
CLOTH_SHEEN = 0.22
CLOTH_THROUGH = 0.42
CLOTH_PLAIN = 0.62
THREAD = vec3(0.62, 0.58, 0.52)

HORIZON = vec3(0.93, 0.94, 0.95)  # light of the sky in reflections at grazing angles
POOL = 0.14  # relative increase of the floor's brightness at the camera's target

# Elevation and azimuth of the key light, which shines over the camera's left shoulder.
SUN_ELEVATION = np.radians(52.0)
SUN_AZIMUTH = np.radians(62.0)  # measured from the direction to the eye, positive to the left in the image

# Fraction of light that remains on the floor if the key light is fully blocked, for red, green and blue. The
# sky still lights the floor.
SHADED = vec3(0.36, 0.40, 0.47)
# Fraction of light that remains on the floor directly below a body that touches it.
CONTACT = 0.35

# mypy: ignore-errors
# (Taichi's argument annotations are values, which a type checker cannot read.)
"""Shade a point: look up its shadows, and compute the light that it reflects to the eye."""

from taichi_soft.core.runtime import ti
from taichi_soft.render import lighting
from taichi_soft.render.look import CLOTH_BACK, JELLY, MATTE

COARSE = 4.0
"""Edge of a texel in the far-shadow maps, in texels of the sun's shadow map."""

FAINTEST = 0.002
"""Strength of a shadow, from 0 to 1, below which the shadow is not drawn."""

SOFT_TAPS = 8
"""Width of the box filter that softens shadows on bodies [texels]."""

LIFT = 0.7
"""Shadow bias [texels]. The point whose shadow is looked up is shifted by this distance along the normal, and
again by this distance towards the sun."""


@ti.func
def bilinear(map: ti.template(), size, u, v):
    """Interpolate a (size, size) map at texel coordinates (u, v). Returns: the value; 0 outside the map."""
    value = 0.0
    x, y = u - 0.5, v - 0.5
    if x > 0.0 and y > 0.0 and x < size - 1.0 and y < size - 1.0:
        i, j = ti.i32(x), ti.i32(y)
        fx, fy = x - i, y - j
        near = map[j, i] + fx * (map[j, i + 1] - map[j, i])
        far = map[j + 1, i] + fx * (map[j + 1, i + 1] - map[j + 1, i])
        value = near + fy * (far - near)
    return value


@ti.func
def light_place(light: ti.template(), p):
    """Return the texel coordinates of a point in a shadow map, and its height towards the light [m].

    `light` is the matrix of the map, see `shadows.ShadowMaps`.
    """
    row = [
        light[k, 0] * p.x + light[k, 1] * p.y + light[k, 2] * p.z + light[k, 3] for k in ti.static((0, 1, 3))
    ]
    return ti.Vector(row)


@ti.func
def box_average(depth: ti.template(), size, left, top, fu, fv, height):
    """Return the lit fraction of a box of the shadow map. Texels are lit if no occluder is above `height`.

    The box has `SOFT_TAPS` texels per side and begins at (fu, fv) inside the texel (left, top).
    """
    lit = 0.0
    for j in range(SOFT_TAPS + 1):
        weight = ti.select(j == 0, 1.0 - fv, ti.select(j == SOFT_TAPS, fv, 1.0))
        for i in range(SOFT_TAPS + 1):
            share = weight * ti.select(i == 0, 1.0 - fu, ti.select(i == SOFT_TAPS, fu, 1.0))
            lit += ti.select(depth[(top + j) * size + left + i] > height, 0.0, share)
    return lit / (SOFT_TAPS * SOFT_TAPS)


@ti.func
def sunlight(light: ti.template(), depth: ti.template(), size, p, normal, texel):
    """Return the fraction of sunlight that reaches a point of a body, 0 to 1, averaged in a box of the map.

    The map contains only faces turned away from the sun, so that a body does not shadow its own lit side.
    `LIFT` prevents false shadows at the rim of the lit side.
    """
    place = light_place(light, p + LIFT * texel * normal)
    u, v, height = place.x - 0.5 * SOFT_TAPS, place.y - 0.5 * SOFT_TAPS, place.z + LIFT * texel
    left, top = ti.i32(ti.floor(u)), ti.i32(ti.floor(v))
    fu, fv = u - left, v - top
    lit = 1.0
    if left >= 0 and top >= 0 and left + SOFT_TAPS < size and top + SOFT_TAPS < size:
        # Sample nine texels first. If all nine are lit, or none is lit, assume the same for the whole box.
        open_texels = 0
        for j in range(3):
            for i in range(3):
                i_texel = (top + j * (SOFT_TAPS // 2)) * size + left + i * (SOFT_TAPS // 2)
                open_texels += ti.select(depth[i_texel] > height, 0, 1)
        lit = ti.select(open_texels == 0, 0.0, 1.0)
        if open_texels > 0 and open_texels < 9:
            share = box_average(depth, size, left, top, fu, fv, height)
            lit = share * share * (3.0 - 2.0 * share)
    return lit


@ti.func
def floor_shadow(
    at,
    light: ti.template(),
    near_shadow: ti.template(),
    far_shadow: ti.template(),
    far_height: ti.template(),
    contact_place: ti.template(),
    contact: ti.template(),
):
    """Return the fraction of light that a point of the floor loses to shadows, for red, green and blue."""
    lack = ti.Vector([0.0, 0.0, 0.0])
    place = light_place(light, at)
    u, v = place.x / COARSE, place.y / COARSE
    far = bilinear(far_shadow, far_shadow.shape[0], u, v)
    if far > FAINTEST:
        # Higher occluders cast softer shadows.
        height = bilinear(far_height, far_shadow.shape[0], u, v) / far
        near = bilinear(near_shadow, near_shadow.shape[0], place.x, place.y)
        lack = (near + (far - near) * ti.min(height, 1.0)) * (1.0 - lighting.SHADED)
    spot = light_place(contact_place, at)
    dark = bilinear(contact, contact.shape[0], spot.x, spot.y) * (1.0 - lighting.CONTACT)
    return 1.0 - (1.0 - lack) * (1.0 - dark)


@ti.func
def fifth_power(x):
    """Return x^5, the increase of reflection towards grazing angles in Schlick's approximation."""
    return x * x * x * x * x


@ti.func
def mirrored(normal, view, sun, doublings: ti.template()):
    """Return the specular highlight of the key light, 0 to 1. More doublings sharpen the highlight."""
    half = sun + view
    shine = ti.max(normal.dot(half) / ti.sqrt(ti.max(half.dot(half), 1e-12)), 0.0)
    for _ in ti.static(range(doublings)):
        shine *= shine
    return shine


@ti.func
def surroundings(normal, sun, above):
    """Return the ambient and fill light on a surface of albedo 1.

    Args:
        above: 0 on the floor, 1 well above the floor, where undersides receive the full light of the floor.
    """
    upward = 0.5 + 0.5 * normal.z
    below = lighting.FLOOR_LIGHT * (0.30 + 0.70 * above)
    over = lighting.SKY_LIGHT * (0.75 + 0.25 * above)
    # The fill light is horizontal and comes from the side opposite the key light.
    aside = 0.5 - 0.5 * (normal.x * sun.x + normal.y * sun.y) / ti.sqrt(1.0 - sun.z * sun.z)
    return below + (over - below) * upward + lighting.FILL * (aside * aside)


@ti.func
def dimmed(light, color, openness):
    """Return the ambient light at a point that sees only the fraction `openness` of its surroundings.

    Occluders are assumed to be about as bright as the surface. Otherwise, bright bodies would look dirty at
    contacts.
    """
    return light * (openness / (1.0 - 0.55 * (1.0 - openness) * color))


@ti.func
def smooth_rise(x):
    """Return 0 up to x = 0, 1 from x = 0.4, and a smooth transition between."""
    s = ti.math.clamp(2.5 * x, 0.0, 1.0)
    return s * s * (3.0 - 2.0 * s)


@ti.func
def matte_glow(color, normal, view, sun, around, key, lit, rim, openness):
    """Return the light that rubber sends to the eye.

    The arguments are those of `glow` and intermediate results of `glow`.
    """
    total = color * (key * ti.max(normal.dot(sun), 0.0) + dimmed(around, color, openness))
    total += lighting.SUN * (lighting.HIGHLIGHT * mirrored(normal, view, sun, 4) * lit)
    return total + lighting.HORIZON * (lighting.RIM * fifth_power(rim) * (0.5 + 0.5 * normal.z) * openness)


@ti.func
def jelly_glow(color, normal, view, sun, around, lit, rim, openness, behind):
    """Return the light that jelly sends to the eye, including scattered light and light from behind the body.

    The arguments are those of `glow` and intermediate results of `glow`.
    """
    facing = normal.dot(sun)
    # Thick parts have deeper colours than the rim.
    inner = color * ((0.62 + 0.38 * color) * (1.0 - rim * rim) + 1.25 * rim * rim)
    wrapped = ti.max((facing + lighting.JELLY_WRAP) / (1.0 + lighting.JELLY_WRAP), 0.0)
    kept = lighting.JELLY_KEPT + (1.0 - lighting.JELLY_KEPT) * lit * smooth_rise(facing)
    # Light transmitted from the lit side brightens the dark side.
    through = lighting.JELLY_THROUGH * ti.max(0.25 - facing, 0.0) * (0.4 + 0.6 * rim)
    total = inner * (lighting.SUN * (wrapped * kept + through) + dimmed(around, color, openness))
    clear = lighting.JELLY_CLEAR * (1.0 - rim * rim)
    total = (1.0 - clear) * total + clear * (0.08 + 0.92 * color) * behind
    shine = mirrored(normal, view, sun, 7) + 0.12 * mirrored(normal, view, sun, 4)
    total += lighting.SUN * (lighting.JELLY_HIGHLIGHT * shine * lit)
    mirror = lighting.JELLY_RIM * fifth_power(rim) * (0.6 + 0.4 * normal.z) * openness
    return total + lighting.HORIZON * mirror


@ti.func
def cloth_glow(look, color, normal, sun, around, key, rim, openness):
    """Return the light that cloth sends to the eye, including light transmitted from the other side.

    The arguments are those of `glow` and intermediate results of `glow`.
    """
    own = color
    if look == CLOTH_BACK:
        own = color + (lighting.THREAD - color) * lighting.CLOTH_PLAIN
    facing = normal.dot(sun)
    straight, tint = facing, own
    if facing < 0.0:  # transmitted light passes through more threads than reflected light
        straight, tint = -lighting.CLOTH_THROUGH * facing, own * (0.35 + 0.65 * color)
    total = tint * (key * straight) + own * dimmed(around, own, openness)
    return total + own * (lighting.CLOTH_SHEEN * rim * rim * rim) * (around + 0.5 * key)


@ti.func
def glow(look, color, normal, view, sun, lit, above, openness, behind):
    """Return the light that a point of a body sends to the eye.

    Args:
        look: look code, see `look`.
        color: albedo.
        normal, view, sun: unit vectors out of the body, to the eye, and to the key light.
        lit: fraction of the key light that reaches the lit side.
        above: see `surroundings`.
        openness: fraction of its surroundings that the point sees, 0 to 1.
        behind: light from behind a transparent body.
    """
    around = surroundings(normal, sun, above)
    key = lighting.SUN * (lit * (0.45 + 0.55 * openness))
    rim = 1.0 - ti.math.clamp(normal.dot(view), 0.0, 1.0)
    total = ti.Vector([0.0, 0.0, 0.0])
    if look == MATTE:
        total = matte_glow(color, normal, view, sun, around, key, lit, rim, openness)
    elif look == JELLY:
        total = jelly_glow(color, normal, view, sun, around, lit, rim, openness, behind)
    else:
        total = cloth_glow(look, color, normal, sun, around, key, rim, openness)
    return total

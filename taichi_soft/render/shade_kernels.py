# mypy: ignore-errors
# (Taichi's argument annotations are values, which a type checker cannot read.)
"""Samples to colours: floor and sky once per camera, bodies and shadows every frame."""

from taichi_soft.render import look
from taichi_soft.render.raster_kernels import TILE, int_rows, ints, reals, row_vec3, rows
from taichi_soft.runtime import ti

vec3 = ti.types.vector(3, ti.f32)
image = ti.types.ndarray(dtype=ti.f32, ndim=3)
picture = ti.types.ndarray(dtype=ti.u8, ndim=3)

COARSE = 4.0
"""Texels of the sun's map along one of the maps of far shadows."""

FAINTEST = 0.002
"""Share of a shadow below which it is not drawn."""

SOFT_TAPS = 4
"""Width of the box over which shadows on bodies are averaged [texels of the shadow map]."""


@ti.func
def smoothstep(low, high, x):
    """0 below `low`, 1 above `high`, smooth between."""
    s = ti.math.clamp((x - low) / (high - low), 0.0, 1.0)
    return s * s * (3.0 - 2.0 * s)


@ti.func
def pixel_ray(rays: ti.template(), u, v):
    """Direction through a pixel [m per m of depth], not of unit length; `rays` is (3, 3), columns u, v, 1."""
    return ti.Vector([rays[k, 0] * u + rays[k, 1] * v + rays[k, 2] for k in ti.static(range(3))])


@ti.func
def check_average(x, width):
    """Integral mean of a square wave of period 2 (+1 on [0, 1), -1 on [1, 2)) over `width` about x."""
    low, high = (x - 0.5 * width) * 0.5, (x + 0.5 * width) * 0.5
    low_wave = ti.abs(low - ti.floor(low) - 0.5)
    high_wave = ti.abs(high - ti.floor(high) - 0.5)
    return 2.0 * (low_wave - high_wave) / width


@ti.func
def write_pixel(color, encode: ti.template(), out: ti.template(), x, y):
    """Store linear light as sRGB; `encode` is sRGB, 0 to 255, of linear light 0 to 1 in equal steps."""
    # A fixed pattern of less than one step of brightness, against bands in smooth gradients.
    grain = ti.math.fract(52.9829189 * ti.math.fract(0.06711056 * x + 0.00583715 * y))
    for k in ti.static(range(3)):
        level = encode[ti.i32(ti.math.clamp(color[k], 0.0, 1.0) * (encode.shape[0] - 1) + 0.5)]
        out[y, x, k] = ti.u8(ti.min(level + grain, 255.0))


@ti.kernel
def paint_backdrop(
    rays: rows,
    eye: vec3,
    target: vec3,
    floor: ti.f32,
    has_floor: ti.i32,
    check: ti.f32,
    fade: ti.f32,
    encode: reals,
    out: image,
    plain: picture,
):
    """Sky and floor without shadows.

    Args:
        rays: see `pixel_ray`.
        target: the checks fade with the distance from it [m].
        check: edge of a check [m].
        fade: distance at which the floor has become air [m].
        out: (height, width, 4), linear light and the share of it that is floor.
        plain: (height, width, 3), that light as sRGB.
    """
    for y, x in ti.ndrange(out.shape[0], out.shape[1]):
        ray = pixel_ray(rays, x + 0.5, y + 0.5)
        up = ray.z / ray.norm()
        # Brightest at the horizon, deeper upwards; below it, where the floor has faded, it stays bright.
        color = look.HORIZON + (look.ZENITH - look.HORIZON) * smoothstep(-0.05, 0.9, ti.sqrt(ti.max(up, 0.0)))
        share = 0.0
        depth = (floor - eye.z) / ti.select(ti.abs(ray.z) > 1e-9, ray.z, 1e-9)
        if has_floor != 0 and depth > 0.0 and eye.z > floor:
            at = eye + depth * ray
            # Size of the pixel on the floor along x and y, to average the checks over it.
            right = pixel_ray(rays, x + 1.5, y + 0.5)
            below = pixel_ray(rays, x + 0.5, y + 1.5)
            steep = ti.min(ray.z, -1e-6)
            at_right = eye + (floor - eye.z) / ti.min(right.z, -1e-6) * right
            at_below = eye + (floor - eye.z) / ti.min(below.z, -1e-6) * below
            wide_x = (ti.abs(at_right.x - at.x) + ti.abs(at_below.x - at.x)) / check + 1e-4
            wide_y = (ti.abs(at_right.y - at.y) + ti.abs(at_below.y - at.y)) / check + 1e-4
            wave = check_average(at.x / check, wide_x) * check_average(at.y / check, wide_y)
            tiles = look.FLOOR_DARK + (look.FLOOR_BRIGHT - look.FLOOR_DARK) * (0.5 + 0.5 * wave)
            far = ti.sqrt((at.x - target.x) ** 2 + (at.y - target.y) ** 2) / fade
            share = ti.exp(-2.5 * far * far) * smoothstep(0.0, 0.06, -steep / ray.norm())
            color = color + (tiles - color) * share
        for k in ti.static(range(3)):
            out[y, x, k] = color[k]
        out[y, x, 3] = share
        write_pixel(color, encode, plain, x, y)


@ti.func
def bilinear(map: ti.template(), size, u, v):
    """Value of a (size, size) map at texel coordinates (u, v), 0 outside."""
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
    """Texel coordinates and height towards the light [m] of a point; `light` is (4, 4), rows u, v, -, q."""
    row = [
        light[k, 0] * p.x + light[k, 1] * p.y + light[k, 2] * p.z + light[k, 3] for k in ti.static((0, 1, 3))
    ]
    return ti.Vector(row)


@ti.func
def sunlight(light: ti.template(), depth: ti.template(), size, p, bias):
    """Share of the sun that reaches a point of a body, 0 to 1, averaged over a box in the shadow map."""
    place = light_place(light, p)
    u, v, height = place.x - 0.5 * SOFT_TAPS, place.y - 0.5 * SOFT_TAPS, place.z + bias
    left, top = ti.i32(ti.floor(u)), ti.i32(ti.floor(v))
    fu, fv = u - left, v - top
    lit = 1.0
    if left >= 0 and top >= 0 and left + SOFT_TAPS < size and top + SOFT_TAPS < size:
        lit = 0.0
        for j in range(SOFT_TAPS + 1):
            weight = ti.select(j == 0, 1.0 - fv, ti.select(j == SOFT_TAPS, fv, 1.0))
            for i in range(SOFT_TAPS + 1):
                share = weight * ti.select(i == 0, 1.0 - fu, ti.select(i == SOFT_TAPS, fu, 1.0))
                lit += ti.select(depth[(top + j) * size + left + i] > height, 0.0, share)
        lit /= SOFT_TAPS * SOFT_TAPS
    return lit


@ti.func
def glow(color, normal, view, sun, lit, above):
    """Light that a point of a body sends to the eye.

    Args:
        color: albedo. normal, view, sun: unit vectors out of the body, to the eye and to the sun.
        lit: share of the sun that reaches it.
        above: 0 on the floor to 1 well above it, where its underside sees light.
    """
    upward = 0.5 + 0.5 * normal.z
    around = look.FLOOR_LIGHT * (0.35 + 0.65 * above) * (1.0 - upward) + look.SKY_LIGHT * upward * (
        0.7 + 0.3 * above
    )
    facing = ti.max(normal.dot(sun), 0.0) * lit
    half = sun + view
    shine = ti.max(normal.dot(half) / ti.sqrt(half.dot(half)), 0.0)
    for _ in ti.static(range(5)):
        shine *= shine
    grazing = 1.0 - ti.max(normal.dot(view), 0.0)
    grazing = grazing * grazing
    rim = look.RIM * grazing * grazing * upward
    return (
        color * (look.SUN * facing + around) + look.HORIZON * rim + look.SUN * (look.HIGHLIGHT * shine * lit)
    )


@ti.kernel
def shade(
    rays: rows,
    eye: vec3,
    sun: vec3,
    floor: ti.f32,
    reach: ti.f32,
    light: rows,
    texel: ti.f32,
    light_depth: reals,
    near_shadow: rows,
    far_shadow: rows,
    far_height: rows,
    contact: rows,
    contact_place: rows,
    backdrop: image,
    plain: picture,
    positions: rows,
    normals: rows,
    colors: rows,
    triangles: int_rows,
    planes: rows,
    tile_begin: ints,
    tile_shadowed: ints,
    samples: rows,
    owner: ints,
    encode: reals,
    out: picture,
):
    """The picture: average of what its samples see, as sRGB.

    Args:
        reach: height [m] up to which the floor darkens what is above it.
        light, texel, light_depth: the sun's shadow map, as `shadows.ShadowMaps` has them.
        near_shadow, far_shadow, far_height, contact, contact_place: the floor's shadows, from there too.
        tile_shadowed: 0 for tiles whose floor no shadow reaches.
        backdrop, plain: what `paint_backdrop` painted.
        out: (height, width, 3).
    """
    width = out.shape[1]
    tiles_across = (width + TILE - 1) // TILE
    for tile in range(tile_begin.shape[0] - 1):
        left, top = tile % tiles_across * TILE, tile // tiles_across * TILE
        count = samples.shape[0]
        if tile_begin[tile + 1] == tile_begin[tile]:
            count = 0
        for y in range(top, ti.min(top + TILE, out.shape[0])):
            for x in range(left, ti.min(left + TILE, width)):
                total = ti.Vector([0.0, 0.0, 0.0])
                open_samples = ti.select(count == 0, 1, 0)
                done = -1
                last = ti.Vector([0.0, 0.0, 0.0])
                for s in range(count):
                    t = owner[(y * width + x) * count + s]
                    if t < 0:
                        open_samples += 1
                    else:
                        if t != done:
                            done = t
                            u, v = x + 0.5 + samples[s, 0], y + 0.5 + samples[s, 1]
                            w0 = planes[t, 0] * u + planes[t, 1] * v + planes[t, 2]
                            w1 = planes[t, 3] * u + planes[t, 4] * v + planes[t, 5]
                            w2 = planes[t, 6] * u + planes[t, 7] * v + planes[t, 8]
                            whole = w0 + w1 + w2
                            w0, w1 = w0 / whole, w1 / whole
                            w2 = 1.0 - w0 - w1
                            i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
                            p = (
                                w0 * row_vec3(positions, i)
                                + w1 * row_vec3(positions, j)
                                + w2 * row_vec3(positions, k)
                            )
                            n = (
                                w0 * row_vec3(normals, i)
                                + w1 * row_vec3(normals, j)
                                + w2 * row_vec3(normals, k)
                            )
                            c = w0 * row_vec3(colors, i) + w1 * row_vec3(colors, j) + w2 * row_vec3(colors, k)
                            n = n / ti.sqrt(ti.max(n.dot(n), 1e-20))
                            view = (eye - p) / ti.sqrt((eye - p).dot(eye - p))
                            lit = 0.0
                            if n.dot(sun) > 0.0:
                                lit = sunlight(
                                    light,
                                    light_depth,
                                    near_shadow.shape[0],
                                    p + (2.0 * texel) * n,
                                    2.0 * texel,
                                )
                            above = smoothstep(0.0, reach, p.z - floor)
                            last = glow(c, n, view, sun, lit, above)
                        total += last
                shadow = ti.Vector([0.0, 0.0, 0.0])
                if open_samples > 0 and tile_shadowed[tile] != 0 and backdrop[y, x, 3] > 0.004:
                    ray = pixel_ray(rays, x + 0.5, y + 0.5)
                    at = eye + ((floor - eye.z) / ti.min(ray.z, -1e-9)) * ray
                    place = light_place(light, at)
                    far = bilinear(far_shadow, far_shadow.shape[0], place.x / COARSE, place.y / COARSE)
                    if far > FAINTEST:
                        # The higher what casts the shadow, the softer its edge.
                        height = (
                            bilinear(far_height, far_shadow.shape[0], place.x / COARSE, place.y / COARSE)
                            / far
                        )
                        near = bilinear(near_shadow, near_shadow.shape[0], place.x, place.y)
                        shadow = (near + (far - near) * ti.min(height, 1.0)) * (1.0 - look.SHADED)
                    spot = light_place(contact_place, at)
                    dark = bilinear(contact, contact.shape[0], spot.x, spot.y) * (1.0 - look.CONTACT)
                    shadow = backdrop[y, x, 3] * (1.0 - (1.0 - shadow) * (1.0 - dark))
                if open_samples == ti.max(count, 1) and shadow.x <= 0.0:
                    for k in ti.static(range(3)):
                        out[y, x, k] = plain[y, x, k]
                    continue
                if open_samples > 0:
                    color = ti.Vector([backdrop[y, x, 0], backdrop[y, x, 1], backdrop[y, x, 2]])
                    total += open_samples * color * (1.0 - shadow)
                total /= ti.max(count, 1)
                write_pixel(total, encode, out, x, y)

# mypy: ignore-errors
# (Taichi's argument annotations are values, which a type checker cannot read.)
"""Paint sky and floor once per camera, and convert linear light to pixels."""

from taichi_soft.core.runtime import ti
from taichi_soft.render import lighting
from taichi_soft.render.kernel_types import image, picture, reals, rows, vec3
from taichi_soft.render.tone import WHITE


@ti.func
def smoothstep(low, high, x):
    """Return 0 below `low`, 1 above `high`, and a smooth transition between both."""
    s = ti.math.clamp((x - low) / (high - low), 0.0, 1.0)
    return s * s * (3.0 - 2.0 * s)


@ti.func
def pixel_ray(rays: ti.template(), u, v):
    """Return the direction from the eye through the image point (u, v), scaled to a depth of 1.

    `rays` is (3, 3) and maps (u, v, 1) to the direction.
    """
    return ti.Vector([rays[k, 0] * u + rays[k, 1] * v + rays[k, 2] for k in ti.static(range(3))])


@ti.func
def check_average(x, width):
    """Average a square wave over an interval of length `width` centred at x.

    The wave is +1 on [0, 1) and -1 on [1, 2), with period 2.
    """
    low, high = (x - 0.5 * width) * 0.5, (x + 0.5 * width) * 0.5
    low_wave = ti.abs(low - ti.floor(low) - 0.5)
    high_wave = ti.abs(high - ti.floor(high) - 0.5)
    return 2.0 * (low_wave - high_wave) / width


@ti.func
def write_pixel(color, encode: ti.template(), out: ti.template(), x, y):
    """Store linear light as sRGB in `out`. `encode` is the result of `tone.encode_table`."""
    # Ordered dithering by less than one step of brightness prevents banding in smooth gradients.
    grain = ti.math.fract(52.9829189 * ti.math.fract(0.06711056 * x + 0.00583715 * y))
    for k in ti.static(range(3)):
        root = ti.sqrt(ti.math.clamp(color[k] / WHITE, 0.0, 1.0))
        level = encode[ti.math.clamp(ti.i32(root * (encode.shape[0] - 1) + 0.5), 0, encode.shape[0] - 1)]
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
    horizon: vec3,
    zenith: vec3,
    bright: vec3,
    dark: vec3,
    encode: reals,
    out: image,
    plain: picture,
):
    """Paint sky and floor without shadows.

    Args:
        rays: directions of pixels, see `pixel_ray`.
        eye: position of the camera [m].
        target: point around which checks are visible; they fade with the distance from it [m].
        check: edge of a check [m].
        fade: distance at which the floor has faded into the sky [m].
        horizon, zenith, bright, dark: see `BackdropColors`.
        out: (height, width, 4). Three channels are linear light. The fourth is the weight of the floor, from
            0 (only sky) to 1 (only floor).
        plain: (height, width, 3), the first three channels of `out` as sRGB.
    """
    for y, x in ti.ndrange(out.shape[0], out.shape[1]):
        ray = pixel_ray(rays, x + 0.5, y + 0.5)
        up = ray.z / ray.norm()
        # Below the horizon, use the colour of the horizon, because the distant floor fades into this colour.
        color = horizon + (zenith - horizon) * smoothstep(-0.05, 0.65, ti.sqrt(ti.max(up, 0.0)))
        share = 0.0
        depth = (floor - eye.z) / ti.select(ti.abs(ray.z) > 1e-9, ray.z, 1e-9)
        if has_floor != 0 and depth > 0.0 and eye.z > floor:
            at = eye + depth * ray
            # Average the checks over the pixel's size on the floor along x and y.
            right = pixel_ray(rays, x + 1.5, y + 0.5)
            below = pixel_ray(rays, x + 0.5, y + 1.5)
            steep = ti.min(ray.z, -1e-6)
            at_right = eye + (floor - eye.z) / ti.min(right.z, -1e-6) * right
            at_below = eye + (floor - eye.z) / ti.min(below.z, -1e-6) * below
            wide_x = (ti.abs(at_right.x - at.x) + ti.abs(at_below.x - at.x)) / check + 1e-4
            wide_y = (ti.abs(at_right.y - at.y) + ti.abs(at_below.y - at.y)) / check + 1e-4
            wave = check_average(at.x / check, wide_x) * check_average(at.y / check, wide_y)
            # Fade out the check pattern if a check is about as small as a pixel. Small checks would shimmer.
            wave *= 1.0 - smoothstep(0.15, 0.7, ti.max(wide_x, wide_y))
            tiles = dark + (bright - dark) * (0.5 + 0.5 * wave)
            far = ti.sqrt((at.x - target.x) ** 2 + (at.y - target.y) ** 2) / fade
            tiles *= 1.0 + lighting.POOL * ti.exp(-16.0 * far * far)
            share = ti.exp(-2.5 * far * far) * smoothstep(0.0, 0.10, -steep / ray.norm())
            color = color + (tiles - color) * share
        for k in ti.static(range(3)):
            out[y, x, k] = color[k]
        out[y, x, 3] = share
        write_pixel(color, encode, plain, x, y)

# mypy: ignore-errors
# (Taichi's argument annotations are values, which a type checker cannot read.)
"""Sample textures in kernels."""

from taichi_soft.core.runtime import ti


@ti.func
def texel_light(texels: ti.template(), decode: ti.template(), i):
    """Return the linear light of texel i."""
    return ti.Vector([decode[ti.i32(texels[i, k])] for k in ti.static(range(3))])


@ti.func
def level_light(texels: ti.template(), levels: ti.template(), decode: ti.template(), level, uv):
    """Return the linear light at `uv` in one mip level, bilinear between texel centres.

    The texture repeats.
    """
    start, width, height = levels[level, 0], levels[level, 1], levels[level, 2]
    x = (uv.x - ti.floor(uv.x)) * width - 0.5
    y = (1.0 - (uv.y - ti.floor(uv.y))) * height - 0.5
    left, top = ti.i32(ti.floor(x)), ti.i32(ti.floor(y))
    across, down = x - ti.floor(x), y - ti.floor(y)
    total = ti.Vector([0.0, 0.0, 0.0])
    for j, i in ti.static(ti.ndrange(2, 2)):
        # The remainders are valid indices even if `uv` is NaN.
        at = start + (top + j) % height * width + (left + i) % width
        share = (across if i else 1.0 - across) * (down if j else 1.0 - down)
        total += share * texel_light(texels, decode, at)
    return total


@ti.func
def texture_light(
    texels: ti.template(), levels: ti.template(), decode: ti.template(), first, uv, uv_right, uv_below
):
    """Sample a texture at `uv` with trilinear filtering; `first` is the largest mip level.

    Args:
        uv_right, uv_below: texture coordinates at the next pixels to the right and below.
    """
    size = ti.Vector([ti.f32(levels[first, 1]), ti.f32(levels[first, 2])])
    right, below = (uv_right - uv) * size, (uv_below - uv) * size
    wide = ti.sqrt(ti.max(right.dot(right), below.dot(below)))  # [texels]
    steps = 0.0
    if wide > 1.0:  # NaN selects the largest level
        steps = ti.min(ti.log(wide) / ti.log(2.0), ti.f32(levels[first, 3]))
    finer = ti.math.clamp(ti.i32(steps), 0, levels[first, 3])
    coarser = ti.min(finer + 1, levels[first, 3])
    light = level_light(texels, levels, decode, first + finer, uv)
    share = steps - finer
    if share > 0.0:
        light += share * (level_light(texels, levels, decode, first + coarser, uv) - light)
    return light

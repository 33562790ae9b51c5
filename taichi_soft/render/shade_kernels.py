# mypy: ignore-errors
# (Taichi's argument annotations are values, which a type checker cannot read.)
"""Shade the samples of a frame: lit bodies, and the floor with its shadows."""

from taichi_soft.core.runtime import ti
from taichi_soft.render import lighting
from taichi_soft.render.backdrop_kernels import pixel_ray, smoothstep, write_pixel
from taichi_soft.render.kernel_types import (
    TILE,
    byte_rows,
    image,
    int_rows,
    ints,
    picture,
    reals,
    row_vec2,
    row_vec3,
    rows,
    vec3,
)
from taichi_soft.render.light_funcs import bilinear, floor_shadow, glow, light_place, sunlight
from taichi_soft.render.look import CLOTH, JELLY
from taichi_soft.render.occlusion_kernels import openness_at
from taichi_soft.render.texture_funcs import texture_light


@ti.func
def corner_weights(planes: ti.template(), t, u, v):
    """Return the perspective-correct barycentric weights of triangle t at (u, v)."""
    w = ti.Vector(
        [planes[t, 3 * i] * u + planes[t, 3 * i + 1] * v + planes[t, 3 * i + 2] for i in ti.static(range(3))]
    )
    return w / w.sum()


@ti.func
def interpolate(vertex_rows: ti.template(), triangles: ti.template(), t, weights):
    """Interpolate a vertex quantity, (n, 3), inside triangle t."""
    a, b, c = (
        row_vec3(vertex_rows, triangles[t, 0]),
        row_vec3(vertex_rows, triangles[t, 1]),
        row_vec3(vertex_rows, triangles[t, 2]),
    )
    return weights.x * a + weights.y * b + weights.z * c


@ti.func
def place_on_texture(uvs: ti.template(), triangles: ti.template(), planes: ti.template(), t, u, v):
    """Return the texture coordinates of triangle t at (u, v), extrapolated outside the triangle."""
    weights = corner_weights(planes, t, u, v)
    a, b, c = (
        row_vec2(uvs, triangles[t, 0]),
        row_vec2(uvs, triangles[t, 1]),
        row_vec2(uvs, triangles[t, 2]),
    )
    return weights.x * a + weights.y * b + weights.z * c


@ti.func
def seen_through(opaque: ti.template(), light_of_byte: ti.template(), rays: ti.template(), normal, x, y):
    """Return the light that a surface at pixel (x, y) transmits from the image behind it.

    Refraction shifts the image, depending on the normal of the surface.
    """
    size = ti.Vector([opaque.shape[1], opaque.shape[0]])
    right = ti.Vector([rays[k, 0] for k in ti.static(range(3))]).normalized()
    down = ti.Vector([rays[k, 1] for k in ti.static(range(3))]).normalized()
    shift = -lighting.JELLY_BEND * size.y * ti.Vector([normal.dot(right), normal.dot(down)])
    u = ti.math.clamp(x + ti.i32(ti.round(shift.x)), 0, size.x - 1)
    v = ti.math.clamp(y + ti.i32(ti.round(shift.y)), 0, size.y - 1)
    return ti.Vector([light_of_byte[ti.i32(opaque[v, u, k])] for k in ti.static(range(3))])


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
    opaque: picture,
    light_of_byte: reals,
    positions: rows,
    normals: rows,
    colors: rows,
    triangles: int_rows,
    looks: ints,
    q_map: rows,
    hidden: rows,
    uvs: rows,
    first_level: ints,
    texels: byte_rows,
    levels: int_rows,
    decode: reals,
    planes: rows,
    tile_begin: ints,
    tile_shadowed: ints,
    samples: rows,
    owner: ints,
    encode: reals,
    out: picture,
):
    """Shade the image: average the light of each pixel's samples, and store it as sRGB.

    Args:
        reach: height above the floor up to which the floor darkens surfaces [m].
        light, texel, light_depth: the sun's shadow map, see `shadows.ShadowMaps`.
        near_shadow, far_shadow, far_height, contact, contact_place: shadows of the floor, see
            `shadows.ShadowMaps`.
        looks: codes of the triangles, see `look`.
        q_map, hidden: see `occlusion.Occlusion`.
        uvs, first_level, texels, levels: see `texture.SceneTextures`; a texture is multiplied by the vertex
            colours.
        decode: linear light of sRGB 0 to 255.
        tile_shadowed: 0 for tiles whose floor has no shadow.
        backdrop, plain: results of `paint_backdrop`.
        opaque: image of the opaque surfaces, visible through transparent ones.
        light_of_byte: see `tone.light_table`.
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
                            weights = corner_weights(planes, t, u, v)
                            p = interpolate(positions, triangles, t, weights)
                            n = interpolate(normals, triangles, t, weights)
                            c = interpolate(colors, triangles, t, weights)
                            if first_level[t] >= 0:
                                c *= texture_light(
                                    texels,
                                    levels,
                                    decode,
                                    first_level[t],
                                    place_on_texture(uvs, triangles, planes, t, u, v),
                                    place_on_texture(uvs, triangles, planes, t, u + 1.0, v),
                                    place_on_texture(uvs, triangles, planes, t, u, v + 1.0),
                                )
                            n = n / ti.sqrt(ti.max(n.dot(n), 1e-20))
                            view = (eye - p) / ti.sqrt((eye - p).dot(eye - p))
                            look = looks[t]
                            # The key light can shine on the other side of a cloth.
                            outward = n
                            if look >= CLOTH and n.dot(sun) < 0.0:
                                outward = -n
                            lit = 0.0
                            if outward.dot(sun) > 0.0:
                                lit = sunlight(light, light_depth, near_shadow.shape[0], p, outward, texel)
                            spot = light_place(contact_place, p)
                            above = smoothstep(0.0, reach, p.z - floor)
                            above *= 1.0 - 0.6 * bilinear(contact, contact.shape[0], spot.x, spot.y)
                            q = planes[t, 9] * (x + 0.5) + planes[t, 10] * (y + 0.5) + planes[t, 11]
                            openness = openness_at(q_map, hidden, x, y, q)
                            behind = ti.Vector([0.0, 0.0, 0.0])
                            if look == JELLY:
                                behind = seen_through(opaque, light_of_byte, rays, n, x, y)
                            last = glow(look, c, n, view, sun, lit, above, openness, behind)
                        total += last
                shadow = ti.Vector([0.0, 0.0, 0.0])
                if open_samples > 0 and tile_shadowed[tile] != 0 and backdrop[y, x, 3] > 0.004:
                    ray = pixel_ray(rays, x + 0.5, y + 0.5)
                    at = eye + ((floor - eye.z) / ti.min(ray.z, -1e-9)) * ray
                    shadow = backdrop[y, x, 3] * floor_shadow(
                        at, light, near_shadow, far_shadow, far_height, contact_place, contact
                    )
                if open_samples == ti.max(count, 1) and shadow.x <= 0.0:
                    for k in ti.static(range(3)):
                        out[y, x, k] = plain[y, x, k]
                    continue
                if open_samples > 0:
                    color = ti.Vector([backdrop[y, x, 0], backdrop[y, x, 1], backdrop[y, x, 2]])
                    total += open_samples * color * (1.0 - shadow)
                total /= ti.max(count, 1)
                write_pixel(total, encode, out, x, y)

"""Read all values of a world and its handles, and make a body fail."""

import contextlib
import dataclasses
import inspect
import warnings

import numpy as np
from public_face import READERS

from taichi_soft import MeshError, SphereShape, StateError

UP = np.array([0.01, 0.02, 3.0])
NOT_NUMBERS = {"settings", "asset", "material", "mesh", "function", "bodies_inside"}


def numbers_in(value):
    """Return all floats in a value that was read, except those of other objects of the world."""
    if isinstance(value, np.ndarray):
        return [value] if value.dtype.kind == "f" else []
    if isinstance(value, (float, np.floating)):
        return [np.array(value)]
    if isinstance(value, (tuple, list)):
        return [each for part in value for each in numbers_in(part)]
    if dataclasses.is_dataclass(value):
        return numbers_in([getattr(value, field.name) for field in dataclasses.fields(value)])
    return []


def readings(world, adapter):
    """Yield name and value of everything that a built world and its handles return (`READERS`)."""
    handles = {
        "World": [world],
        "Body": world.bodies,
        "Collider": world.colliders,
        "Frame": world.frames,
        "Grab": world.grabs,
        "Attachment": [each for body in world.bodies for each in body.attachments],
        "Joint": world.joints,
        "Motor": world.motors,
        "EngineAdapter": [adapter],
    }
    for kind, each in handles.items():
        for number, handle in enumerate(each):
            for name in (each for each in READERS[kind].split() if each not in NOT_NUMBERS):
                with contextlib.suppress(MeshError):  # bodies without tetrahedra have no stress
                    found = getattr(handle, name)
                    yield f"{kind} {number}.{name}", found() if callable(found) else found
    for body in world.bodies:
        yield "positions", (body.positions(), world.read_positions(body, 0.5), adapter.positions(body))
        with contextlib.suppress(MeshError):  # a rope has no surface
            skin = body.render_mesh()
            yield "render_mesh", (world.read_render_mesh(skin, 0.5), adapter.render_mesh(skin))
        middle = body.center_of_mass()
        yield "raycast", world.raycast(middle + UP, -UP)
        with contextlib.suppress(StateError):  # the schedule "flat" has no queries on colliders
            yield "raycast", world.raycast(middle + UP, -UP, colliders=True)
            yield "shapecast", world.shapecast(SphereShape(0.1), middle + UP, -UP)
        yield "closest_point", world.closest_point(middle + UP, max_distance=10.0)
        yield "overlaps", (world.overlap_sphere(middle, 1.0), world.overlap_box(middle, (1, 1, 1)))
    yield "events", world.drain_events()


def not_finite(world, adapter):
    """Return the names of values that contain NaN or infinity."""
    wrong = []
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)  # NumPy warns when it computes NaN
        for name, value in readings(world, adapter):
            wrong += [name for each in numbers_in(value) if not np.isfinite(each).all()]
    return wrong


def burst(body):
    """Make a body fail: set speeds just below the limit, so that forces make some vertices exceed it."""
    signs = np.random.default_rng(body.index).choice([-1.0, 1.0], size=(body.vertex_count, 3))
    body.set_motion(body.positions(), 1.9e4 * signs)


def leave(body):
    """Make a body fail: move it beyond the largest valid coordinate in one step."""
    rows = np.ones((body.vertex_count, 3))
    body.set_motion(9.9999e6 * rows, 1.9e4 * rows)


CHANGING = {"build", "step", "save", "drain_events", "remove"}
"""Methods without arguments that change a world, although they are not recorded."""


def readouts(handle):
    """Return the names of a handle's properties and methods without arguments, found by reflection."""
    kind, names = type(handle), {"__repr__"}
    for name in dir(kind):
        found = inspect.getattr_static(kind, name)
        if isinstance(found, property):
            names.add(name)
        elif inspect.isfunction(found) and name not in CHANGING and not hasattr(found, "is_recorded"):
            parameters = list(inspect.signature(found).parameters.values())[1:]
            if all(each.default is not each.empty for each in parameters):
                names.add(name)
    names = {name for name in names if not name.startswith("_") or name == "__repr__"}
    return sorted(names | {name for name in vars(handle) if not name.startswith("_")} - {"function", "kind"})


def misread(handle):
    """Return the names that give neither a value nor a StateError, each with its error.

    A MeshError is allowed for bodies without tetrahedra or without a surface.
    """
    wrong = []
    for name in readouts(handle):
        try:
            found = getattr(handle, name)
            if callable(found):
                found()
        except (StateError, MeshError):
            pass
        except Exception as error:
            wrong.append(f"{type(handle).__name__}.{name}: {type(error).__name__}: {error}")
    return wrong

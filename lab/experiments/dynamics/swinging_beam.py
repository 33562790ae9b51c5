"""A beam that vibrates in its first bending mode, under any law."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lab.experiments.dynamics.beam_theory import Beam, first_shape, timoshenko_frequency
from lab.experiments.dynamics.compared_laws import WITHOUT_ENERGY
from taichi_soft import FrozenBodyWarning, Material, TetMesh, box
from taichi_soft.core.types import LawName
from taichi_soft.world.bare import bare_world

Floats = NDArray[np.float64]

LENGTH, WIDTH, HEIGHT = 2.0, 0.3, 0.2  # [m]
YOUNG, POISSON, DENSITY = 1e6, 0.3, 1000.0
MATERIAL = Material(YOUNG, POISSON, DENSITY, damping_ratio=0.0)
BEAM = Beam(LENGTH, WIDTH, HEIGHT, YOUNG, POISSON, DENSITY)
NEEDS_DAMPING = {law: 20.0 if law == "volume_springs" else 5.0 for law in WITHOUT_ENERGY}
"""Damping [N s/m] by law. With this damping, the beam stays stable for two periods under these laws."""
AMPLITUDE = 0.01 * LENGTH  # strains stay below 0.2 %
FRAMES = 60  # steps per theoretical period


def beam_mesh(cells: int) -> TetMesh:
    """Make the mesh of the beam with `cells` cubic cells along its height."""
    return box((LENGTH, WIDTH, HEIGHT), (10 * cells, 3 * cells // 2, cells))


def mode_shape(mesh: TetMesh, support: str) -> tuple[Floats, NDArray[np.int64]]:
    """Return the shape of the first mode, (n, 3), and the indices of the fixed vertices."""
    along = mesh.vertices[:, 0] / LENGTH + 0.5
    shape = np.zeros_like(mesh.vertices)
    shape[:, 2] = first_shape(along, is_held=support == "cantilever")
    return shape, np.flatnonzero(along < 1e-9) if support == "cantilever" else np.zeros(0, np.int64)


def theory(support: str) -> float:
    return timoshenko_frequency(BEAM, is_held=support == "cantilever")


def swing(mesh: TetMesh, law: LawName, support: str) -> tuple[float, float]:
    """Return the frequency of the vibrating beam [Hz], and the growth of its amplitude in one period.

    The growth is the amplitude after the period divided by the amplitude before it. Both numbers are 0 if the
    beam fails.
    """
    shape, held = mode_shape(mesh, support)
    world = bare_world(gravity=(0, 0, 0), floor=None, retries=0)
    material = replace(MATERIAL, damping=NEEDS_DAMPING.get(law, 0.0))
    body = world.add_body(mesh, material, law=law, pinned=held)
    world.build()
    if support == "free":  # remove the momentum and the angular momentum of the mode
        weight = np.sqrt(body.masses)
        rigid = np.stack([np.ones(len(weight)), mesh.vertices[:, 0]], axis=1) * weight[:, None]
        shape[:, 2] -= (rigid @ np.linalg.lstsq(rigid, shape[:, 2] * weight, rcond=None)[0]) / weight
    period = 1 / theory(support)
    body.set_motion(mesh.vertices, shape * (AMPLITUDE * 2 * np.pi / period))
    dt, deflections, crossings = period / FRAMES, [0.0], list[float]()
    substeps = world.stable_substeps(dt)
    mode = body.masses * shape[:, 2] / (body.masses @ shape[:, 2] ** 2)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FrozenBodyWarning)  # the frequency 0 reports a frozen body
        while len(crossings) < 5 and len(deflections) < 8 * FRAMES and not body.is_frozen:
            world.step(dt, substeps)
            before, now = deflections[-1], float(mode @ (body.positions()[:, 2] - mesh.vertices[:, 2]))
            if before * now < 0:
                crossings.append((len(deflections) - 1 + before / (before - now)) * dt)
            deflections.append(now)
    if body.is_frozen or len(crossings) < 5:
        return 0.0, 0.0
    turns = [round(time / dt) for time in crossings]
    early, late = (
        np.abs(deflections[turns[i] : turns[i + 1]]).max() for i in (0, 2)
    )  # two deflections to the same side, one period apart
    return 2 / (crossings[4] - crossings[0]), float(late / early)

"""The drop in MuJoCo (Apache-2.0): a flex with one body per vertex and St. Venant-Kirchhoff's law.

The contact stiffness is that of the flex in MuJoCo's documentation of modeling. MuJoCo gives all vertices of
a flex the same mass. This module replaces it by the mass of each vertex in the drop.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lab.peers.drop import GRAVITY, Drop
from lab.peers.trajectory import RATE, Progress, Simulation, Trajectory, record

FIRST = 4
"""Number of steps per 1 / RATE s: about 2 ms each, MuJoCo's default."""

MODEL = """
<mujoco>
  <option timestep="{step!r}" integrator="{integrator}" tolerance="1e-6" gravity="0 0 -{gravity}"/>
  <worldbody>
    <geom type="plane" size="9 9 0.1" condim="1" {contact}/>
    <flexcomp name="body" type="direct" dim="3" radius="0.0005" mass="{mass!r}"
              point="{points}" element="{elements}">
      <contact selfcollide="none" condim="1" {contact}/>
      <elasticity young="{young!r}" poisson="{poisson!r}"/>
    </flexcomp>
  </worldbody>
</mujoco>
"""

CONTACT = 'solref="0.01 1" solimp="0.95 0.99 0.0001"'


def simulate_discrete(drop: Drop, on_frame: Progress | None = None) -> Trajectory:
    """Simulate the drop with the integrator that MuJoCo recommends for flexes. Contact is also implicit."""
    return _simulate(drop, "discrete", on_frame)


def simulate_euler(drop: Drop, on_frame: Progress | None = None) -> Trajectory:
    """Simulate the drop with MuJoCo's explicit integrator, which is faster for soft materials."""
    return _simulate(drop, "Euler", on_frame)


def _simulate(drop: Drop, integrator: str, on_frame: Progress | None) -> Trajectory:
    """Simulate the drop, without the log file that MuJoCo would write into the current folder."""
    import mujoco

    mujoco.set_mju_user_warning(lambda _: None)
    try:
        return record(drop, partial(_make, drop, integrator), FIRST, on_frame)
    finally:
        mujoco.set_mju_user_warning(None)


def _make(drop: Drop, integrator: str, steps: int) -> Simulation:
    import mujoco

    step = 1 / (RATE * steps)
    text = MODEL.format(
        step=step,
        integrator=integrator,
        gravity=GRAVITY,
        contact=CONTACT,
        mass=float(drop.masses.sum()),
        points=" ".join(map(repr, drop.start.ravel().tolist())),
        elements=" ".join(map(str, drop.mesh.tets.ravel().tolist())),
        young=drop.young,
        poisson=drop.poisson,
    )
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    model.body_mass[model.flex_vertbodyid] = drop.masses
    mujoco.mj_setConst(model, data)
    mujoco.mj_forward(model, data)
    return Simulation(partial(_advance, model, data, steps), partial(_positions, model, data), step)


def _advance(model: Any, data: Any, steps: int) -> None:
    import mujoco

    mujoco.mj_step(model, data, steps)


def _positions(model: Any, data: Any) -> NDArray[np.float64]:
    """Recompute and return the positions of the vertices, (n, 3) [m]; NaN after an instability.

    The positions that MuJoCo stores are those before the step. After an instability, MuJoCo resets the
    simulation. A reset counts as an explosion.
    """
    import mujoco

    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_flex(model, data)
    kinds = mujoco.mjtWarning
    bad = kinds.mjWARN_BADQPOS, kinds.mjWARN_BADQVEL, kinds.mjWARN_BADQACC
    if any(data.warning[kind].number for kind in bad):
        return np.full(data.flexvert_xpos.shape, np.nan)
    return np.array(data.flexvert_xpos)

"""Run one phase of a substep many times, to profile it."""

from taichi_soft.core.runtime import ti
from taichi_soft.elements.kernels.edges import accumulate_edge_forces
from taichi_soft.elements.kernels.elastic import accumulate_elastic_forces
from taichi_soft.solver.kernels.kick import kick_body
from taichi_soft.solver.step_fields import Job

PHASES = ("elastic", "damping", "motion")


@ti.kernel
def repeat_phase(
    state: ti.template(),
    program: ti.template(),
    phase: ti.template(),
    body_count: ti.i32,
    repeats: ti.i32,
    h: ti.f32,
):
    """Run `phase`, one of `PHASES`, for each body, `repeats` times. Forces accumulate over the repeats."""
    ti.loop_config(serialize=True)
    for body in range(body_count):
        for _ in range(repeats):
            if ti.static(phase == "elastic"):
                for m, model in ti.static(enumerate(program.models)):
                    if state.body_model[body] == m:
                        accumulate_elastic_forces(state, model, body)
            if ti.static(phase == "damping"):
                for m, model in ti.static(enumerate(program.models)):
                    if state.body_model[body] == m:
                        accumulate_edge_forces(state, model, body)
            if ti.static(phase == "motion"):
                kick_body(state, program, body, Job(h=h, drift_time=h), h)

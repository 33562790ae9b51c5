"""Internal parts of a world, which `World` and the persistence modules share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from taichi_soft.bodies.asset import SoftBodyAsset
from taichi_soft.bodies.soft_body import Context, SoftBody
from taichi_soft.contact.collider import Collider
from taichi_soft.contact.colliders import Colliders
from taichi_soft.core.errors import StateError
from taichi_soft.core.settings import ContactRequest, ContactSettings
from taichi_soft.core.types import Schedule
from taichi_soft.solver.integrators import INTEGRATORS
from taichi_soft.solver.simulation import Simulation
from taichi_soft.solver.substeps import Substeps


@dataclass(eq=False, kw_only=True)
class WorldContext(Context):
    """All parts of a world, without its public interface."""

    contact_request: ContactRequest
    substeps: Substeps
    make_body: Callable[[WorldContext, int, SoftBodyAsset], SoftBody]  # creates the handle of a slot's body
    fields: Simulation | None = None
    built_with: list[str] = field(default_factory=list)  # digest of each collider's shape at `build`
    first_floor: float | None = None  # height of the floor at `build` [m]
    structure: bytes = b""  # cached digest of the world's structure; snapshots must have the same digest

    @property
    def contact(self) -> ContactSettings:
        """Contact and sleep settings. Before `World.build`, they depend on the slots added so far."""
        return self._contact(can_touch=self.slots.can_touch)

    @property
    def contact_with_another(self) -> ContactSettings:
        """Contact and sleep settings that this world would have with one more body."""
        return self._contact(can_touch=True)

    def _contact(self, *, can_touch: bool) -> ContactSettings:
        chosen = self.settings
        is_flat = chosen.schedule is Schedule.FLAT or INTEGRATORS[chosen.integrator].only_flat
        return self.contact_request.settings(can_touch=can_touch, is_flat=is_flat)

    @property
    def colliders(self) -> Colliders:
        """Colliders of the world."""
        return self.of(Colliders)

    @property
    def floor_collider(self) -> Collider | None:
        """Collider of the floor; None before `World.build`, and in a world without a floor or colliders."""
        return self.colliders.floor

    @property
    def built(self) -> Simulation:
        """The built world, a `Simulation`. Raises: StateError before `World.build`."""
        if self.fields is None:
            raise StateError("the world is not built: call world.build() after the last add_body")
        return self.fields

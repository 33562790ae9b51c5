"""The outcome of one drop-test case."""

from __future__ import annotations

from dataclasses import dataclass

from lab.drop_test.case import Case


@dataclass(frozen=True)
class Outcome:
    """Measurements of one case."""

    case: Case
    frozen_at: float | None  # time of the first non-finite value [s]; None if there was none
    out: float  # largest distance of a surface vertex beyond floor, walls or lid during the run [m]
    out_through: str | None  # name of the floor, wall or lid; None if `out` is within the tolerance
    inside: float  # largest depth of a surface vertex in an obstacle at the end [m]
    inside_of: str | None  # name of the obstacle; None if `inside` is within the tolerance
    rest_at: float | None  # time at which the body came to rest [s]; None if it kept moving
    speed: float  # root mean square speed of the vertices at the end [sizes of the body per second]
    flipped: int  # number of inverted tetrahedra at the end

    @property
    def faults(self) -> tuple[str, ...]:
        """Names of the failures, worst first; empty if there are none."""
        found = (
            ("non-finite", self.frozen_at is not None),
            ("through the room", self.out_through is not None),
            ("in an obstacle", self.inside_of is not None),
            ("not at rest", self.rest_at is None and self.frozen_at is None),
            ("inside out", self.flipped > 0),
        )
        return tuple(name for name, is_so in found if is_so)

    def badness(self, fault: str) -> float:
        """Return the severity of a failure, for sorting: larger is worse."""
        share = self.flipped / len(self.case.mesh.tets)
        early = -(self.frozen_at or 0.0)
        return dict(zip(FAULTS, (early, self.out, self.inside, self.speed, share), strict=True))[fault]

    def __str__(self) -> str:
        found = []
        if self.frozen_at is not None:
            found.append(f"non-finite at {self.frozen_at:.2f} s")
        if self.out_through is not None:
            found.append(f"{self.out:.3g} m through the {self.out_through}")
        if self.inside_of is not None:
            found.append(f"{self.inside:.3g} m deep in the {self.inside_of}")
        if self.rest_at is None and self.frozen_at is None:
            found.append(f"still {self.speed:.3g} sizes per second")
        if self.flipped:
            found.append(f"{self.flipped} of {len(self.case.mesh.tets)} tetrahedra inside out")
        return f"case {self.case.number}: {', '.join(found) or 'sound'} - {self.case}"


FAULTS = ("non-finite", "through the room", "in an obstacle", "not at rest", "inside out")
"""Names of all failures, worst first."""

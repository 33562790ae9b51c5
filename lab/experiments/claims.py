"""Statements that the report judges: claims of the thesis, and theory that its models should satisfy."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Claim:
    """A statement to judge.

    Args:
        source: section or figure of the thesis, or the theory behind the statement.
        text: the statement, one sentence.
    """

    source: str
    text: str

    @property
    def is_of_thesis(self) -> bool:
        """True for a claim of the thesis, false for a statement of theory."""
        return self.source.startswith(("chapter", "section", "figure"))


CLAIMS: dict[str, Claim] = {
    # Chapter 3
    "decay-explicit": Claim(
        "figure 3.1", "On y' = lambda y explicit Euler decays too fast (the text: overshoots)."
    ),
    "decay-implicit": Claim("figure 3.1", "On y' = lambda y implicit Euler decays too slowly."),
    "wave-explicit": Claim("figure 3.2", "On the wave equation explicit Euler gains amplitude."),
    "wave-implicit": Claim("figure 3.2", "On the wave equation implicit Euler fades."),
    "stability-regions": Claim(
        "figure 3.3",
        "Explicit Euler is stable where |1 + h lambda| < 1, implicit Euler where |1 / (1 - h lambda)| < 1.",
    ),
    "leapfrog-reversible": Claim("section 3.5.2", "Leapfrog is reversible in time."),
    "lazy-leapfrog": Claim(
        "section 3.5.2",
        "Lazy leapfrog is explicit Euler with two lines swapped, and nearly as good as leapfrog.",
    ),
    "integrator-orders": Claim(
        "section 3.5", "Leapfrog is of second order, both Euler methods are of first."
    ),
    # Chapter 4
    "implicit-step": Claim(
        "section 4.2", "Implicit Euler raises the step of CMPM from 1e-4 to 1e-2 s, 100 times."
    ),
    "implicit-rate": Claim("section 4.2", "With it the simulation runs 20 to 30 times faster."),
    "strain-misread-edge": Claim(
        "section 4.3, figure 4.3",
        "One edge stretched at 30 degrees reads a tensile and a shear strain that are wrong.",
    ),
    "cmpm-anisotropic": Claim(
        "section 4.3", "Stretched along another axis it answers with another force: CMPM is anisotropic."
    ),
    "strain-misread-triangle": Claim(
        "section 4.4.1, figure 4.5",
        "Where a triangle is stretched at a particle, an edge of it reads a small tensile and a much larger "
        "shear strain.",
    ),
    "cmpm2-step": Claim(
        "section 4.4.1", "CMPM2, with barycentric subfaces, runs with somewhat larger steps than CMPM."
    ),
    "cmpm2-anisotropic": Claim("section 4.4.1", "CMPM2 keeps the flaw of CMPM: it is anisotropic too."),
    "best-fitting-plane-angles": Claim(
        "section 4.4.2, figure 4.7", "Many best fitting planes are far from perpendicular to their edge."
    ),
    "best-fitting-plane-cost": Claim(
        "section 4.4.2", "The best fitting plane is slower and less stable than CMPM."
    ),
    "split-ring-normal": Claim(
        "section 4.4.2",
        "A cheap normal, from a ring of particles split into halves twice, represents that of the plane.",
    ),
    "split-ring-cost": Claim("section 4.4.2", "A model with this normal costs little, and might work."),
    "tilted-plane": Claim(
        "section 4.4.3",
        "A plane tilted by eq. 4.11 and 4.12 follows a shear (never implemented in the thesis).",
    ),
    # Chapter 5
    "shear-modulus-volume": Claim(
        "chapter 5, introduction", "A larger shear modulus of CMPM keeps more of the volume."
    ),
    "volume-springs-volume": Claim(
        "figure 5.1", "Sheared, a cube of springs keeps its volume better with nu = 0.3 than 0."
    ),
    "volume-springs-drop": Claim("figure 5.1", "Its volume drops where the shear passes 0.5."),
    "volume-springs-shear": Claim("figure 5.2", "Its shear force lies far below G A."),
    "volume-springs-tension": Claim(
        "figure 5.2", "A spurious tensile force remains, a little smaller with nu = 0.3 than with 0."
    ),
    "volume-springs-rise": Claim(
        "section 5.2", "nu = 0.3 raises the shear force slightly, while the expected one falls."
    ),
    "volume-springs-limit": Claim("section 5.2", "Above nu = 0.3 it becomes unstable."),
    # Chapter 6
    "implicit-tetrahedra": Claim(
        "section 6.5",
        "For the laws of chapter 6 implicit Euler does not pay: gradients cost what its longer steps save.",
    ),
    "size-acceleration": Claim(
        "section 6.6", "In a body twice as large the same deformation gives accelerations 8 times smaller."
    ),
    "sphere-window-0.1": Claim(
        "section 6.6", "With nu = 0.1 the dropped sphere is stable for E from 2e5 to 3e6 Pa."
    ),
    "sphere-window-0.4": Claim("section 6.6", "With nu = 0.4 it is stable for E from 4e5 to 1e6 Pa."),
    "sphere-collapse": Claim(
        "section 6.6", "Below the window the sphere collapses on itself, above it explodes."
    ),
    "sphere-real-time": Claim(
        "section 6.6", "A sphere of 955 tetrahedra reaches 45 % of real time (a PC of 2002)."
    ),
    "refresh-rate": Claim("section 6.6", "Drawing at 40 Hz hardly affects the speed of the simulation."),
    "bars-bounce": Claim(
        "figure 6.2", "The bars of a complex object bend on impact, and vibrate after they lift off."
    ),
    "flips-dent": Claim(
        "section 6.6",
        "Under strong collisions flips leave dents where most is pressed, and nothing runs away.",
    ),
    "cylinder-0.4": Claim("figure 6.3 (b)", "A stretched cylinder of nu = 0.4 keeps its volume."),
    "cylinder-0": Claim("figure 6.3 (b)", "With nu = 0 it does not."),
    "cylinder-negative": Claim("figure 6.3 (b)", "With negative nu it grows wider."),
    "density-bounce": Claim(
        "figure 6.3",
        "Of a dropped body that is denser on the right this side is pressed most, bounces last and least.",
    ),
    "tension-slope": Claim(
        "figure 6.4", "Tension: the slope at zero is E A; nu = 0 is exact at small strain."
    ),
    "tension-curve": Claim("figure 6.4", "The tensile force curves away from E A s, upwards."),
    "tension-poisson": Claim(
        "figure 6.4", "A higher nu gives a higher slope, and takes the force further from E A s."
    ),
    "tension-shear": Claim("section 6.6", "A stretched cylinder shows no shear force."),
    "shear-slope": Claim("figure 6.4", "The shear force is straight, its slope a little under G A."),
    "shear-tension": Claim("figure 6.4", "Sheared, a tensile force starts with slope zero and grows."),
    "shear-poisson": Claim("figure 6.4", "A higher nu lowers the shear force and raises the tensile one."),
    "proportional-to-e": Claim("section 6.6", "All forces are proportional to E."),
    "energy-drift": Claim(
        "section 6.4", "Undamped, kinetic energy slowly accumulates; very little damping stops it."
    ),
    "damping-rotation": Claim(
        "section 6.4",
        "Damping against the mean velocity of a tetrahedron brakes rotation too; edge damping does not.",
    ),
    "methods-alike": Claim(
        "section 6.6, 6.7", "Forces by faces (I) and by the virial theorem (II) behave and cost alike."
    ),
    "springs-faster": Claim("section 6.7", "Springs and CMPM are clearly faster than the laws of chapter 6."),
    "mesh-quality": Claim("section 6.6", "Small angles of tetrahedra destabilise, and so does a high nu."),
    "linear-strain": Claim(
        "section 6.1", "The linearised strain (eq. 6.7) is close to the exact one while it is small."
    ),
    # Chapter 7
    "large-strain": Claim(
        "chapter 7", "The model allows strains of over 100 %, though less close to reality."
    ),
    # Beyond the thesis: theory
    "patch-test": Claim(
        "patch test", "A body under uniform strain has the uniform stress of Hooke's law, on any mesh."
    ),
    "beam-tension": Claim("theory of beams", "A bar in tension pulls with E A s at small strain."),
    "beam-shear": Claim("linear elasticity", "A bar in uniform shear resists with G A s at small strain."),
    "beam-torsion": Claim("Saint-Venant's torsion", "A twisted bar resists with G J per unit twist."),
    "beam-bending": Claim(
        "Timoshenko's beam", "A loaded cantilever sinks by F L^3 / 3 E I, and what shear adds."
    ),
    "block-shear": Claim(
        "linear elasticity", "A sheared block resists with the stiffness of an independent code."
    ),
    "finite-elements": Claim(
        "linear elasticity",
        "At small strain tetrahedral laws and finite elements on the same mesh agree to 1 %.",
    ),
    "mesh-convergence": Claim("linear elasticity", "Errors shrink as the mesh is refined."),
    "cantilever-frequency": Claim("theory of beams", "A cantilever vibrates at its first natural frequency."),
    "free-beam-frequency": Claim("theory of beams", "A free beam vibrates at its first natural frequency."),
    "wave-speed": Claim("linear elasticity", "A pressure wave runs through a bar at sqrt(E / rho)."),
    "hertz": Claim("Hertz 1881", "A sphere pressed on a plane resists with 4/3 E* sqrt(R) d^(3/2)."),
    "energy-budget": Claim(
        "mechanics", "Energy: what gravity gives is what the body holds and damping takes."
    ),
    "momentum-budget": Claim("mechanics", "Momentum and angular momentum of a free body stay."),
}
"""Claims by key, in the order of the report."""

"""Bars in tension, torsion and bending, compared with closed forms (not in the thesis)."""

from __future__ import annotations

from typing import Any

from lab.experiments.bar_picture import bar_picture
from lab.experiments.bar_stiffness import (
    LINEAR,
    POISSON,
    QUADRATIC,
    WIDTH,
    YOUNG,
    stiffness_over_theory,
)
from lab.experiments.experiment import (
    Effort,
    Experiment,
    Finding,
    Numbers,
    Picture,
    Plot,
    Point,
    Results,
    Section,
    Table,
)
from lab.experiments.judgement import judged_but_for
from lab.experiments.law_variants import is_tetrahedral, label, variants
from lab.experiments.stiffness_dots import draw_stiffness_dots

LENGTH = 4.0
EXAGGERATION = 250.0
"""Factor by which the image exaggerates displacements."""
LOADS = ("tension", "shear", "torsion", "bending", "cantilever")
EXACT = 1e-3
"""Largest relative error in tension and shear. Linear tetrahedra represent a uniform stress exactly. The
remaining error is about as large as the strain."""
SAME = 0.01
"""Largest relative difference between a law on tetrahedra and linear finite elements on the same mesh."""
LIMIT = 0.03
"""Largest relative error of a stiffness that is extrapolated from two meshes. The extrapolation and the
clamped end of the cantilever each cause an error of about 1 %."""

TEXT = (
    f"A bar of {LENGTH:g} x {WIDTH:g} x {WIDTH:g} m (E = {YOUNG:g} Pa, nu = {POISSON:g}) is drawn out, "
    "sheared, twisted and bent, strains 1e-4 at most, and loaded at its free end as a cantilever. Theory: "
    "E A / L; G A / L; G J / L with Saint-Venant's J = 0.1406 b^4 of a square; E I / L; and Timoshenko's "
    "cantilever. In tension, torsion and bending the ends are free to contract or to warp, and in shear all "
    "of the surface slides uniformly, so that theory is exact; a cantilever's root is clamped, and stiffer "
    "by a percent or two, as quadratic elements show.",
    "Linear tetrahedra lock: constant strain within each cannot follow bending and warping, and a coarse "
    "mesh is too stiff, alike with every law on tetrahedra and with linear finite elements. The error "
    "falls with the square of the cells' size (see mesh-convergence), so two meshes tell where it goes, "
    "and this is what is judged. Laws along edges meet another material: some seem close in bending where "
    "what they lack in tension makes up for locking.",
)


def points(effort: Effort) -> list[Point]:
    """List the points: every law and finite elements on a coarse mesh.

    On two finer meshes, the points are only one law and linear elements.
    """
    coarse, middle, fine = (2, 3, 4) if effort is Effort.QUICK else (5, 6, 8)
    laws = variants(effort)
    finer = [{**laws[0], "cells": fine}, {**laws[0], "cells": middle, "drawn": True}]
    names = ((LINEAR, fine), (LINEAR, middle), (LINEAR, coarse), (QUADRATIC, min(coarse, 4)))
    elements = [{"law": name, "strain": None, "cells": cells} for name, cells in names]
    return [*({**variant, "cells": coarse} for variant in laws), *finer, *elements]


def measure(point: Point) -> Numbers:
    """Measure the ratio of the stiffness to its theoretical value, for each load."""
    return stiffness_over_theory(point, LENGTH, LOADS)


def conclude(results: Results) -> Section:
    """Judge tension and shear against theory, and torsion and bending after an extrapolation."""
    rows = [(row.point, results.one(**row.point)) for row in results.rows]
    coarse = rows[0][0]["cells"]
    of_laws = [row for row in rows if row[0]["law"] not in (LINEAR, QUADRATIC)]
    laws = [row for row in of_laws if row[0]["cells"] == coarse]
    (fine_point, fine), (middle_point, middle) = (row for row in of_laws if row[0]["cells"] != coarse)
    solid = [numbers for point, numbers in laws if is_tetrahedral(point["law"])]
    [(quadratic_point, quadratic)] = results.where(law=QUADRATIC)
    linear = results.one(law=LINEAR, cells=coarse)
    cells = (middle_point["cells"], fine_point["cells"])
    limit = {load: _extrapolated(middle[load], fine[load], cells) for load in LOADS}

    def extrapolated_to(claim: str, loads: tuple[str, ...]) -> Finding:
        away = max(abs(limit[load] - 1) for load in loads)
        apart = max(abs(numbers[load] / linear[load] - 1) for numbers in solid for load in loads)
        measured = "; ".join(
            f"{load}: {middle[load]:.3f} and {fine[load]:.3f} of theory with {cells[0]} and {cells[1]} cells "
            f"across, {limit[load]:.3f} extrapolated"
            for load in loads
        )
        why = ""
        if apart >= SAME:
            why = f"model: a law is {apart:.2g} away from linear finite elements on the same mesh"
        elif away >= LIMIT:
            exact = max(abs(quadratic[load] - 1) for load in loads)
            cause = (
                "mesh: too coarse to extrapolate" if exact < LIMIT else "theory: a closed form of thin bars"
            )
            why = f"{cause}; quadratic finite elements are {exact:.2g} away from theory"
        others = [
            label(point)
            for point, numbers in laws
            if not is_tetrahedral(point["law"])
            and max(abs(numbers[load] / linear[load] - 1) for load in loads) >= SAME
        ]
        return judged_but_for(
            claim,
            f"{measured}; tetrahedral laws are within {apart:.1g} of linear finite elements on the same mesh",
            away < LIMIT and apart < SAME,
            why,
            others,
            f"they are {SAME:.0%} or more away from linear finite elements on the same mesh",
        )

    def held(claim: str, load: str, theory: str) -> Finding:
        away = max(abs(numbers[load] - 1) for numbers in solid)
        others = {label(point): n[load] for point, n in laws if not is_tetrahedral(point["law"])}
        return judged_but_for(
            claim,
            f"tetrahedral laws resist with {theory} to {away:.1g}; laws along edges with "
            f"{min(others.values()):.2f} to {max(others.values()):.2f} of it",
            away < EXACT,
            f"model: linear finite elements reach {linear[load]:.5f} on this mesh",
            [name for name, part in others.items() if abs(part - 1) >= EXACT],
            "laws along edges resist as another material",
        )

    compared = {label(point): numbers for point, numbers in laws} | {LINEAR: linear, QUADRATIC: quadratic}
    shown = {name: {load: numbers[load] for load in LOADS} for name, numbers in compared.items()}
    extrapolated = (f"{label(fine_point)}, extrapolated", "", *(round(limit[load], 4) for load in LOADS))
    top = 0.1 * int(10 * max(max(numbers.values()) for numbers in shown.values()) + 1.5)

    def draw(figure: Any) -> None:
        draw_stiffness_dots(figure, shown, "theory", (0.2, top))

    return Section(
        TEXT,
        (
            held("beam-tension", "tension", "E A s"),
            held("beam-shear", "shear", "G A s"),
            extrapolated_to("beam-torsion", ("torsion",)),
            extrapolated_to("beam-bending", ("bending", "cantilever")),
        ),
        (
            Table(
                "beams",
                "Stiffness over that of theory",
                ("law", "cells across [1]", *(f"{load} [1]" for load in LOADS)),
                (*((label(p), p["cells"], *(round(n[x], 4) for x in LOADS)) for p, n in rows), extrapolated),
            ),
        ),
        (
            Plot(
                "beams",
                f"Stiffness of every law over theory, {coarse} cells across: linear tetrahedra are too stiff "
                f"in torsion and bending. Quadratic finite elements, {quadratic_point['cells']} across, show "
                "that theory is right.",
                draw,
                (7.5, 5.6),
            ),
        ),
        (
            Picture(
                "bars",
                f"The loads, displacements {EXAGGERATION:g} times as large, coloured by how far each part "
                "has moved.",
                bar_picture(LENGTH, cells[0], middle["displacements"], EXAGGERATION),
            ),
        ),
    )


def _extrapolated(coarse: float, fine: float, cells: tuple[int, int]) -> float:
    """Extrapolate a value to cells of zero size by Richardson's method, for an error of second order."""
    ratio = (cells[1] / cells[0]) ** 2
    return (ratio * fine - coarse) / (ratio - 1)


BEAMS = Experiment(
    "beams",
    "Beams",
    "beyond the thesis: theory of beams",
    ("beam-tension", "beam-shear", "beam-torsion", "beam-bending"),
    points,
    measure,
    conclude,
)
"""The experiment on bars under load."""

"""Made-up sections: every verdict, all kinds of plots and images, short and long tables, failed points."""

import numpy as np

from lab.experiments import (
    CLAIMS,
    Experiment,
    Finding,
    MissingPointError,
    Picture,
    Plot,
    Result,
    Results,
    Section,
    Table,
    Verdict,
)


def experiment(name, title="An experiment", source="figure 6.4", claims=()):
    def nothing(*_):
        raise AssertionError("the report measures nothing")

    return Experiment(name, title, source, claims, nothing, nothing, nothing)


def draw_curve(figure):
    axes = figure.add_subplot()
    strain = np.linspace(0.0, 0.5, 26)
    for poisson in (0.0, 0.2, 0.4):
        axes.plot(strain, strain * (1 + (0.5 + poisson) * strain), "o-", label=f"nu = {poisson}")
    axes.plot(strain, strain, "k--", label="E A s")
    axes.axhline(0.25, color="0.4", linestyle=":")
    axes.set_xlabel("strain [1]")
    axes.set_ylabel("force, over E A [1]")
    axes.legend()


def draw_map(figure):
    axes = figure.add_subplot()
    rows = np.hypot(*np.meshgrid(np.linspace(-2, 2, 80), np.linspace(-2, 2, 80)))
    image = axes.imshow(rows, extent=(-2, 2, -2, 2))
    axes.set_xlabel("Re(h lambda) [1]")
    axes.set_ylabel("Im(h lambda) [1]")
    figure.colorbar(image, label="factor of a step [1]")


def draw_many(figure):
    axes = figure.add_subplot()
    for k in range(10):
        axes.plot([0, 1], [k, 2 * k], label=f"line {k}")
    axes.set_xlabel("time [s]")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    figure.tight_layout()


def draw_nothing(_):
    raise MissingPointError("0 points with {'nu': 0.5}, wanted 1")


def gradient(width, height):
    """Return an image with different colours in all pixels, (height, width, 3)."""
    down, right = np.mgrid[0:height, 0:width]
    return np.stack([right % 256, down % 256, np.full_like(down, 40)], axis=2).astype(np.uint8)


TENSION = experiment("tension", "Tension of a cylinder", "figure 6.4", ("tension-slope", "tension-curve"))
TENSION_RESULTS = Results(
    (
        *(
            Result(
                {"poisson": nu, "strain": s},
                {"force": 1e6 * s * (1 + s / 3), "cap": [s, nu], "stable": True},
                "",
                0.25,
            )
            for nu in (0.0, 0.2)
            for s in (0.01, 0.1, 1 / 3)
        ),
        Result({"poisson": 0.5, "strain": 0.1}, None, "OptionError: poisson must lie below 0.5", 0.5),
    )
)
TENSION_SECTION = Section(
    (
        "A cylinder of 0.5 m by 2 m is stretched by its caps, step by step, and the force on a cap is read "
        "where the body has come to rest. The thesis draws the force over the strain and, beside it, E A s.",
        "The curve leaves the line at once: a linearised Green strain grows with the square of the stretch.",
    ),
    (
        Finding("tension-slope", "the slope at zero is 1.003 E A with nu = 0", Verdict.AGREES),
        Finding(
            "tension-curve",
            "at a strain of 0.5 the force is 1.25 E A s",
            Verdict.DIFFERS,
            "The model: with nu = 0 eq. 6.7 gives E A s (1 + s / 2) on any mesh, and a mesh of twice as many "
            "layers gives 1.25 too.",
        ),
        Finding(
            "tension-poisson",
            "of 3 ratios 1 was measured",
            Verdict.UNKNOWN,
            "Points failed where nu = 0.5, which no isotropic material has.",
        ),
    ),
    (
        Table(
            "slopes",
            "Slope at zero strain",
            ("nu [1]", "slope [N]", "over E A [1]", "stable", "note", "spread [1]"),
            (
                (0.0, 1.003e6, 1.003, True, "exact", "0.00012"),
                (0.2, np.float64(1.1e6), 1.1, False, None, ""),
            ),
        ),
        Table(
            "forces",
            "Forces of all points",
            ("strain [1]", "force [N]"),
            tuple((k / 40, 1e6 * k / 40 * (1 + k / 80)) for k in range(40)),
        ),
        Table("wide", "Many columns", tuple(f"column {k} [m]" for k in range(14)), ((*range(14),),)),
    ),
    (
        Plot("force", "Force over strain; dashed: E A s. The curves leave the line upwards.", draw_curve),
        Plot("map", "A map with a scale of colours.", draw_map, (5.0, 4.0)),
        Plot("many", "Many lines in a wide plot.", draw_many, (8.4, 3.0)),
        Plot("lost", "A plot that needs a point that failed.", draw_nothing),
    ),
    (
        Picture("cylinder", "A cylinder at rest.", gradient(320, 200)),
        Picture("stretched", "And stretched.", gradient(97, 61)),
    ),
)

HOSTILE = (
    "<script>alert(1)</script> & \"quoted\" 'single' | **bold** [x](y) `code` {{ 7 * 7 }} {% raw %} \\ </td>"
)
TRAP = experiment("../trap/<b>", HOSTILE, HOSTILE)
TRAP_RESULTS = Results((Result({"law": HOSTILE}, None, HOSTILE + "\nsecond line", 0.0),))
TRAP_SECTION = Section(
    (HOSTILE, "# no heading", "1. no list", "- no list either", "two\nlines"),
    (Finding("momentum-budget", HOSTILE, Verdict.UNKNOWN, HOSTILE),),
    (Table("../../up", HOSTILE, (HOSTILE, "n"), ((HOSTILE, 1), ("=1+1", 2))),),
    (Plot("a/b", HOSTILE, draw_curve, (2.0, 1.5)),),
    (Picture("c d", HOSTILE, gradient(33, 17)),),
)

SECOND = experiment("tension-theory", "Tension against theory", "theory of beams", ("tension-slope",))
SECOND_SECTION = Section(
    (), (Finding("tension-slope", "on a second mesh it is 0.91 E A", Verdict.DIFFERS, "The mesh."),)
)

INVENTED = [
    (TENSION, TENSION_RESULTS, TENSION_SECTION),
    (TRAP, TRAP_RESULTS, TRAP_SECTION),
    (SECOND, Results(), SECOND_SECTION),
]
EXPECTED = {
    "tension-slope": "differs",  # the less favourable of two findings
    "tension-curve": "differs",
    "tension-poisson": "cannot be told",
    "momentum-budget": "cannot be told",
}
assert set(EXPECTED) <= set(CLAIMS)
COUNTS = {
    "55 claims of the thesis": (
        "0 agree, 0 agree in part, 2 differ, 1 cannot be told, 52 not measured"  # all but momentum-budget
    ),
    "14 statements of theory": "0 agree, 0 agree in part, 0 differ, 1 cannot be told, 13 not measured",
}
"""The two lines that count them."""

"""Compute hashes of the motion of bodies, to check that a change of the code leaves the motion unchanged.

Run the script by hand before and after the change:

    python tests/shared/motion_hashes.py before.json
    python tests/shared/motion_hashes.py after.json --against before.json
    python tests/shared/motion_hashes.py after.json --against before.json --threads 1

The motions are those of every law under every integrator, the scenes of the thread tests, a random game and
every demo. The script takes some minutes. Hashes are valid for one machine and one version of Taichi.
"""

import argparse
import hashlib
import json
import sys
import time
import warnings
from pathlib import Path

ROOT = Path(__file__).parents[2]
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))

# ruff: noqa: E402
import random_play
import thread_scenes

from taichi_soft import Material, box, delaunay_mesh, init
from taichi_soft.core.errors import TaichiSoftError
from taichi_soft.core.types import Integrator
from taichi_soft.elements.laws import LAWS
from taichi_soft.render.demos import demo_names, load_demo
from taichi_soft.render.film import film
from taichi_soft.world.bare import bare_world

TICKS = 300
DEMO_SECONDS = 2.0
MATERIAL = Material(2e4, 0.3, 1000.0, 2.0, damping_ratio=0.05)


def hash_of(worlds):
    """Return a hash of the positions and velocities of all bodies."""
    code = hashlib.sha256()
    for world in worlds:
        for body in world.bodies:
            code.update(body.positions().tobytes())
            code.update(body.velocities().tobytes())
    return code.hexdigest()[:16]


def fallen(law, integrator, options):
    """Drop a body onto the floor. Return its hash, or the error if the options are refused."""
    mesh = delaunay_mesh(box(cells=(2, 2, 2))) if law.startswith("cmpm") else box(cells=(2, 2, 2))
    world = bare_world(integrator=integrator)
    try:
        world.add_body(mesh, MATERIAL, law=law, position=(0, 0, 0.55), velocity=(1, 0, -3), **options)
        world.build()
        for _ in range(20):
            world.step(1 / 60, 8)
    except TaichiSoftError as error:
        return type(error).__name__
    return hash_of([world])


def laws():
    """Yield name and function for every law, integrator and option. A function returns a hash."""
    for name, law in LAWS.items():
        kinds = [{"strain": each.value} for each in law.strains] or [{}]
        kinds += [{"flips": each.value} for each in law.flips] if len(law.flips) > 1 else []
        for integrator in Integrator:
            for options in kinds:
                key = " ".join([name, integrator.value, *options.values()])
                yield key, lambda n=name, i=integrator, o=options: fallen(n, i, o)


def played():
    """Return a hash of the states after all ticks of a random game."""
    world, cube = random_play.make_world()
    hashes = []
    for _ in range(TICKS):
        random_play.act(world, cube, 5)
        world.step(random_play.DT, random_play.SUBSTEPS)
        hashes.append(hash_of([world]))
    return hashlib.sha256("".join(hashes).encode()).hexdigest()[:16]


def shown(name):
    """Return the hash of a demo after some seconds."""
    stage = load_demo(name).stage()
    film(stage, None, seconds=DEMO_SECONDS)
    worlds = {
        id(world): world for world in [stage.world, *(actor.world or stage.world for actor in stage.actors)]
    }
    return hash_of(worlds.values())


def scenes():
    """Yield name and function of every motion. A function returns a hash."""
    for name, scene in thread_scenes.SCENES.items():
        yield f"scene {name}", lambda s=scene: hashlib.sha256(json.dumps(s()).encode()).hexdigest()[:16]
    yield "random game", played
    for name in demo_names():
        yield f"demo {name}", lambda n=name: shown(n)
    yield from laws()


def main():
    """Run the script. Returns: the exit status, 1 if a motion differs."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("out", type=Path, help="file to write")
    parser.add_argument("--against", type=Path, help="file of an earlier run")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--only", default="", help="beginning of the names to run")
    chosen = parser.parse_args()
    warnings.simplefilter("ignore")
    init("cpu", threads=chosen.threads)
    before = json.loads(chosen.against.read_text()) if chosen.against else {}
    found, different, start = {}, [], time.perf_counter()
    for name, scene in scenes():
        if not name.startswith(chosen.only):
            continue
        if not name.startswith("scene played"):  # its hashes also depend on the format of snapshots
            found[name] = scene()
            if name in before and before[name] != found[name]:
                different.append(name)
                print(f"\r{name}: {before[name]} before, {found[name]} now")
        chosen.out.write_text(json.dumps(found, indent=1))
        print(f"\r{len(found)} in {time.perf_counter() - start:.0f} s", end="", flush=True)
    compared = len(before.keys() & found.keys())
    print(f"\n{len(different)} of {compared} differ" if before else "")
    return int(bool(different))


if __name__ == "__main__":
    sys.exit(main())

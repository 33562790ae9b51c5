"""Worlds in WebAssembly through the package for JavaScript. `test_platforms.py` plays games in them."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from browser import chromium, complaints_of, pixels_of, serving
from native_build import ROOT

from taichi_soft.core.version import VERSION as VERSION_OF_PROJECT
from taichi_soft.live.three_js import FOLDER, VERSION, fetch_three_js

pytestmark = pytest.mark.soak

PACKAGE = ROOT / "engine_adapter" / "web"


@pytest.fixture
def node():
    if shutil.which("node") is None:
        pytest.skip("needs node: apt-get install nodejs")
    return "node"


REFUSED = """
import { readFileSync } from "node:fs";
import { loadScene, sceneOf } from "PACKAGE/taichi-soft.js";
const [folder, other] = process.argv.slice(2);
const read = (from, name) => readFileSync(`${from}/${name}`);
const found = [];
async function refused(what, action) {
  try {
    await action();
    found.push([what, "taken", ""]);
  } catch (error) {
    found.push([what, error.code ?? error.name, error.message]);
  }
}
const code = read(folder, "kernels/web.wasm");
const whole = read(folder, "world.tsw");
await refused("cut off", () => sceneOf(code, whole.subarray(0, 1000)));
await refused("another world", () => sceneOf(code, read(other, "world.tsw")));
await refused("elsewhere", () => loadScene("http://127.0.0.1:9/nothing"));
await refused("no module", () => sceneOf(whole, whole));
const named = new Set();
for (let i = 0; i < 200; i += 1) {
  const damaged = Uint8Array.from(whole);
  damaged[Math.floor((i * whole.length) / 200) + (i % 7)] ^= 1 << i % 8;
  try {
    await sceneOf(code, i % 2 ? damaged : whole.subarray(0, Math.floor((i * whole.length) / 200)));
    named.add("taken");
  } catch (error) {
    named.add(error.code ?? error.name);
  }
}
found.push(["damaged", [...named].sort().join(), ""]);
const modules = new Set();
for (let i = 0; i < 100; i += 1) {
  const damaged = Uint8Array.from(code);
  damaged[8 + Math.floor((i * (code.length - 8)) / 100)] ^= 1 << i % 8;
  try {
    await sceneOf(damaged, whole);
    modules.add("taken");
  } catch (error) {
    modules.add(error.code ?? error.name);
  }
}
found.push(["damaged modules", [...modules].sort().join(), ""]);
await refused("half a module", () => sceneOf(code.subarray(0, code.length / 2), whole));
await refused("no world", () => sceneOf(code));
const world = (await sceneOf(code, whole)).createWorld();
const before = world.hash();
await refused("time", () => world.step(-1));
await refused("name", () => world.body("nobody"));
await refused("snapshot", () => world.restore(new Uint8Array(40)));
await refused("vector", () => world.body(0).setVelocity([NaN, 0, 0]));
world.onStep = () => {
  throw new Error("of the game");
};
await refused("listener", () => world.advance(1 / 60));
world.onStep = null;
found.push(["state", String(world.hash() === before), ""]);
for (let i = 0; i < 1000; i += 1) {
  try {
    world.step(-1);
  } catch {
    // a thousand times: the stack is put back each time
  }
}
world.step(1 / 64);
found.push(["goes on", String(world.hash() !== before), ""]);
console.log(JSON.stringify(found));
"""

MISTAKES = """
import { readFileSync } from "node:fs";
import { sceneOf } from "PACKAGE/taichi-soft.js";
import { RollbackSession } from "PACKAGE/rollback.js";
const read = (name) => readFileSync(`${process.argv[2]}/${name}`);
const scene = await sceneOf(read("kernels/web.wasm"), read("world.tsw"));
const found = {};
function refused(what, action) {
  try {
    action();
    found[what] = "taken";
  } catch (error) {
    found[what] = error.code ?? error.name;
  }
}
const [world, other] = [scene.createWorld(), scene.createWorld()];
const body = world.body(0);
const before = world.hash();
found.counted = scene.counts;
refused("two numbers", () => body.applyImpulse([0, 0]));
refused("no numbers", () => body.setVelocity(undefined));
refused("a position of two", () => world.spawn(0, { position: [0, 3] }));
refused("no vertex", () => body.applyImpulse([0, 0, 1], []));
refused("half a vertex", () => body.pin([0.5]));
refused("half a body", () => world.body(0.5));
refused("half a kind", () => world.recordEvents("contactBegan"));
refused("a kind", () => scene.nameOf("bodies", 0));
refused("no bytes", () => world.restore("abc"));
refused("half a substep", () => world.step(1 / 60, 2.5));
refused("a substep in words", () => world.setFixedStep({ substeps: "2" }));
refused("half a level", () => body.setLevel(0.5));
refused("half a group", () => world.addCollider({ kind: "sphere", size: [1, 0, 0], group: 0.5 }));
refused("half a triangle", () => body.grab({ triangle: 0.5, weights: [1, 0, 0], point: [0, 0, 0] }));
refused("a grab by a name", () => world.grab("first"));
refused("a body of 33 bits", () => world.body(2 ** 32));
refused("a vertex of 33 bits", () => body.applyImpulse([0, 0, 1], [2 ** 32]));
refused("a frame by its name", () => body.attach([0], scene.nameOf("frame", 0)));
refused("a collider for a frame", () => body.attach([0], world.collider(0)));
refused("a frame of another world", () => body.attach([0], other.frame(0)));
refused("a load on a name", () => body.load(scene.nameOf("frame", 0)));
refused("a body by its name", () => body.join([0], scene.nameOf("body", 1), { onto: [0] }));
refused("a body of another world", () => body.join([0], other.body(1), { onto: [0] }));
found.untouched = world.hash() === before;

const mesh = body.mesh();
mesh.free();
mesh.free();
refused("a freed mesh", () => mesh.update());
const kept = world.snapshot();
world.step();
world.restore(kept.buffer.slice(kept.byteOffset, kept.byteOffset + kept.byteLength));
found.rewound = world.hash() === before;

world.onStep = () => world.advance(1 / 60);
refused("advance within", () => world.advance(1 / 60));
let count = 0;
world.onStep = () => {
  count += 1;
  if (count === 2) throw new TypeError("of the game");
};
refused("a game's error", () => world.advance(0.1));
world.onStep = null;
found.dropped = Math.round(60 * world.clock.dropped); // the first call and the second had 1 and 5 left
world.step();
world.destroy();
refused("a destroyed world", () => world.step());
found.memory = 0;
const sizeOf = () => scene.native.exports.memory.buffer.byteLength;
for (let i = 0, size = 0; i < 60; i += 1) {
  const each = scene.createWorld();
  refused("time", () => each.step(-1));
  each.onStep = () => {
    throw new TypeError("of the game");
  };
  refused("of the game", () => each.advance(0.1));
  const bytes = each.snapshot();
  bytes[bytes.length - 1] ^= 1;
  refused("damaged", () => each.restore(bytes));
  each.destroy();
  if (i === 10) size = sizeOf();
  found.memory = sizeOf() - size;
}

// A session copies what it is given: node hands out buffers that it uses again.
const worlds = [other, scene.createWorld()];
const sessions = worlds.map((each, player) => new RollbackSession(each, () => {}, { player, inputSize: 1 }));
const [own, wire] = [Buffer.alloc(1), Buffer.alloc(1000)];
for (let tick = 0; tick < 20; tick += 1) {
  sessions.forEach((session, i) => {
    own[0] = tick + i;
    session.advance(own);
    const data = session.message();
    wire.set(data);
    sessions[1 - i].receive(wire.subarray(0, data.length));
  });
}
sessions.forEach((session) => session.settle());
found.confirmed = sessions.map((each) => each.confirmed);
other.step();
refused("a step outside", () => sessions[0].advance(own));

scene.unload();
found.named = other.body(scene.nameOf("body", 0)).positions().length === 3 * scene.asset(0).vertexCount;
other.step();
refused("an unloaded scene", () => scene.createWorld());
console.log(JSON.stringify(found));
"""


def test_mistakes_of_a_game_are_refused_and_nothing_leaks(node, export, tmp_path):
    program = tmp_path / "mistakes.mjs"
    program.write_text(MISTAKES.replace("PACKAGE", PACKAGE.as_posix()))
    done = subprocess.run([node, program, export("free", "--for", "web")], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found.pop("memory") == 0
    assert found.pop("dropped") == 6
    assert found.pop("confirmed") == [20, 20]
    assert [found.pop(name) for name in ("untouched", "rewound", "named")] == [True] * 3
    wanted = {"body": 5, "asset": 5, "mesh": 5, "frame": 1, "collider": 1, "joint": 0, "motor": 0}
    assert found.pop("counted") == wanted
    wanted = {
        **dict.fromkeys(["a freed mesh", "a destroyed world", "an unloaded scene"], "HANDLE"),
        **dict.fromkeys(["a game's error", "of the game"], "TypeError"),
        **{"advance within": "STATE", "damaged": "SNAPSHOT", "a step outside": "SessionError"},
    }
    assert found == {name: wanted.get(name, "ARGUMENT") for name in found}


WANTED = {
    "cut off": ("FILE", "the world file is damaged"),
    "another world": ("FILE", "the kernels belong to another export"),
    "damaged": ("FILE", ""),
    "damaged modules": ("FILE", ""),
    "half a module": ("FILE", "another export, or are damaged"),
    "no world": ("ARGUMENT", "world is undefined: give a typed array"),
    "elsewhere": ("FILE", "cannot read http://127.0.0.1:9/nothing/kernels/web.wasm"),
    "no module": ("FILE", "the code is not a WebAssembly module"),
    "time": ("ARGUMENT", "dt is -1 s"),
    "name": ("ARGUMENT", "unknown body nobody"),
    "snapshot": ("SNAPSHOT", "cut off|not a snapshot|40 bytes"),
    "vector": ("ARGUMENT", "has -?nan in it"),
    "listener": ("Error", "of the game"),
    "state": ("true", ""),
    "goes on": ("true", ""),
}


def test_bad_input_is_refused_by_name_and_the_world_goes_on(node, export, tmp_path):
    program = tmp_path / "refused.mjs"
    program.write_text(REFUSED.replace("PACKAGE", PACKAGE.as_posix()))
    folders = [export(name, "--for", "web") for name in ("free", "heap")]
    done = subprocess.run([node, program, *folders], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    found = {what: (code, text) for what, code, text in json.loads(done.stdout)}
    assert found.keys() == WANTED.keys()
    for what, (code, text) in WANTED.items():
        assert found[what][0] == code, (what, found[what])
        assert any(each in found[what][1] for each in text.replace("-?", "").split("|")), (what, found[what])


def test_the_package_has_the_version_of_the_project():
    package = json.loads((PACKAGE / "package.json").read_text())
    assert VERSION_OF_PROJECT.split(".dev")[0] == package["version"]


@pytest.mark.guard
@pytest.mark.parametrize("module", ["taichi-soft", "rollback"])
def test_the_types_name_what_the_package_has(module, node):
    """Every class, method and property of the types is in the package, and vice versa."""
    program = f"""
import * as soft from "{PACKAGE.as_posix()}/{module}.js";
const names = {{}};
for (const [name, thing] of Object.entries(soft)) {{
  const own = Object.getOwnPropertyNames(thing.prototype ?? {{}});
  names[name] = own.filter((each) => each !== "constructor");
}}
console.log(JSON.stringify(names));
"""
    done = subprocess.run(
        [node, "--input-type=module", "-e", program], capture_output=True, text=True, check=True
    )
    types = (PACKAGE / f"{module}.d.ts").read_text(encoding="utf-8")
    inner = {"World": {"keep", "forget"}}
    for name, members in json.loads(done.stdout).items():
        assert f" {name}" in types, name
        for member in set(members) - inner.get(name, set()):
            assert f"{member}(" in types or f"{member}:" in types, f"{name}.{member}"


@pytest.fixture(scope="module")
def sample(tmp_path_factory):
    """A folder with the sample's page and world, as its page in the documentation says."""
    folder = tmp_path_factory.mktemp("sample")
    shutil.copy(PACKAGE / "sample" / "index.html", folder)
    out = ["--out", str(folder / "game.softworld"), "--axes", "y-up", "--for", "web"]
    command = [sys.executable, "-m", "taichi_soft", "export", str(PACKAGE / "sample" / "game.py"), *out]
    subprocess.run(command, check=True, capture_output=True)
    return folder


def test_the_sample_of_three_js_shows_a_jelly_that_can_be_lifted_and_balls_that_fall(sample):
    fetch_three_js()
    with serving(sample) as address, chromium() as browser:
        page = browser.new_page(viewport={"width": 600, "height": 400})
        complaints = complaints_of(page)
        page.route("https://cdn.jsdelivr.net/**", of_this_machine)
        page.goto(f"{address}/index.html")
        page.wait_for_function("() => document.querySelector('canvas')?.width === 600")
        page.wait_for_timeout(1000)
        at_rest = pixels_of(page, "canvas")
        red = np.argwhere((at_rest - at_rest.mean(axis=2, keepdims=True))[..., 0] > 40)
        y, x = red.mean(axis=0)
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x, y - 120, steps=10)
        page.wait_for_timeout(2000)
        lifted = pixels_of(page, "canvas")
        page.mouse.up()
        above = np.argwhere((lifted - lifted.mean(axis=2, keepdims=True))[..., 0] > 40)
        assert above[:, 0].mean() < y - 10
        for _ in range(6):  # the first two go again: there is room for four
            page.click("button")
        parts = []  # of the picture that are blue, while the balls fall and before they have rolled away
        for _ in range(6):
            page.wait_for_timeout(250)
            after = pixels_of(page, "canvas")
            parts.append(((after - after.mean(axis=2, keepdims=True))[..., 2] > 40).mean())
        assert max(parts) > 0.01
        assert complaints == []


def test_the_sample_says_why_it_does_not_play(sample):
    fetch_three_js()
    with serving(sample) as address, chromium() as browser:
        page = browser.new_page()
        page.route("https://cdn.jsdelivr.net/**", lambda route: route.abort())
        page.goto(f"{address}/index.html")
        page.get_by_text("three.js comes from cdn.jsdelivr.net").wait_for()
        page.unroute("https://cdn.jsdelivr.net/**")
        page.route("https://cdn.jsdelivr.net/**", of_this_machine)
        page.route("**/world.tsw", lambda route: route.fulfill(body="no world"))
        page.goto(f"{address}/index.html")
        page.get_by_text("world is not a world file: give a folder from `taichi-soft export`").wait_for()
        assert page.locator("p").count() == 1


def test_the_code_of_the_documentation_runs_in_a_browser(sample):
    first, _, second, _ = re.findall(r"```js\n(.*?)```", (ROOT / "docs" / "web.md").read_text(), re.DOTALL)
    imports = "".join(re.findall(r"^import .*\n", second, re.MULTILINE))
    # The page's own clock says less than 500 ms while it is young: frames come from here alone.
    stage = """function requestAnimationFrame() {}
const scene = new THREE.Scene();
const renderer = { setAnimationLoop: (draw) => draw(16) };
"""
    rest = second.replace(imports, "")
    check = "frame(0); frame(500); window.found = [world.clock.steps, jelly.positions.length];"
    places = {"three": f"https://cdn.jsdelivr.net/npm/three@{VERSION}/build/three.module.js"}
    (sample / "page.html").write_text(
        f"""<link rel="icon" href="data:,"><script type="importmap">{json.dumps({"imports": places})}</script>
<script type="module">{imports}{first}{stage}{{ {rest} }}{check}</script>"""
    )
    fetch_three_js()
    with serving(sample) as address, chromium() as browser:
        page = browser.new_page()
        complaints = complaints_of(page)
        page.route("https://cdn.jsdelivr.net/**", of_this_machine)
        page.goto(f"{address}/page.html")
        page.wait_for_function("window.found")
        steps, length = page.evaluate("window.found")
        assert (steps > 0, length > 300, complaints) == (True, True, [])


def test_the_code_of_the_documentation_runs_in_node(node, sample):
    _, code, *_ = re.findall(r"```js\n(.*?)```", (ROOT / "docs" / "web.md").read_text(), re.DOTALL)
    (sample / "own.mjs").write_text(code)
    done = subprocess.run([node, "own.mjs"], cwd=sample, capture_output=True, text=True)
    assert re.fullmatch(r"[0-9a-f]{16}\n", done.stdout), done.stderr


def test_the_code_on_levels_of_detail_runs_in_node(node, export, tmp_path):
    *_, code = re.findall(r"```js\n(.*?)```", (ROOT / "docs" / "web.md").read_text(), re.DOTALL)
    code = code.replace('"duck"', '"body0"').replace('"duckKind"', '"asset0"')
    begin = f"""
import {{ readFileSync }} from "node:fs";
import {{ sceneOf }} from "{PACKAGE.as_posix()}/taichi-soft.js";
const read = (name) => readFileSync(`${{process.argv[2]}}/${{name}}`);
const world = (await sceneOf(read("kernels/web.wasm"), read("world.tsw"))).createWorld();
"""
    (tmp_path / "own.mjs").write_text(
        begin + code.replace('"duck"', '"body0"').replace('"duckKind"', '"asset0"')
    )
    program = [node, tmp_path / "own.mjs", export("levels", "--for", "web")]
    done = subprocess.run(program, capture_output=True, text=True)
    level, vertices, levels = map(int, done.stdout.split())
    assert (level, levels) == (2, 3), done.stderr
    assert vertices > 0


def of_this_machine(route):
    """The same version of three.js as the page asks for, which the live page has too."""
    assert f"three@{VERSION}/" in route.request.url
    headers = {"access-control-allow-origin": "*"}
    route.fulfill(path=FOLDER / Path(route.request.url).name, content_type="text/javascript", headers=headers)

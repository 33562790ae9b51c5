"""Worlds in WebAssembly: the same games as in C, by the package for JavaScript, in node and in a browser."""

import json
import shutil
import subprocess
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread

import pytest
from browser import chromium, opened
from games import digests, lines_of
from native_build import ROOT
from scenes import GAMES
from test_kept_bits import KEPT

PLAYER, PACKAGE = ROOT / "tests" / "native" / "play.mjs", ROOT / "engine_adapter" / "web"


@pytest.fixture
def node():
    if shutil.which("node") is None:
        pytest.skip("needs node")
    return "node"


@pytest.mark.parametrize("name", GAMES)
def test_a_game_in_node_has_the_same_bits(name, node, export):
    lines = lines_of([node, PLAYER, export(name, "--for", "web")], list(GAMES[name][1]()))
    assert digests(lines) == json.loads(KEPT.read_text())[name]


PAGE = """<!DOCTYPE html><title>games</title><link rel="icon" href="data:,"><script type="module">
import { loadScene } from "./engine_adapter/web/taichi-soft.js";
import { play } from "./tests/native/play.mjs";
window.played = async (folder, game) => play(await loadScene(folder), game);
window.isReady = true;
</script>"""


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


@pytest.fixture
def site(tmp_path):
    """A folder with the package and the player of games, and the address at which it is served."""
    for file in (*(each for each in PACKAGE.iterdir() if each.is_file()), PLAYER):
        place = tmp_path / file.relative_to(ROOT)
        place.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(file, place)
    (tmp_path / "index.html").write_text(PAGE)
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=tmp_path))
    Thread(target=server.serve_forever, daemon=True).start()
    yield tmp_path, f"http://127.0.0.1:{server.server_address[1]}"
    server.shutdown()


def test_games_in_chromium_have_the_same_bits_and_nobody_complains(site, export):
    folder, address = site
    with chromium() as browser:
        page, complaints, _ = opened(browser, address + "/index.html")
        page.wait_for_function("window.isReady")
        for name in ("heap", "held"):
            shutil.copytree(export(name, "--for", "web"), folder / name)
            game = "\n".join(GAMES[name][1]())
            lines = page.evaluate("([folder, game]) => played(folder, game)", [name, game])
            assert digests(lines) == json.loads(KEPT.read_text())[name]
        page.close()
    assert [each for each in complaints if "favicon" not in each] == []


REFUSED = """
import { readFileSync } from "node:fs";
import { sceneOf } from "PACKAGE/taichi-soft.js";
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
await refused("no module", () => sceneOf(whole, whole));
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

WANTED = {
    "cut off": ("FILE", "the world file is damaged"),
    "another world": ("FILE", "the kernels are not those of this world file"),
    "no module": ("RUNTIME", "this browser cannot compile the world"),
    "time": ("ARGUMENT", "dt is -1 s"),
    "name": ("ARGUMENT", "nothing of that kind is called nobody"),
    "snapshot": ("SNAPSHOT", "cut off|no snapshot|40 bytes"),
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


@pytest.mark.parametrize("module", ["taichi-soft", "rollback"])
def test_the_types_name_what_the_package_has(module, node):
    """Every class, method and property of the one is in the other."""
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

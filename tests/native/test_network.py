"""Rollback sessions between Python and WebAssembly agree bit by bit, and detect differences."""

import json
import re
import shutil
import struct
import subprocess
import sys
from pathlib import Path

import pytest
from browser import chromium, opened, serving
from native_build import ROOT

from engine_adapter import FixedStep, RollbackSession, SessionError

pytestmark = pytest.mark.soak

HERE, WEB = Path(__file__).parent, ROOT / "engine_adapter" / "web"
NO_TICK = 0xFFFFFFFF


@pytest.fixture(scope="module", autouse=True)
def _node():
    if shutil.which("node") is None:
        pytest.skip("needs node")


@pytest.fixture
def sample():
    """Return the modules of the sample: the Python player, and the network between both players."""
    from engine_adapter.web.network import play, player

    return play, player


@pytest.fixture(scope="module")
def arena(tmp_path_factory):
    """The folder of the sample's world."""
    from engine_adapter.web.network.play import export

    folder = tmp_path_factory.mktemp("network") / "arena.softworld"
    export(folder)
    return folder


@pytest.fixture
def plain(sample):
    """A function that plays inputs of both players without a session and returns the hash after them."""
    world, act = sample[1].world, sample[1].act
    start = world.snapshot()

    def played(*inputs):
        world.restore(start)
        for pair in zip(*inputs, strict=True):
            act(pair)
            world.step(1 / 60, 8)
        found = world.bodies_hash()
        world.restore(start)
        return found

    yield played
    world.restore(start)


def test_python_and_node_end_a_minute_of_play_over_a_bad_network_in_the_same_state(sample, arena, plain):
    """The final state is also that of a world that receives all inputs at once."""
    play, player = sample
    reports, counts = play.session(arena, ticks=3600, seed=1, is_fast=True)
    inputs = [[player.press(tick, who) for tick in range(3600)] for who in (0, 1)]
    assert {each["hash"] for each in reports} == {plain(*inputs)}
    for each in reports:
        assert each["desync"] is None
        assert each["ticks"] == 3600
        assert each["rollbacks"] > 200  # of 212 and 157 changes of direction, and 144 of the stage by each
        assert 10 < each["longest"] <= 30
        assert abs(each["ahead"]) < 3  # although one player started 20 frames late
        assert each["remade"] < 4000  # 7,600 if the first player does not wait
    assert counts["lost"] > 500
    assert counts["overtaken"] > 500
    assert counts["copied"] > 50


def test_one_bit_of_an_input_is_noticed_by_both_at_the_next_hash(sample, arena):
    reports, _ = sample[0].session(arena, ticks=600, seed=2, is_fast=True, cheat=333)
    assert [each["desync"] for each in reports] == [360, 360]
    assert reports[0]["hash"] != reports[1]["hash"]


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (["--ticks", "0"], "--ticks is 0: give 1 or more"),
        (["--ticks", "50", "--cheat", "50"], "--cheat is 50: give a tick from 0 to 49"),
        (["--world", "nowhere"], "--world is nowhere: give a folder from taichi-soft export --for web"),
        (["--world", "."], "the game stopped early, for the reason above: node did not start"),
    ],
)
def test_a_game_that_cannot_begin_ends_at_once_with_the_reason(options, reason, tmp_path):
    (tmp_path / "kernels").mkdir()
    (tmp_path / "kernels" / "web.wasm").write_bytes(b"no module")
    command = [sys.executable, WEB / "network" / "play.py", "--fast", *options]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=50)
    assert done.returncode != 0
    assert reason in done.stderr
    assert "Traceback" not in done.stderr


def datagram(start, first, inputs, **other):
    """A message of player 1 with its fields one by one, as docs/network.md describes them."""
    field = dict(mark=b"TSR1", player=1, players=2, size=3, ticks=4, every=2, tick=first + len(inputs))
    field |= dict(hash_tick=NO_TICK, hash=0, count=len(inputs), heard=0) | other
    numbers = [field[name] for name in ("player", "players", "size", "ticks", "every")]
    head = field["mark"] + struct.pack("<QBBHHH", int(start, 16), *numbers)
    head += struct.pack("<IIQ", field["tick"], field["hash_tick"], field["hash"])
    return head + struct.pack("<IHII", first, field["count"], field["heard"], 0) + b"".join(inputs)


def in_python(player, calls, delay):
    """The calls on a session of Python. Returns: what `session.mjs` prints."""
    world, told, call = player.world, [], ""
    start = world.snapshot()

    def act(inputs):
        player.act(inputs)
        if call == "refused":
            raise RuntimeError("of the game")

    options = dict(player=0, input_size=3, ticks=4, hash_every=2, patience=3, delay=delay)
    session = RollbackSession(world, act, step=FixedStep(1 / 60, 8), **options)
    do = {"settle": lambda _: session.settle(), "receive": session.receive}
    for call, data in calls:
        try:
            found = do.get(call, session.advance)(data)
        except (SessionError, RuntimeError) as error:
            found = f"{'SessionError' if isinstance(error, SessionError) else 'Error'}: {error}"
        numbers = session.tick, session.confirmed, session.rollbacks, session.longest_rewind, session.desync
        told.append([found, *numbers, world.bodies_hash(), session.message().hex()])
    world.restore(start)
    return told


def in_node(folder, calls, delay):
    """Run the calls on a session in node. Returns: the output of `session.mjs`."""
    options = {"player": 0, "inputSize": 3, "ticks": 4, "hashEvery": 2, "patience": 3, "delay": delay}
    given = json.dumps({"options": options, "calls": [[call, data.hex()] for call, data in calls]})
    done = subprocess.run(["node", HERE / "session.mjs", folder], input=given, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def spoken_alike(told):
    """Convert the output of Python to the names of JavaScript."""
    names = {"input_size": "inputSize", "hash_every": "hashEvery", "(": "", ")": ""}
    text = json.dumps(told)
    for name, other in names.items():
        text = text.replace(name, other)
    return json.loads(text)


def both(player, folder, calls, delay=0):
    """Return what a session in Python reports, after a check that a session in node reports the same."""
    told = in_python(player, calls, delay)
    assert spoken_alike(told) == spoken_alike(in_node(folder, calls, delay))
    return told


OWN = [bytes([10 * tick, 200 - tick, tick % 2]) for tick in range(12)]
THEIRS = [bytes([150, 5 * tick, (tick + 1) % 2]) for tick in range(12)]


def test_inputs_that_come_late_twice_and_out_of_order_lead_to_the_state_of_those_in_time(
    sample, arena, plain
):
    player = sample[1]
    start = player.world.bodies_hash()
    calls = [("advance", each) for each in OWN[:4]]
    calls += [("advance", OWN[4])] * 3  # four ticks are predicted: no further
    calls += [
        ("receive", datagram(start, 0, THEIRS[:1])),
        ("receive", datagram(start, 0, THEIRS[:4], heard=2)),
    ]
    calls += [("receive", datagram(start, 0, THEIRS[:4], heard=2)), ("settle", b"")]
    calls += [
        ("receive", datagram(start, 2, THEIRS[2:7], heard=4)),
        ("receive", datagram(start, 1, THEIRS[1:3])),
    ]
    calls += [("advance", each) for each in OWN[4:8]]
    calls += [("receive", datagram(start, 6, THEIRS[6:8], heard=7)), ("settle", b"")]
    told = both(player, arena, calls)
    found = [each[0] for each in told]
    assert found[:6] == [True] * 4 + [False] * 2
    assert found[6].startswith("SessionError: no input of player 1 for tick 0 came in 3 frames")
    assert found[7:] == [None] * 3 + [4] + [None] * 2 + [True] * 4 + [None, 1]
    assert [each[1] for each in told[3:7]] == [4] * 4  # and nothing was made
    assert told[10][3:5] == [1, 4]  # one rewind of the largest possible length
    assert told[10][6] == plain(OWN[:4], THEIRS[:4])
    assert told[-1][1:6] == [8, 8, 2, 4, None]
    assert told[-1][6] == plain(OWN[:8], THEIRS[:8])
    assert bytes.fromhex(told[-1][7])[50:] == OWN[7]  # the rest is acknowledged


def test_own_inputs_are_used_and_sent_later_by_the_delay(sample, arena, plain):
    player = sample[1]
    start = player.world.bodies_hash()
    calls = [("advance", each) for each in OWN[:4]]
    calls += [("receive", datagram(start, 0, THEIRS[:4])), ("settle", b"")]
    told = both(player, arena, calls, delay=2)
    used = [bytes(3), bytes(3), *OWN[:4]]
    assert told[-1][1:5] == [4, 4, 1, 4]
    assert told[-1][6] == plain(used[:4], THEIRS[:4])
    assert bytes.fromhex(told[-1][7])[50:] == b"".join(used)


def test_a_message_that_is_not_of_this_session_is_refused_by_name_and_changes_nothing(sample, arena):
    player = sample[1]
    start = player.world.bodies_hash()
    sound = datagram(start, 0, THEIRS[:2])
    bad = {
        b"": "not a message",
        sound[:40]: "not a message",
        sound[:-1]: "2 inputs has 55 bytes: it is damaged",
        datagram(start, 0, THEIRS[:2], mark=b"TSR2"): "not a message of a session of this version",
        datagram(f"{int(start, 16) ^ 1:016x}", 0, THEIRS[:2]): f"initial state is .*{start}",
        datagram(start, 0, THEIRS[:2], ticks=5): r"are \(2, 3, 5, 2\) there and \(2, 3, 4, 2\) here",
        datagram(start, 0, THEIRS[:2], players=3): r"are \(3, 3, 4, 2\) there",
        datagram(start, 0, THEIRS[:2], player=0): "player 0 is not another player",
        datagram(start, 3, THEIRS[3:5]): "no input before tick 3, and that of 2 is missing",
        datagram(start, 0, [THEIRS[0], OWN[0]]): "sends another input for tick 1 than before",
        datagram(start, 0, THEIRS[:2], heard=4): "acknowledges an input that was not sent",
        datagram(start, 0, THEIRS[:12]): "player 1 is beyond tick 11",
        datagram(start, 0, THEIRS[:2], tick=12): "player 1 is beyond tick 11",
        datagram(start, 0, THEIRS[:2], hash_tick=12): "player 1 is beyond tick 11",
    }
    calls = [("advance", each) for each in OWN[:3]] + [("receive", sound), ("settle", b"")]
    calls += [("receive", each) for each in bad]
    told = both(player, arena, calls)
    before = told[4]
    for text, each in zip(bad.values(), told[5:], strict=True):
        assert re.search(f"SessionError: .*{text}", each[0]), (text, each[0])
        assert each[1:] == before[1:]


def test_hashes_are_compared_when_no_input_can_change_them_any_more(sample, arena, plain):
    """The hash of tick 2 is wrong, and comes before tick 2 is made. That of the start is right."""
    player = sample[1]
    start = player.world.bodies_hash()
    wrong = int(plain(OWN[:2], THEIRS[:2]), 16) ^ 1
    calls = [
        ("receive", datagram(start, 0, THEIRS[:1], hash_tick=0, hash=int(start, 16))),
        ("advance", OWN[0]),
        ("receive", datagram(start, 0, THEIRS[:1], hash_tick=2, hash=wrong)),
        *(("advance", each) for each in OWN[1:3]),
        ("settle", b""),  # tick 2 began in a state that rests on a prediction
        ("receive", datagram(start, 1, THEIRS[1:3])),
        ("settle", b""),
    ]
    told = both(player, arena, calls)
    assert [each[5] for each in told] == [None] * 7 + [2]
    hash_tick, hash = struct.unpack_from("<IQ", bytes.fromhex(told[-1][7]), 24)
    assert (hash_tick, hash ^ 1) == (2, wrong)


def test_a_tick_that_the_game_refuses_was_not_made(sample, arena, plain):
    player = sample[1]
    start = player.world.bodies_hash()
    calls = [("advance", OWN[0]), ("refused", OWN[1]), ("advance", OWN[1])]
    calls += [("receive", datagram(start, 0, THEIRS[:2])), ("settle", b"")]
    told = both(player, arena, calls)
    assert told[1][0] == "Error: of the game"
    assert told[1][1:] == told[0][1:]
    assert told[-1][6] == plain(OWN[:2], THEIRS[:2])


THREE = """
import { readFileSync } from "node:fs";
import { Rollback, RollbackSession } from "WEB/rollback.js";
import { sceneOf } from "WEB/taichi-soft.js";
const read = (name) => readFileSync(`${process.argv[2]}/${name}`);
const scene = await sceneOf(read("kernels/web.wasm"), read("world.tsw"));
const TICKS = 300, DELAYS = [0, 2, 5];
let seed = 1;
const random = () => (seed = (seed * 16807) % 2147483647) / 2147483647;
const press = (tick, player) => Uint8Array.of((tick >> (2 + player)) * 7919 + player);
const apply = (world) => (inputs) =>
  inputs.forEach(([push], i) => world.body(i).applyForce([8 * (push - 128), 4 * (push % 16) * i, 0]));
const machines = DELAYS.map((delay, player) => {
  const world = scene.createWorld();
  const options = { player, players: 3, inputSize: 1, substeps: 8, ticks: 40, hashEvery: 7, delay };
  return { world, session: new RollbackSession(world, apply(world), options) };
});
const way = [];
for (let frame = 0; machines.some(({ session }) => session.confirmed < TICKS); frame += 1) {
  machines.forEach(({ session }, player) => {
    for (let i = way.length - 1; i >= 0; i -= 1) {
      if (way[i].to === player && way[i].due <= frame) session.receive(way.splice(i, 1)[0].data);
    }
    if (session.tick < TICKS) session.advance(press(session.tick, player));
    else session.settle();
    for (let to = 0; to < 3; to += 1) {
      if (to === player || random() < 0.2) continue;
      for (let copy = 0; copy < 1 + (random() < 0.1); copy += 1) {
        way.push({ to, due: frame + 3 + 10 * random(), data: session.message() });
      }
    }
  });
}
machines.forEach(({ session }) => session.settle());
const plain = scene.createWorld();
for (let tick = 0; tick < TICKS; tick += 1) {
  const pressed = DELAYS.map((delay, i) => (tick < delay ? Uint8Array.of(0) : press(tick - delay, i)));
  apply(plain)(pressed);
  plain.step(1 / 60, 8);
}
const ring = new Rollback(plain, 2);
const refusals = [];
const refused = (step) => {
  try {
    ring.rewindTo(step);
  } catch (error) {
    refusals.push(error.message);
  }
};
const hashes = [];
for (let i = 0; i < 4; i += 1) {
  ring.save();
  hashes.push(plain.hash());
  plain.step(1 / 60, 8);
}
const { steps } = ring;
refused(TICKS);
ring.rewindTo(TICKS + 2);
const back = [plain.hash() === hashes[2], ring.steps];
plain.restore(plain.snapshot());
refused(TICKS + 1);
console.log(JSON.stringify({
  hashes: machines.map(({ world }) => world.hash()),
  plain: hashes[0],
  ends: machines.map(({ session }) => [session.tick, session.desync, session.rollbacks > 20]),
  ring: [steps, back, refusals],
}));
"""


def test_three_players_agree_and_a_ring_goes_back_as_in_python(arena, tmp_path):
    program = tmp_path / "three.mjs"
    program.write_text(THREE.replace("WEB", WEB.as_posix()))
    done = subprocess.run(["node", program, arena], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert set(found["hashes"]) == {found["plain"]}
    assert found["ends"] == [[300, None, True]] * 3
    steps, back, refusals = found["ring"]
    assert steps == [301, 302, 303]
    assert back == [True, [301, 302]]
    assert refusals[0] == "step 300 is not stored (stored: 301 to 303): use more ticks, or rewind less"
    assert "was restored to another state" in refusals[1]


PEERS = """<!DOCTYPE html><title>two players</title><link rel="icon" href="data:,"><script type="module">
const [a, b] = [new RTCPeerConnection(), new RTCPeerConnection()];
a.onicecandidate = ({ candidate }) => candidate && b.addIceCandidate(candidate);
b.onicecandidate = ({ candidate }) => candidate && a.addIceCandidate(candidate);
const options = { ordered: false, maxRetransmits: 0, negotiated: true, id: 0 };
window.channels = [a, b].map((each) => each.createDataChannel("game", options));
const opens = (channel) => new Promise((done) => channel.addEventListener("open", done));
const open = Promise.all(window.channels.map(opens));
await a.setLocalDescription();
await b.setRemoteDescription(a.localDescription);
await b.setLocalDescription();
await a.setRemoteDescription(b.localDescription);
await open;
const players = await Promise.all([import("./player0.js"), import("./player1.js")]);
const frames = (count) => new Promise((done) => {
  let made = 0;
  const timer = setInterval(() => {
    players.forEach(({ frame, session }, i) => {
      if (session.tick < count) frame((session.tick * (i + 3)) % 251, session.tick % 16 < 8 ? 200 : 0);
      else {
        session.settle();
        channels[i].send(session.message());
      }
    });
    made += 1;
    if (made < 10 * count && players.some(({ session }) => session.confirmed < count)) return;
    clearInterval(timer);
    done();
  }, 4);
});
await frames(200);
window.found = players.map(({ world, session }) => {
  session.settle();
  return [session.tick, session.confirmed, session.desync, world.hash()];
});
</script>"""


def test_the_code_of_the_documentation_plays_over_webrtc_in_a_browser(arena, sample, tmp_path):
    """The channel is unordered and does not repeat messages.

    Both players end in the state of a world that knows all inputs.
    """
    (code,) = re.findall(r"```js\n(.*?)```", (ROOT / "docs" / "network.md").read_text(), re.DOTALL)
    shutil.copytree(arena, tmp_path / "game.softworld")
    (tmp_path / "index.html").write_text(PEERS)
    for player in (0, 1):
        own = code.replace("player: 1", f"player: {player}")
        text = f"const channel = window.channels[{player}];\n{own}\nexport {{ frame, session, world }};\n"
        (tmp_path / f"player{player}.js").write_text(text)
    with serving(tmp_path) as address, chromium() as browser:
        page, complaints, _ = opened(browser, f"{address}/index.html")
        page.wait_for_function("window.found")
        first, second = page.evaluate("window.found")
    world, bodies = sample[1].world, sample[1].players
    start = world.snapshot()
    for tick in range(200):
        for who, body in enumerate(bodies):
            left, right = tick * (who + 3) % 251, 200 if tick % 16 < 8 else 0
            body.apply_force((2.0 * (right - left), 0.0, 0.0))
        world.step(1 / 60)
    wanted = [200, 200, None, world.bodies_hash()]
    world.restore(start)
    assert [first, second] == [wanted, wanted]
    assert complaints == []

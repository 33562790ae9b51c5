// Player of the network sample in Node.js, with a WebAssembly world. The program does the same as `player.py`.
//
//     node player.mjs FOLDER --port N --ticks N [--fast]

import { createSocket } from "node:dgram";
import { readFileSync } from "node:fs";
import { parseArgs } from "node:util";

import { RollbackSession } from "../rollback.js";
import { sceneOf } from "../taichi-soft.js";

const [DT, SUBSTEPS] = [1 / 60, 8];
const [FORCE, LIFT] = [8, 0.02];
const PLAYER = 1;

const string = { type: "string" };
const { values, positionals } = parseArgs({
  allowPositionals: true,
  options: { port: string, ticks: string, fast: { type: "boolean" } },
});
const ticks = Number(values.ticks);
const [code, file] = ["kernels/web.wasm", "world.tsw"].map((name) => readFileSync(`${positionals[0]}/${name}`));
const world = (await sceneOf(code, file)).createWorld();
const players = [0, 1].map((i) => world.body(`players[${i}]`));
const stage = world.collider("stage");

function act(inputs) {
  inputs.forEach(([x, y], i) => players[i].applyForce([FORCE * (x - 100), FORCE * (y - 100), 0]));
  stage.moveTo({ position: [0, 0, LIFT * (inputs[0][2] + inputs[1][2])] });
}

function press(tick, player) {
  const turn = Math.floor(tick / (17 + 6 * player));
  return Uint8Array.of((37 * turn + 91 * player) % 201, (59 * turn + 13 * player) % 201, Number(tick % 50 < 5 + player));
}

const session = new RollbackSession(world, act, { player: PLAYER, inputSize: 3, dt: DT, substeps: SUBSTEPS });
const line = createSocket("udp4");
let [frames, remade, milliseconds] = [0, 0, 0];

function frame() {
  const start = performance.now();
  const made = session.settle();
  if (made) milliseconds += performance.now() - start;
  remade += made;
  frames += 1;
  const isAhead = session.ahead > 1 && frames % 10 === 0;
  if (session.tick < ticks && !isAhead) session.advance(press(session.tick, PLAYER));
  line.send(session.message());
  line.send(session.confirmed >= ticks && session.tick === ticks ? "done" : "frame");
}

// Runs frames in real time.
function run(due = performance.now()) {
  frame();
  const next = due + 1000 * DT;
  setTimeout(run, Math.max(next - performance.now(), 0), next);
}

function end() {
  session.settle();
  const { tick, rollbacks, longestRewind, desync, ahead } = session;
  const ms = milliseconds / Math.max(remade, 1);
  const hash = world.hash();
  console.log(JSON.stringify({ hash, ticks: tick, rollbacks, longest: longestRewind, remade, ms, desync, ahead }));
  process.exit();
}

const CALLS = { start: () => values.fast || run(), frame, end };
line.on("message", (data) => {
  const call = data.length < 8 ? CALLS[data.toString()] : null;
  if (call) call();
  else session.receive(data);
});
line.connect(Number(values.port), "127.0.0.1", () => line.send("ready"));

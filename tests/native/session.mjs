// Plays lists of calls on a rollback session, as `test_network.py` does in Python:
//
//     node session.mjs FOLDER < CALLS        CALLS: {"options": {...}, "calls": [["advance", "64c800"], ...]} in JSON

import { readFileSync } from "node:fs";

import { RollbackSession } from "../../engine_adapter/web/rollback.js";
import { sceneOf } from "../../engine_adapter/web/taichi-soft.js";

const folder = process.argv[2];
const [code, file] = ["kernels/web.wasm", "world.tsw"].map((name) => readFileSync(`${folder}/${name}`));
const world = (await sceneOf(code, file)).createWorld();
const { options, calls } = JSON.parse(readFileSync(0, "utf8"));
const bytes = (text) => Uint8Array.from(Buffer.from(text, "hex"));
const players = [0, 1].map((i) => world.body(`players[${i}]`));
const stage = world.collider("stage");
let refused = false;

function act(inputs) {
  inputs.forEach(([x, y], i) => players[i].applyForce([8 * (x - 100), 8 * (y - 100), 0]));
  stage.moveTo({ position: [0, 0, 0.02 * (inputs[0][2] + inputs[1][2])] });
  if (refused) throw new Error("of the game");
}

const session = new RollbackSession(world, act, { ...options, substeps: 8 });
const told = [];
for (const [call, text] of calls) {
  let found;
  refused = call === "refused";
  try {
    if (call === "settle") found = session.settle();
    else if (call === "receive") found = session.receive(bytes(text)) ?? null;
    else found = session.advance(bytes(text));
  } catch (error) {
    found = `${error.name}: ${error.message}`;
  }
  const { tick, confirmed, rollbacks, longestRewind, desync } = session;
  const message = Buffer.from(session.message()).toString("hex");
  told.push([found, tick, confirmed, rollbacks, longestRewind, desync, world.hash(), message]);
}
console.log(JSON.stringify(told));

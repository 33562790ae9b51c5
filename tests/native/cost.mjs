// What a world costs in JavaScript:
//
//     node cost.mjs FOLDER [STEPS]
import { readFileSync } from "node:fs";
import { brotliCompressSync, gzipSync } from "node:zlib";
import { sceneOf } from "../../engine_adapter/web/taichi-soft.js";

const [folder, steps = "300"] = process.argv.slice(2);
const [code, file] = ["kernels/web.wasm", "world.tsw"].map((name) => readFileSync(`${folder}/${name}`));
const kB = (bytes) => `${(bytes.length / 1000).toFixed(0)} kB`;
console.log(`gzipped: module ${kB(gzipSync(code, { level: 9 }))}, world ${kB(gzipSync(file, { level: 9 }))}`);
console.log(`by Brotli: module ${kB(brotliCompressSync(code))}, world ${kB(brotliCompressSync(file))}`);

const start = performance.now();
const scene = await sceneOf(code, file);
const loaded = performance.now();
const world = scene.createWorld();
const made = performance.now();
console.log(`loaded in ${(loaded - start).toFixed(1)} ms, a world in ${(made - loaded).toFixed(1)} ms`);

const times = Array.from({ length: Number(steps) }, () => {
  const before = performance.now();
  world.step(1 / 60);
  return performance.now() - before;
}).sort((a, b) => a - b);
const at = (share) => times[Math.floor(share * (times.length - 1))].toFixed(3);
console.log(`a step [ms]: least ${at(0)}, median ${at(0.5)}, most ${at(1)}`);

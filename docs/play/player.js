// The page that runs worlds. It opens the scene named after # in its address, handles input, and shows the meter.
import { loadScene } from "./taichi-soft.js";
import { Game } from "./game.js";
import { Stage } from "./stage.js";

const find = (id) => document.getElementById(id);
const [canvas, words, play, verdict] = ["view", "words", "play", "verdict"].map(find);
const wantsStill = matchMedia("(prefers-reduced-motion: reduce)").matches;
const LONGEST = 0.1; // longest time of a frame [s]: the world does not catch up after its tab was hidden
const MOST_STEPS = 4; // per frame
// A module of one function with a SIMD instruction.
const WITH_SIMD = Uint8Array.of(
  ...[0, 97, 115, 109, 1, 0, 0, 0, 1, 5, 1, 96, 0, 1, 123, 3, 2, 1, 0, 10, 10, 1, 8, 0, 65, 0, 253, 15, 253, 98, 11],
);

let scenes = [];
let stage = null;
let game = null;
let isPlaying = false;
let end = Infinity; // number of steps after which it pauses
let opened = 0; // number of opened scenes: a scene that finishes loading after the next was opened is dropped
let [last, due] = [0, 0]; // time of the last frame [ms]; simulated time still to be made [s]
let frames = []; // frames of the last second: { at, costs }, with the cost of each step [ms]
let [since, framed] = [0, 0]; // start of the count of frames for `Stage.ease` [ms]; the count
let told = 0; // time of the last update of the meter [ms]
const held = new Map(); // grabs by pointer

/** Something in place of the picture; nothing shows the picture. */
function say(text, still = "") {
  words.hidden = !text;
  words.replaceChildren(Object.assign(document.createElement("span"), { textContent: text }));
  words.style.backgroundImage = still && `url("../../pictures/play/${still}.jpg")`;
}

function whyNot() {
  if (typeof WebAssembly === "undefined") return "This browser has no WebAssembly, which the worlds need.";
  if (!WebAssembly.validate(WITH_SIMD)) {
    return "This browser's WebAssembly has no SIMD, which the worlds need: Chrome and Edge have it since 91, Firefox since 89, Safari since 16.4.";
  }
  if (!document.createElement("canvas").getContext("webgl2")) {
    return "This browser has no WebGL, which the page needs to draw: switch its hardware acceleration on.";
  }
  return "";
}

function setPlaying(value) {
  isPlaying = value && game !== null;
  if (!isPlaying) end = Infinity;
  play.textContent = isPlaying ? "Pause" : "Play";
  [frames, framed, since, due] = [[], 0, performance.now(), 0];
  tell(performance.now());
}

function reset() {
  releaseAll();
  game.reset();
  fill();
  verdict.textContent = "";
  stage.isStale = true;
  tell(performance.now());
}

/** Make the sliders and buttons of a scene. */
function fill() {
  const made = game.facts.controls.map((control) => {
    if (control.kind !== "spawn" && control.kind !== "blast" && control.kind !== "throw") return slider(control);
    const button = Object.assign(document.createElement("button"), { type: "button", textContent: control.label });
    button.addEventListener("click", () => act(() => game.press(control)));
    return button;
  });
  const buttons = Object.assign(document.createElement("div"), { className: "buttons" });
  buttons.append(...made.filter((each) => each.tagName === "BUTTON"));
  find("controls").replaceChildren(buttons, ...made.filter((each) => each.tagName !== "BUTTON"));
}

function slider(control) {
  const { label, min, max, step, value, unit } = control;
  const [row, input] = [document.createElement("div"), document.createElement("input")];
  row.className = "slider";
  const id = `slider-${label.replace(/\W+/g, "-")}`;
  Object.assign(input, { type: "range", id, min, max, step, value });
  const name = Object.assign(document.createElement("label"), { htmlFor: id, textContent: label });
  const shown = document.createElement("output");
  const show = () => {
    shown.textContent = `${input.value} ${unit}`;
    input.setAttribute("aria-valuetext", shown.textContent);
  };
  input.addEventListener("input", () => {
    show();
    act(() => game.set(control, Number(input.value)));
  });
  show();
  row.append(name, shown, input);
  return row;
}

/** Do something to the world. Where it refuses, the page says why. */
function act(doing) {
  if (!game) return;
  try {
    doing();
    verdict.textContent = "";
  } catch (error) {
    verdict.textContent = error.message;
  }
  stage.isStale = true;
}

/** Push what is in the middle of the picture, or else what is nearest to where the camera looks. */
function poke() {
  const caster = stage.ray();
  const hit = stage.hit(caster) ?? game.world.closest(stage.controls.target.toArray());
  if (hit) game.poke(hit, caster.ray.direction.toArray());
}

function press(event) {
  if (!game || event.button !== 0 || held.has(event.pointerId)) return;
  const hit = stage.hit(stage.ray(event));
  if (!hit) return;
  event.stopImmediatePropagation(); // the view does not turn
  canvas.focus({ preventScroll: true, focusVisible: false });
  canvas.setPointerCapture(event.pointerId);
  act(() => held.set(event.pointerId, { grab: game.grab(hit), plane: stage.facing(hit.point) }));
}

function pull(event) {
  if (!game) return;
  const mine = held.get(event.pointerId);
  if (!mine) {
    if (event.pointerType === "mouse" && !event.buttons) canvas.style.cursor = stage.hit(stage.ray(event)) ? "grab" : "move";
    return;
  }
  event.stopImmediatePropagation();
  const point = stage.ray(event).ray.intersectPlane(mine.plane, mine.plane.normal.clone());
  if (point) act(() => game.pull(mine.grab, point.toArray()));
}

function release(event) {
  const mine = held.get(event.pointerId);
  if (!mine) return;
  held.delete(event.pointerId);
  act(() => game.release(mine.grab));
}

function releaseAll() {
  for (const pointerId of [...held.keys()]) release({ pointerId });
}

/** Open the scene that the address names. */
async function open() {
  const number = (opened += 1);
  const { name, title, what } = scenes.find((each) => `#${each.name}` === location.hash) ?? scenes[0];
  leave();
  for (const link of find("scenes").children) {
    const isCurrent = link.hash === `#${name}`;
    if (isCurrent) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
    if (isCurrent) link.scrollIntoView({ block: "nearest", inline: "nearest" });
  }
  document.title = `${title} - taichi-soft`;
  find("title").textContent = title;
  find("what").textContent = what;
  canvas.setAttribute("aria-label", `${title}, in three dimensions`);
  const missing = whyNot();
  if (missing) return say(missing, name);
  say("Loading", name);
  try {
    stage ??= new Stage(canvas);
    const [scene, answer] = await Promise.all([loadScene(`${name}/world`), fetch(`${name}/scene.json`)]);
    const mine = new Game(scene, { name, ...(await answer.json()) });
    if (number !== opened) return mine.destroy();
    game = mine;
    await stage.show(game, name);
    if (number !== opened) return undefined;
  } catch (error) {
    if (number === opened) say(`This scene cannot be opened: ${error.message}`, name);
    throw error;
  }
  fill();
  say("");
  stage.isStale = true;
  setPlaying(!wantsStill);
  if (wantsStill) verdict.textContent = "Paused, because your system is set to reduce motion. Press Play.";
  return undefined;
}

/** Give back all that the scene has. */
function leave() {
  if (!game) return;
  releaseAll();
  setPlaying(false);
  verdict.textContent = "";
  find("controls").replaceChildren();
  stage.clear();
  game.destroy();
  game = null;
}

function median(numbers) {
  const sorted = numbers.toSorted((a, b) => a - b);
  return sorted[Math.floor(sorted.length / 2)];
}

/** Write the meter. */
function tell(now) {
  told = now;
  const costs = frames.flatMap((each) => each.costs);
  const span = frames.length > 1 ? frames.at(-1).at - frames[0].at : 0;
  find("cost").textContent = costs.length ? `${median(costs).toFixed(1)} ms` : "–";
  find("rate").textContent = span ? `${((1000 * (frames.length - 1)) / span).toFixed(0)} a second` : "–";
  find("steps").textContent = game ? game.steps : "";
  find("hash").textContent = game ? game.hash : "";
}

/** Make the steps that are due. Returns the cost of each [ms]. */
function steps(seconds) {
  const { dt } = game.facts;
  // If the screen's frame rate is close to the rate of steps, make one step per frame.
  due += Math.abs(seconds - dt) < 0.06 * dt ? dt : seconds;
  const costs = [];
  while (due > 0.999 * dt && costs.length < MOST_STEPS && game.steps < end) {
    const begin = performance.now();
    game.step();
    costs.push(performance.now() - begin);
    due -= dt;
  }
  if (due > dt) due = 0; // drop time that this machine cannot simulate
  return costs;
}

function frame(now) {
  requestAnimationFrame(frame);
  const passed = Math.min((now - last) / 1000, LONGEST);
  last = now;
  if (!game || !stage?.scene || document.hidden) return;
  if (isPlaying) {
    frames.push({ at: now, costs: steps(passed) });
    framed += 1;
    stage.isStale = true;
    while (now - frames[0].at > 1000) frames.shift();
    if (game.steps >= end) finish();
  }
  if (stage.isStale) stage.draw();
  if (isPlaying && now - told > 250) {
    tell(now);
    if (now - since < 1000) return;
    stage.ease((1000 * framed) / (now - since));
    [since, framed] = [now, 0];
  }
}

/** Compare the hash of this step with that of a PC. */
function finish() {
  setPlaying(false);
  const { steps: count, hash } = game.facts.proof;
  const is = game.hash === hash ? "the same as on the PC that built this page" : `but the PC that built this page had ${hash}`;
  const what = `Step ${count} has the hash ${game.hash}`;
  verdict.textContent = game.isTouched ? `${what}. You changed the world before that step, so it cannot be compared.` : `${what}, ${is}.`;
}

async function save() {
  const playing = game;
  const { name } = playing.facts;
  const file = `${name}.played.json`;
  let start;
  try {
    const answer = await fetch(`${name}/${name}.recording`);
    if (!answer.ok) throw new Error(`${answer.status} ${answer.statusText}`);
    start = new Uint8Array(await answer.arrayBuffer());
  } catch (error) {
    verdict.textContent = `This cannot be saved, because ${name}.recording cannot be read: ${error.message}`;
    return;
  }
  // Record after the download, so that the file and the hash belong to the same step.
  const [text, hash] = [playing.recording(start), playing.recordedHash];
  const href = URL.createObjectURL(new Blob([text], { type: "application/json" }));
  Object.assign(document.createElement("a"), { href, download: file }).click();
  URL.revokeObjectURL(href);
  if (playing === game) verdict.textContent = `On a PC, taichi-soft replay ${file} repeats these steps and prints ${hash}.`;
}

const KEYS = {
  ArrowLeft: () => stage.turn(-0.12, 0, 1),
  ArrowRight: () => stage.turn(0.12, 0, 1),
  ArrowUp: () => stage.turn(0, 0.08, 1),
  ArrowDown: () => stage.turn(0, -0.08, 1),
  "+": () => stage.turn(0, 0, 0.9),
  "=": () => stage.turn(0, 0, 0.9),
  "-": () => stage.turn(0, 0, 1 / 0.9),
  " ": () => setPlaying(!isPlaying),
  r: reset,
  p: () => act(poke),
};
canvas.addEventListener("keydown", (event) => {
  if (!game || !KEYS[event.key] || event.ctrlKey || event.altKey || event.metaKey) return;
  event.preventDefault();
  KEYS[event.key]();
});
for (const [name, listener] of [["pointerdown", press], ["pointermove", pull], ["pointerup", release], ["pointercancel", release], ["lostpointercapture", release]]) {
  canvas.parentElement.addEventListener(name, listener, { capture: true });
}
window.addEventListener("blur", releaseAll);
document.addEventListener("visibilitychange", releaseAll);
window.addEventListener("hashchange", open);
play.addEventListener("click", () => setPlaying(!isPlaying));
find("reset").addEventListener("click", () => game && reset());
find("poke").addEventListener("click", () => act(poke));
find("check").addEventListener("click", () => {
  if (!game) return;
  reset();
  setPlaying(true);
  end = game.facts.proof.steps;
});
find("save").addEventListener("click", () => game && save());

scenes = await (await fetch("scenes.json")).json();
for (const { name, title } of scenes) {
  find("scenes").append(Object.assign(document.createElement("a"), { href: `#${name}`, textContent: title }));
}
requestAnimationFrame(frame);
await open().catch((error) => console.error(error));

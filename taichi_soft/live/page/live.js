// Keeps a connection, hands packets to the picture and words to the panel.
import { Panel } from "./panel.js";
import { Picture } from "./picture.js";

const DRAWN = 1, PICTURE = 2;
const TYPES = { uint8: Uint8Array, uint32: Uint32Array, float32: Float32Array };
const ARRAYS = { "<u4": "uint32", "<f4": "float32" };

let tries = 0, socket = null, panel = null, waiting = [], shown = [];
const wish = said => {
  if (socket?.readyState !== WebSocket.OPEN) return;
  socket.send(said instanceof ArrayBuffer ? said : JSON.stringify(said));
};

// From a move of the hand to the frame after the one that first shows it [ms], of the last moves.
const begun = new Map(), late = [];
let pull = 0;

function arrived(pull) {
  if (!begun.has(pull)) return;
  late.push(performance.now() - begun.get(pull));
  begun.forEach((_, number) => { if (number <= pull) begun.delete(number); });
  if (late.length > 60) late.shift();
  const sorted = [...late].sort((a, b) => a - b), share = q => sorted[Math.floor(q * (sorted.length - 1))].toFixed(0);
  document.getElementById("late").textContent = `${share(0.5)}, ${share(0.95)} ms`;
}

// A hand moves at most 60 times a second: pointers tell more often.
let moved = null, movedAt = 0, moves = 0;
const hand = {
  grab: (pane, origin, direction) => wish({ do: "grab", pane, origin, direction }),
  move: (pane, point) => {
    if (!moved) begun.set(++moves, performance.now());
    moved = { do: "move", pane, point, number: moves };
  },
  release: pane => { if (moved) wish(moved); moved = null; wish({ do: "release", pane }); },
};

const canvas = document.getElementById("picture");
let picture;
try {
  picture = new Picture(canvas, hand);
} catch (error) {
  say("this browser has no WebGL to draw with: switch its hardware acceleration on, or take another browser");
  throw error;
}
picture.shot = () => canvas.toBlob(blob => panel.offer(URL.createObjectURL(blob), "live.png"));

function connect() {
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  socket = new WebSocket(`${scheme}://${location.host}/live${location.search}`);
  socket.binaryType = "arraybuffer";
  socket.onmessage = event => (typeof event.data === "string" ? hear(JSON.parse(event.data)) : take(event.data));
  socket.onopen = () => { tries = 0; };
  socket.onclose = event => {
    waiting = [];
    tries += 1;
    say(event.code === 1008 ? "cut off: too many messages" : "there is no connection: it was refused, or the server has ended");
    setTimeout(connect, Math.min(1000 * 2 ** (tries - 1), 15000));
  };
}

function say(words) {
  if (panel) panel.say(words);
  else document.getElementById("said").textContent = words;
}

function hear(message) {
  if (message.hello) {
    if (!panel) panel = new Panel(message, wish, picture);
    panel.say("");
  }
  else if (message.pull) pull = message.pull;
  else if (message.said) panel.say(message.said);
  else if (message.refused) panel.refuse(message.refused);
  else if (message.made) panel.offer(message.made + location.search, message.name);
  else if (message.panes) show(message.panes);
  else if (message.state) {
    panel.show(message.state, message.pane);
    if (message.pane === 0) panel.chosen(message.chosen, message.tint);
    name(message.pane, message.chosen);
  }
}

function show(panes) {
  shown = panes;
  picture.shown = panes.length ? panes : [0];
  picture.isStale = true;
  document.getElementById("alone").hidden = panes.length < 2;
  document.getElementById("names").replaceChildren();
}

function name(pane, chosen) {
  if (shown.length < 2) return;
  const box = document.getElementById("names"), id = `name${pane}`;
  let label = document.getElementById(id);
  if (!label) { label = document.createElement("span"); label.id = id; box.append(label); }
  label.style.left = `calc(${(100 * shown.indexOf(pane)) / shown.length}% + .6rem)`;
  label.textContent = [chosen.law ?? "as the scene has it", chosen.strain, chosen.flips].filter(Boolean).join(", ");
}

function take(buffer) {
  const view = new DataView(buffer), pane = view.getUint8(1);
  if (view.getUint8(0) === DRAWN) {
    const length = view.getUint32(4, true);
    const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 8, length)));
    const arrays = {};
    let offset = 8 + length;
    for (const [key, [type, shape]] of Object.entries(header.arrays)) {
      const Kind = TYPES[ARRAYS[type] ?? type], count = shape.reduce((a, b) => a * b, 1);
      arrays[key] = new Kind(buffer, offset, count);
      offset += Math.ceil((count * Kind.BYTES_PER_ELEMENT) / 4) * 4;
    }
    picture.draw(pane, header, arrays);
    document.getElementById("title").textContent = header.title;
    document.title = `${header.title} – taichi-soft live`;
  } else waiting[pane] = buffer;
}

// The newest picture of each pane, once a frame of the screen.
let counted = 0, since = performance.now();
function frame() {
  requestAnimationFrame(frame);
  if (moved && performance.now() - movedAt > 15) { wish(moved); moved = null; movedAt = performance.now(); }
  let number = 0;
  waiting.forEach((buffer, pane) => {
    if (!buffer) return;
    const one = read(buffer);
    picture.move(pane, one);
    number = Math.max(number, one.number);
    waiting[pane] = null;
    counted += pane === 0;
  });
  picture.render();
  if (number && pull) { const done = pull; pull = 0; requestAnimationFrame(() => arrived(done)); }
  if (number) wish({ do: "seen", number });
  const now = performance.now();
  if (now - since > 1000) {
    document.getElementById("fps").textContent = `${((1000 * counted) / (now - since)).toFixed(0)} /s`;
    counted = 0; since = now;
  }
}

function read(buffer) {
  const view = new DataView(buffer), real = at => view.getFloat32(at, true);
  const solids = picture.panes.get(view.getUint8(1))?.solids.length ?? 0;
  const count = view.getUint32(12, true), normals = 48 + 48 * solids;
  return {
    isTinted: view.getUint8(2) === 1,
    number: view.getUint32(4, true),
    version: view.getUint32(8, true),
    count,
    time: view.getFloat64(16, true),
    low: [real(24), real(28), real(32)],
    size: [real(36), real(40), real(44)],
    poses: new Float32Array(buffer, 48, 12 * solids),
    normals: new Int8Array(buffer, normals, 4 * count),
    rows: new Uint16Array(buffer, normals + 4 * count, 3 * count),
  };
}

connect();
requestAnimationFrame(frame);

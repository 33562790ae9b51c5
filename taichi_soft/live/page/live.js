// Keeps the connection to the server. Passes packets to the view and messages to the panel.
import { Activities } from "./activities.js";
import { Panel } from "./panel.js";
import { View } from "./view.js";

const DRAWN = 1;
const TYPES = { uint8: Uint8Array, uint32: Uint32Array, float32: Float32Array };
const ARRAYS = { "<u4": "uint32", "<f4": "float32" };

let tries = 0, socket = null, panel = null, waiting = [], shown = [];
const activities = new Activities(document.getElementById("activities"));
const send = request => {
  if (socket?.readyState !== WebSocket.OPEN) return;
  socket.send(request instanceof ArrayBuffer ? request : JSON.stringify(request));
};

// Send only the newest value of each slider per screen frame. Send waiting values before any other request.
const values = new Map();
const sendValues = () => { values.forEach(send); values.clear(); };
const ask = request => {
  if (request.do === "set") values.set(request.name, request);
  else { sendValues(); send(request); }
};

// Latencies of the last moves [ms]: from a move of the pointer until one screen frame after the move is drawn.
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

// Send at most 60 moves per second; pointers report more.
let moved = null, movedAt = 0, moves = 0;
const hand = {
  grab: (pane, origin, direction) => ask({ do: "grab", pane, origin, direction }),
  move: (pane, point) => {
    if (!moved) begun.set(++moves, performance.now());
    moved = { do: "move", pane, point, number: moves };
  },
  release: pane => { if (moved) ask(moved); moved = null; ask({ do: "release", pane }); },
};

const canvas = document.getElementById("view");
let view;
try {
  view = new View(canvas, hand);
} catch (error) {
  say("this browser has no WebGL: turn on hardware acceleration, or use another browser");
  throw error;
}
view.shot = () => canvas.toBlob(blob => panel.offer(URL.createObjectURL(blob), "live.png"));

function connect() {
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  socket = new WebSocket(`${scheme}://${location.host}/live${location.search}`);
  socket.binaryType = "arraybuffer";
  socket.onmessage = event => (typeof event.data === "string" ? hear(JSON.parse(event.data)) : take(event.data));
  socket.onopen = () => { tries = 0; };
  socket.onclose = event => {
    waiting = [];
    tries += 1;
    activities.show([]);
    say(event.code === 1008 ? "disconnected: too many messages" : "no connection: the server refused it or has ended");
    setTimeout(connect, Math.min(1000 * 2 ** (tries - 1), 15000));
  };
}

function say(words) {
  if (panel) panel.stop(words);
  else document.getElementById("said").textContent = words;
}

function hear(message) {
  if (message.hello) {
    if (!panel) panel = new Panel(message, ask, view);
    panel.stop(null);
    panel.say("");
  }
  else if (message.status) {
    activities.show(message.status.activities);
    panel.stop(message.status.trouble);
  }
  else if (message.pull) pull = message.pull;
  else if (message.said) panel.say(message.said);
  else if (message.refused) panel.say(message.refused, true);
  else if (message.made) panel.offer(message.made + location.search, message.name);
  else if (message.panes) show(message.panes);
  else if (message.state) {
    panel.show(message);
    name(message.pane, message.chosen);
  }
}

function show(panes) {
  shown = panes;
  view.shown = panes.length ? panes : [0];
  view.isStale = true;
  document.getElementById("alone").hidden = panes.length < 2;
  document.getElementById("names").replaceChildren();
}

function name(pane, chosen) {
  if (shown.length < 2) return;
  const box = document.getElementById("names"), id = `name${pane}`;
  let label = document.getElementById(id);
  if (!label) { label = document.createElement("span"); label.id = id; box.append(label); }
  label.style.left = `calc(${(100 * shown.indexOf(pane)) / shown.length}% + .6rem)`;
  label.textContent = [chosen.law ?? "scene default", chosen.strain, chosen.flips].filter(Boolean).join(", ");
}

function take(buffer) {
  const data = new DataView(buffer), pane = data.getUint8(1);
  if (data.getUint8(0) === DRAWN) {
    const length = data.getUint32(4, true);
    const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 8, length)));
    const arrays = {};
    let offset = 8 + length;
    for (const [key, [type, shape]] of Object.entries(header.arrays)) {
      const Kind = TYPES[ARRAYS[type] ?? type], count = shape.reduce((a, b) => a * b, 1);
      arrays[key] = new Kind(buffer, offset, count);
      offset += Math.ceil((count * Kind.BYTES_PER_ELEMENT) / 4) * 4;
    }
    view.draw(pane, header, arrays);
    document.body.classList.remove("empty");
    document.getElementById("title").textContent = header.title;
    document.title = `${header.title} – taichi-soft live`;
  } else waiting[pane] = buffer;
}

// Draw the newest frame of each pane once per screen frame.
let counted = 0, since = performance.now();
function frame() {
  requestAnimationFrame(frame);
  if (moved && performance.now() - movedAt > 15) { ask(moved); moved = null; movedAt = performance.now(); }
  let number = 0;
  waiting.forEach((buffer, pane) => {
    if (!buffer) return;
    const one = read(buffer);
    view.move(pane, one);
    number = Math.max(number, one.number);
    waiting[pane] = null;
    counted += pane === 0;
  });
  sendValues();
  view.render();
  if (number && pull) { const done = pull; pull = 0; requestAnimationFrame(() => arrived(done)); }
  if (number) ask({ do: "seen", number });
  const now = performance.now();
  if (now - since > 1000) {
    document.getElementById("fps").textContent = ((1000 * counted) / (now - since)).toFixed(0);
    counted = 0; since = now;
  }
}

function read(buffer) {
  const data = new DataView(buffer), real = at => data.getFloat32(at, true);
  const solids = view.panes.get(data.getUint8(1))?.solids.length ?? 0;
  const count = data.getUint32(12, true), normals = 48 + 48 * solids;
  return {
    isTinted: data.getUint8(2) === 1,
    number: data.getUint32(4, true),
    version: data.getUint32(8, true),
    count,
    time: data.getFloat64(16, true),
    low: [real(24), real(28), real(32)],
    size: [real(36), real(40), real(44)],
    poses: new Float32Array(buffer, 48, 12 * solids),
    normals: new Int8Array(buffer, normals, 4 * count),
    rows: new Uint16Array(buffer, normals + 4 * count, 3 * count),
  };
}

connect();
requestAnimationFrame(frame);

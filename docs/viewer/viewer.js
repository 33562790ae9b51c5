// Shows the motions that the page carries: bodies to turn, and time to scrub. motion.py says what a motion holds.
import * as THREE from "three";
import { OrbitControls } from "orbit-controls";

const find = (id) => document.getElementById(id);
const [canvas, play, slider, told, speed] = ["view", "play", "time", "told", "speed"].map(find);
const isEmbedded = window !== window.top;
const BACK = 0xd3dbe2; // colour of what is far away, sRGB
const FILMED = 16 / 9; // width over height of the pictures that the cameras of the demos frame

let renderer;
try {
  renderer = new THREE.WebGLRenderer({ canvas, antialias: true });
} catch (error) {
  told.textContent = "no WebGL to draw with: switch your browser's hardware acceleration on";
  throw error;
}
renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
renderer.shadowMap.enabled = true;
const camera = new THREE.PerspectiveCamera();
camera.up.set(0, 0, 1);
const controls = new OrbitControls(camera, canvas);
controls.addEventListener("change", () => (isStale = true));
if (isEmbedded) {
  controls.enableZoom = false; // the page round it scrolls by the wheel,
  canvas.style.touchAction = "pan-y"; // and by a finger
}
find("help").querySelector(isEmbedded ? "[data-alone]" : "[data-embedded]").hidden = true;

let shown = null; // the motion on the stage
let scene = null;
let time = 0; // frames since its beginning
let isPlaying = !window.matchMedia("(prefers-reduced-motion: reduce)").matches;
let isStale = true; // something has changed since it was drawn
let isInView = true;
let last = 0; // when it was drawn [ms]

/** The header of a motion, with a `frames` of numbers in place of their count, and parts with theirs. */
async function read(element) {
  const bytes = new Uint8Array(await window.unpack(element).arrayBuffer());
  const begin = 4 + new DataView(bytes.buffer).getUint32(0, true);
  const motion = JSON.parse(new TextDecoder().decode(bytes.subarray(4, begin)));
  const numbers = new Uint16Array((bytes.length - begin) / 2);
  for (let i = 0; i < numbers.length; i++) numbers[i] = bytes[begin + i] + 256 * bytes[begin + numbers.length + i];
  let at = 0;
  const take = (count) => numbers.subarray(at, (at += count));
  for (const part of motion.parts) {
    part.point = take(part.vertices);
    part.corners = take(3 * part.triangles);
  }
  let moving = 0; // points before those of a part that moves, in the end all of them
  for (const part of motion.parts) {
    if (part.moves) part.first = moving;
    else part.rows = take(3 * part.points);
    moving += part.moves ? part.points : 0;
  }
  const frames = [take(3 * moving)];
  const change = new Uint16Array(3 * moving); // such arrays count modulo 65536
  for (let k = 1; k < motion.frames; k++) {
    const further = take(3 * moving);
    const next = frames[k - 1].slice();
    for (let i = 0; i < next.length; i++) next[i] += change[i] += further[i];
    frames.push(next);
  }
  return { ...motion, frames, moving };
}

/** Put the vertices of a part where its points are, on their way from one row of numbers to the next. */
function place(part, motion, one, next, share) {
  const [stride, first] = part.moves ? [motion.moving, part.first] : [part.points, 0];
  const position = part.mesh.geometry.getAttribute("position");
  for (let v = 0; v < part.vertices; v++) {
    for (let axis = 0; axis < 3; axis++) {
      const i = axis * stride + first + part.point[v];
      const number = one[i] + share * (next[i] - one[i]);
      position.array[3 * v + axis] = motion.lower[axis] + motion.quantum * number;
    }
  }
  position.needsUpdate = true;
  part.mesh.geometry.computeVertexNormals();
}

function meshOf(part) {
  const geometry = new THREE.BufferGeometry();
  geometry.setIndex(new THREE.BufferAttribute(part.corners, 1));
  geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(3 * part.vertices), 3));
  const color = new THREE.Color().setRGB(...part.color, THREE.SRGBColorSpace);
  const mesh = new THREE.Mesh(geometry, new THREE.MeshStandardMaterial({ color, roughness: 0.6 }));
  mesh.castShadow = mesh.receiveShadow = true;
  mesh.frustumCulled = false;
  return mesh;
}

/** Light, as in the films: the sun over the left shoulder of the camera. */
function lights(motion, reach) {
  const sun = new THREE.DirectionalLight(0xfff4e6, 2.6);
  const [x, y] = [0, 1].map((axis) => motion.eye[axis] - motion.target[axis]);
  const angle = Math.atan2(y, x) - 1.1;
  sun.target.position.set(...motion.target);
  sun.position.set(Math.cos(angle), Math.sin(angle), 1.28).multiplyScalar(reach).add(sun.target.position);
  sun.castShadow = true;
  sun.shadow.mapSize.set(2048, 2048);
  sun.shadow.normalBias = 0.01 * reach;
  const seen = { left: -reach, right: reach, bottom: -reach, top: reach, near: 0.01, far: 4 * reach };
  Object.assign(sun.shadow.camera, seen);
  const sky = new THREE.HemisphereLight(0xe3edf8, 0xb5ada2, 1.5);
  sky.position.set(0, 0, 1);
  return [sun, sun.target, sky];
}

/** The floor, of tiles of a metre. */
function ground(height, reach) {
  const size = 40 * Math.ceil(reach);
  const tile = Object.assign(document.createElement("canvas"), { width: 256, height: 256 });
  const ink = Object.assign(tile.getContext("2d"), { fillStyle: "#b4bac0", strokeStyle: "#9aa2a9", lineWidth: 6 });
  ink.fillRect(0, 0, 256, 256);
  ink.strokeRect(0, 0, 256, 256);
  const map = new THREE.CanvasTexture(tile);
  map.wrapS = map.wrapT = THREE.RepeatWrapping;
  map.repeat.set(size, size);
  map.colorSpace = THREE.SRGBColorSpace;
  map.anisotropy = renderer.capabilities.getMaxAnisotropy();
  const material = new THREE.MeshStandardMaterial({ map, roughness: 1 });
  const floor = new THREE.Mesh(new THREE.PlaneGeometry(size, size), material);
  floor.receiveShadow = true;
  floor.position.z = height - 0.001; // what lies on it is not within it
  return floor;
}

function firstView() {
  camera.position.set(...shown.eye);
  controls.target.set(...shown.target);
  controls.update();
  isStale = true;
}

function show(motion) {
  scene?.traverse((each) => {
    for (const held of [each.geometry, each.material?.map, each.material]) held?.dispose();
  });
  [shown, time] = [motion, 0];
  const distance = new THREE.Vector3(...motion.eye).distanceTo(new THREE.Vector3(...motion.target));
  const reach = distance * Math.tan((motion.fov * Math.PI) / 360) * FILMED;
  scene = new THREE.Scene();
  scene.background = new THREE.Color(BACK);
  scene.fog = new THREE.Fog(BACK, 2 * distance, 2 * distance + 8 * reach);
  scene.add(...lights(motion, reach));
  if (motion.floor !== null) scene.add(ground(motion.floor, reach));
  for (const part of motion.parts) {
    part.mesh = meshOf(part);
    scene.add(part.mesh);
    if (!part.moves) place(part, motion, part.rows, part.rows, 0);
  }
  Object.assign(camera, { near: distance / 100, far: 20 * (distance + reach) });
  Object.assign(controls, { minDistance: distance / 5, maxDistance: 3 * distance });
  controls.maxPolarAngle = motion.floor === null ? Math.PI : Math.PI / 2 - 0.02;
  slider.max = motion.frames.length - 1;
  canvas.setAttribute("aria-label", `${motion.title}, in three dimensions: arrow keys turn it, space plays it`);
  fit();
  firstView();
}

/** The width that its film shows is in the picture, whatever its shape. */
function fit() {
  const { clientWidth, clientHeight } = find("stage");
  if (!shown || !clientWidth || !clientHeight) return;
  renderer.setSize(clientWidth, clientHeight, false);
  camera.aspect = clientWidth / clientHeight;
  const widening = Math.max(1, FILMED / camera.aspect);
  camera.fov = (360 / Math.PI) * Math.atan(Math.tan((shown.fov * Math.PI) / 360) * widening);
  camera.updateProjectionMatrix();
  isStale = true;
}

function setPlaying(value) {
  isPlaying = value;
  play.textContent = isPlaying ? "Pause" : "Play";
  isStale = true;
}

/** Stop at a frame. */
function goTo(frame) {
  time = Math.min(Math.max(frame, 0), shown.frames.length - 1);
  setPlaying(false);
}

/** Turn about the target [rad], and come nearer by a factor. */
function turn(around, upwards, factor) {
  const away = camera.position.clone().sub(controls.target);
  const at = new THREE.Spherical().setFromCartesianCoords(away.x, away.z, -away.y);
  at.theta += around;
  at.phi = Math.min(Math.max(at.phi - upwards, 0.05), controls.maxPolarAngle);
  at.radius = Math.min(Math.max(at.radius * factor, controls.minDistance), controls.maxDistance);
  away.setFromSpherical(at);
  camera.position.copy(controls.target).add(new THREE.Vector3(away.x, -away.z, away.y));
  controls.update();
  isStale = true;
}

function draw(now) {
  requestAnimationFrame(draw);
  const passed = Math.min((now - last) / 1000, 0.25);
  last = now;
  if (!shown || !isInView || !(isPlaying || isStale)) return;
  const end = shown.frames.length - 1;
  if (isPlaying) time = time < end ? Math.min(time + passed * shown.fps * speed.value, end) : 0;
  const frame = Math.floor(time);
  const [one, next] = [shown.frames[frame], shown.frames[Math.min(frame + 1, end)]];
  for (const part of shown.parts) if (part.moves) place(part, shown, one, next, time - frame);
  renderer.render(scene, camera);
  const seconds = (time / shown.fps).toFixed(2);
  slider.value = Math.round(time);
  told.textContent = `${seconds} of ${(end / shown.fps).toFixed(2)} s`;
  slider.setAttribute("aria-valuetext", `${seconds} seconds`);
  isStale = false;
}

const KEYS = {
  ArrowLeft: () => turn(-0.12, 0, 1),
  ArrowRight: () => turn(0.12, 0, 1),
  ArrowUp: () => turn(0, 0.08, 1),
  ArrowDown: () => turn(0, -0.08, 1),
  "+": () => turn(0, 0, 0.9),
  "=": () => turn(0, 0, 0.9),
  "-": () => turn(0, 0, 1 / 0.9),
  " ": () => setPlaying(!isPlaying),
  ",": () => goTo(Math.ceil(time) - 1),
  ".": () => goTo(Math.floor(time) + 1),
};
canvas.addEventListener("keydown", (event) => {
  if (!KEYS[event.key] || event.ctrlKey || event.altKey || event.metaKey) return;
  event.preventDefault();
  KEYS[event.key]();
});
play.addEventListener("click", () => setPlaying(!isPlaying));
slider.addEventListener("input", () => goTo(Number(slider.value)));
find("reset").addEventListener("click", firstView);
new ResizeObserver(fit).observe(find("stage"));
new IntersectionObserver((seen) => ([isInView, isStale] = [seen.at(-1).isIntersecting, true])).observe(canvas);

const elements = [...document.querySelectorAll("[data-motion]")];
async function choose(element) {
  const name = element.dataset.motion;
  document.querySelector(`#demos [value="${name}"]`).checked = true;
  show(await read(element));
}
for (const element of elements) {
  const label = document.createElement("label");
  const input = Object.assign(document.createElement("input"), { type: "radio", name: "demo" });
  input.value = element.dataset.motion;
  input.addEventListener("change", () => choose(element));
  label.append(input, input.value);
  find("demos").append(label);
}
const named = () => elements.find((each) => `#${each.dataset.motion}` === location.hash);
window.addEventListener("hashchange", () => named() && choose(named()));
setPlaying(isPlaying);
await choose(named() ?? elements[0]);
find("words").hidden = true;
requestAnimationFrame(draw);

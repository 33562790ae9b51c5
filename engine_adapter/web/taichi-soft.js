// Runs worlds from `taichi-soft export --for web` in a browser or in Node.js.
//
//     const world = await loadWorld("game.softworld");
//     const jelly = world.body("jelly").mesh();
//     function frame() {
//       world.advance(1 / 60);
//       jelly.update(); // jelly.positions and jelly.normals are views of the module's memory
//     }
//
// All quantities use SI units and the axes for which the world was exported. Rotations are quaternions [x, y, z, w].

const CODES = ["OK", "ARGUMENT", "HANDLE", "BUSY", "FILE", "VERSION", "SIZE", "STATE", "SNAPSHOT", "RUNTIME"];
const STATUS = { 0: "active", 1: "frozen", 2: "asleep", 5: "disabled" };
const KINDS = { body: 0, asset: 1, collider: 2, frame: 3, mesh: 4, joint: 5, motor: 6 };
const SHAPES = ["plane", "sphere", "box", "capsule"];
const ORIGIN = [0, 0, 0];
const UPRIGHT = [0, 0, 0, 1];

/** Bits for the kinds of events. */
export const EVENTS = { contactBegan: 1, contactEnded: 2, fellAsleep: 4, woke: 8, froze: 16, entered: 32, left: 64 };
const EVENT_NAMES = Object.fromEntries(Object.entries(EVENTS).map(([name, bit]) => [bit, name]));

/** An error of the library, with a `code` such as ARGUMENT or STATE. A refused call changes nothing. */
export class SoftError extends Error {
  constructor(code, text) {
    super(text);
    this.name = "SoftError";
    this.code = CODES[-code] ?? "RUNTIME";
  }
}

// Returns the bytes of an ArrayBuffer or of a typed array.
function bytesIn(given, name) {
  if (given instanceof ArrayBuffer) return new Uint8Array(given);
  if (ArrayBuffer.isView(given)) return new Uint8Array(given.buffer, given.byteOffset, given.byteLength);
  throw new SoftError(-1, `${name} is ${shown(given)}: give a typed array or an ArrayBuffer`);
}

// Returns the numbers of a vector as an array. The vector can be an array, a typed array, or a Vector3 or Quaternion of
// three.js.
function vector(value, name, count = 3) {
  const found = typeof value?.[Symbol.iterator] === "function" ? Array.from(value, Number) : [];
  if (found.length === count) return found;
  throw new SoftError(-1, `${name} must have ${count} numbers, got ${Array.isArray(value) ? `[${value}]` : value}`);
}

function shown(value) {
  if (typeof value === "string") return JSON.stringify(value);
  return typeof value === "object" ? (value?.constructor?.name ?? "null") : String(value);
}

// Requires a 32-bit integer. WebAssembly would convert other values, for example text to 0 and 2.7 to 2.
function whole(value, name, way = "a 32-bit integer") {
  if (Number.isInteger(value) && value === (value | 0)) return value;
  throw new SoftError(-1, `${name} is ${shown(value)}: give ${way}`);
}

// Requires 32 bits, given as a signed or unsigned number.
const bits = (value, name) => whole(value > 0x7fffffff && value <= 0xffffffff ? value - 2 ** 32 : value, name);

// Requires an object of this world, because the number or handle of an object does not identify its world.
function ownOf(world, thing, Kind, name, way) {
  if (thing instanceof Kind && thing.world === world) return thing;
  const what = thing instanceof Kind ? "of another world" : shown(thing);
  throw new SoftError(-1, `${name} is ${what}: give ${way}`);
}

const poseOf = ({ position, rotation = UPRIGHT }) => [...vector(position, "position"), ...vector(rotation, "rotation", 4)];

// The memory and the functions of the module.
class Native {
  constructor(module) {
    const refuse = (code, text) => {
      throw new SoftError(code, this.text(text));
    };
    const listeners = new Map();
    const nothing = () => 8; // WASI's error for a bad file: the library writes no files
    const imports = {
      taichi_soft: { fail: refuse, before_step: (world) => listeners.get(world)?.() },
      wasi_snapshot_preview1: new Proxy({}, { get: () => nothing }),
    };
    this.exports = new WebAssembly.Instance(module, imports).exports;
    this.exports._initialize();
    this.listeners = listeners;
    this.small = this.allocate(1024); // memory for arguments and results of one call
  }

  get view() {
    if (this.kept?.buffer !== this.exports.memory.buffer) this.kept = new DataView(this.exports.memory.buffer);
    return this.kept;
  }

  allocate(size) {
    const at = this.exports.malloc(Math.max(size, 8));
    if (at === 0) throw new SoftError(-9, `not enough memory for ${size} bytes`);
    return at;
  }

  // Calls a function. If the call throws an exception, the stack of the module is restored.
  call(name, ...args) {
    if (!(name in this.exports)) {
      throw new SoftError(-5, `the world has no ${name}, because it is from another version of this package: export it again`);
    }
    const stack = this.exports.__stack_pointer.value;
    try {
      this.exports[name](...args);
    } catch (error) {
      this.exports.__stack_pointer.value = stack;
      if (!(error instanceof WebAssembly.RuntimeError)) throw error;
      throw new SoftError(-9, `${name} failed, because of memory or a fault: ${error.message}`);
    }
  }

  text(at) {
    const bytes = new Uint8Array(this.exports.memory.buffer);
    let end = at;
    while (bytes[end] !== 0) end += 1;
    return new TextDecoder().decode(bytes.slice(at, end));
  }

  doubles(at, numbers) {
    numbers.forEach((number, i) => this.view.setFloat64(at + 8 * i, number, true));
    return at;
  }

  read(at, count) {
    return Array.from({ length: count }, (_, i) => this.view.getFloat64(at + 8 * i, true));
  }

  int(at) {
    return this.view.getInt32(at, true);
  }

  handle(at) {
    return this.view.getBigUint64(at, true);
  }

  // Calls a function with a temporary copy of bytes.
  lending(bytes, use) {
    const given = bytesIn(bytes, "bytes");
    const at = this.allocate(given.length);
    try {
      new Uint8Array(this.exports.memory.buffer).set(given, at);
      return use(at, given.length);
    } finally {
      this.exports.free(at);
    }
  }

  lendingText(text, use) {
    return this.lending(new TextEncoder().encode(`${text}\0`), use);
  }

  // Calls a function with a list of vertices; null means all vertices.
  lendingVertices(vertices, use) {
    if (vertices === null) return use(0, 0);
    const numbers = Array.from(vertices);
    if (numbers.length === 0) throw new SoftError(-1, "the list of vertices is empty: give null for all");
    for (const each of numbers) whole(each, "a vertex");
    return this.lending(Int32Array.from(numbers), (at) => use(at, numbers.length));
  }
}

// Numbers in the memory of the module. The memory is reallocated when it grows.
class Block {
  constructor(native, Kind, count) {
    this.native = native;
    this.Kind = Kind;
    this.count = count;
    this.at = native.allocate(count * Kind.BYTES_PER_ELEMENT);
  }

  get view() {
    const { buffer } = this.native.exports.memory;
    if (this.kept?.buffer !== buffer) this.kept = new this.Kind(buffer, this.at, this.count);
    return this.kept;
  }

  free() {
    this.native.exports.free(this.at);
  }
}

/** A world file, read by `loadScene`. All worlds of a scene share the compiled code. */
export class Scene {
  constructor(module, bytes) {
    this.native = new Native(module);
    const { small } = this.native;
    this.native.lending(bytes, (at, size) => this.native.call("ts_web_load", at, size, small));
    this.handle = this.native.handle(small);
    this.native.view.setUint32(small, 24, true);
    this.native.call("ts_scene_get_info", this.handle, small);
    const [slots, assets, colliders, frames, meshes] = [4, 8, 12, 16, 20].map((at) => this.native.int(small + at));
    // Read all names now, because worlds can outlive the scene.
    this.names = Object.fromEntries(Object.keys(KINDS).map((kind) => [kind, this.#names(kind)]));
    const [joints, motors] = [this.names.joint.length, this.names.motor.length];
    this.counts = { body: slots, asset: assets, collider: colliders, frame: frames, mesh: meshes, joint: joints, motor: motors };
    this.assets = this.names.asset.map((_, i) => this.#asset(i));
    this.meshes = this.names.mesh.map((_, i) => this.#mesh(i));
  }

  #names(kind) {
    const { native } = this;
    const found = [];
    for (;;) {
      try {
        native.call("ts_scene_get_name", this.handle, KINDS[kind], found.length, native.small, 1024);
      } catch {
        return found; // no more names
      }
      found.push(native.text(native.small));
    }
  }

  #asset(number) {
    const { native } = this;
    const { small } = native;
    native.view.setUint32(small, 16, true);
    native.call("ts_asset_get_info", this.handle, number, small);
    const [vertexCount, slotCount] = [4, 8].map((at) => native.int(small + at));
    const mass = native.view.getFloat32(small + 12, true);
    native.call("ts_asset_get_level_count", this.handle, number, small);
    return { number, vertexCount, slotCount, mass, levelCount: native.int(small) };
  }

  #mesh(number) {
    const { native } = this;
    native.view.setUint32(native.small, 20, true);
    native.call("ts_mesh_get_info", this.handle, number, native.small);
    const [asset, vertexCount, triangleCount, hasUv] = [4, 8, 12, 16].map((at) => native.int(native.small + at));
    const triangles = new Block(native, Uint32Array, 3 * triangleCount);
    native.call("ts_mesh_get_triangles", this.handle, number, triangles.at, triangles.count);
    const uv = hasUv ? new Block(native, Float32Array, 2 * vertexCount) : null;
    if (uv) native.call("ts_mesh_get_uv", this.handle, number, uv.at, uv.count);
    native.call("ts_mesh_get_level", this.handle, number, native.small);
    const level = native.int(native.small);
    return { number, asset, level: level < 0 ? null : level, vertexCount, triangles, uv };
  }

  /** Return the name of a "body", "asset", "collider", "frame", "mesh", "joint" or "motor" with a number. */
  nameOf(kind, number) {
    const found = this.#namesOf(kind)[number];
    if (found === undefined) throw new SoftError(-1, `${kind} ${number} does not exist (${this.names[kind].length} in all, numbered from 0)`);
    return found;
  }

  /** Return the number of the object with a name. */
  find(kind, name) {
    const names = this.#namesOf(kind);
    if (typeof name === "number") return whole(name, kind);
    const number = names.indexOf(name);
    if (number >= 0) return number;
    throw new SoftError(-1, `unknown ${kind} ${name}: give a number, or one of these names: ${names.join(", ") || "none"}`);
  }

  #namesOf(kind) {
    if (Object.hasOwn(KINDS, kind)) return this.names[kind];
    throw new SoftError(-1, `kind is ${kind}: give one of ${Object.keys(KINDS).join(", ")}`);
  }

  /** Return `vertexCount`, `slotCount`, `mass` [kg] and `levelCount` of an asset. */
  asset(name) {
    const found = this.assets[this.find("asset", name)];
    if (!found) throw new SoftError(-1, `asset ${name} does not exist (${this.assets.length} in all, numbered from 0)`);
    return found;
  }

  /** Create a world in the exported state. */
  createWorld() {
    return new World(this);
  }

  /** Release the scene. Its memory is freed when the last of its worlds is destroyed. */
  unload() {
    this.native.call("ts_scene_unload", this.handle);
  }
}

/** A running instance of a scene. */
export class World {
  #listener = null;
  #restoreCount = 0;
  #isAdvancing = false;
  #meshes = new Set();

  constructor(scene) {
    this.scene = scene;
    this.native = scene.native;
    this.native.call("ts_world_create", scene.handle, this.native.small);
    this.handle = this.native.handle(this.native.small);
    this.native.call("ts_web_listen", this.handle);
  }

  #call(name, ...args) {
    this.native.call(name, this.handle, ...args);
  }

  destroy() {
    this.#call("ts_world_destroy");
    this.native.listeners.delete(this.handle);
    for (const mesh of [...this.#meshes]) mesh.free();
  }

  /** Make one step of `dt` [s]. With 0 substeps, a stable number is chosen. */
  step(dt = 1 / 60, substeps = 0) {
    this.#call("ts_world_step", dt, whole(substeps, "substeps"));
  }

  /** Set the steps that `advance` makes. Time beyond `maxSteps` steps per frame is dropped. */
  setFixedStep({ dt = 1 / 60, substeps = 0, maxSteps = 8 } = {}) {
    const { view, small } = this.native;
    view.setUint32(small, 24, true);
    view.setInt32(small + 4, whole(substeps, "substeps"), true);
    view.setInt32(small + 8, whole(maxSteps, "maxSteps"), true);
    view.setFloat64(small + 16, dt, true);
    this.#call("ts_world_set_fixed_step", small);
  }

  /** Add the time of a frame [s] and make the steps that are due. Returns the `clock`. */
  advance(seconds) {
    if (this.#isAdvancing) throw new SoftError(-7, "world.advance was called from its own onStep");
    const { small } = this.native;
    this.native.view.setUint32(small, 40, true);
    this.#isAdvancing = true;
    try {
      this.#call("ts_world_advance", seconds, small);
    } catch (error) {
      this.#endFrame();
      throw error;
    } finally {
      this.#isAdvancing = false;
    }
    return this.#clock();
  }

  #endFrame() {
    try {
      this.#call("ts_web_end_frame");
    } catch {
      // onStep has destroyed the world, so there is no frame to end
    }
  }

  /** Clock: `stepsMade` by the last `advance`, total `steps`, `time` [s], `alpha`, total `dropped` time [s]. */
  get clock() {
    this.native.view.setUint32(this.native.small, 40, true);
    this.#call("ts_world_get_clock", this.native.small);
    return this.#clock();
  }

  #clock() {
    const { view, small } = this.native;
    const [time, alpha, dropped] = this.native.read(small + 16, 3);
    return { stepsMade: view.getInt32(small + 4, true), steps: Number(view.getBigInt64(small + 8, true)), time, alpha, dropped };
  }

  /** Function that `advance` calls before each step. Move colliders and frames and apply forces in it. */
  set onStep(listener) {
    this.#listener = listener;
    if (listener) this.native.listeners.set(this.handle, listener);
    else this.native.listeners.delete(this.handle);
  }

  get onStep() {
    return this.#listener;
  }

  stableSubsteps(dt) {
    this.#call("ts_world_stable_substeps", dt, this.native.small);
    return this.native.int(this.native.small);
  }

  wake() {
    this.#call("ts_world_wake");
  }

  /** Set gravity [m/s^2] from the next step on, and wake all bodies. */
  setGravity(gravity) {
    this.#call("ts_world_set_gravity", this.native.doubles(this.native.small, vector(gravity, "gravity")));
  }

  /** Set the Coulomb coefficient of the floor from the next step on. */
  setFriction(friction) {
    this.#call("ts_world_set_friction", friction);
  }

  /** Set the wind velocity [m/s] and the air density [kg/m^3]. */
  setWind(velocity, { density = 1.2, drag = 1 } = {}) {
    this.#call("ts_world_set_wind", this.native.doubles(this.native.small, vector(velocity, "velocity")), density, drag);
  }

  radialImpulse(center, impulse, radius) {
    this.#call("ts_world_radial_impulse", this.native.doubles(this.native.small, vector(center, "center")), impulse, radius);
  }

  /** Return a hash of the state, 16 hexadecimal digits, equal on every platform. */
  hash() {
    this.#call("ts_world_hash", this.native.small);
    return this.native.handle(this.native.small).toString(16).padStart(16, "0");
  }

  /** Return a copy of the state between two steps. */
  snapshot() {
    const { native } = this;
    this.#call("ts_world_snapshot", 0, 0, native.small);
    const size = native.view.getUint32(native.small, true);
    const at = native.allocate(size);
    try {
      this.#call("ts_world_snapshot", at, size, native.small);
      return new Uint8Array(native.exports.memory.buffer).slice(at, at + size);
    } finally {
      native.exports.free(at);
    }
  }

  restore(bytes) {
    this.native.lending(bytes, (at, size) => this.#call("ts_world_restore", at, size));
    this.#restoreCount += 1;
  }

  /** Number of `restore` calls. If this number has changed, states stored before belong to another history. */
  get restoreCount() {
    return this.#restoreCount;
  }

  /** Record events of these kinds, a sum of `EVENTS`. By default, all kinds are recorded; with 0, no kind. */
  recordEvents(kinds = 127) {
    this.#call("ts_world_record_events", whole(kinds, "kinds", "a sum of EVENTS"));
  }

  /** Return the events since the last call. */
  events() {
    const { native } = this;
    const [size, most, found] = [72, 64, []];
    const at = native.allocate(size * most);
    try {
      for (let count = most; count === most; ) {
        this.#call("ts_world_drain_events", at, size, most, native.small);
        count = native.view.getUint32(native.small, true);
        for (let i = 0; i < count; i += 1) found.push(this.#event(at + size * i));
      }
      return found;
    } finally {
      native.exports.free(at);
    }
  }

  #event(at) {
    const { native } = this;
    const [impulse, other] = [native.read(at + 40, 3), native.handle(at + 32)];
    return {
      kind: EVENT_NAMES[native.int(at)],
      collider: native.int(at + 4),
      step: Number(native.view.getBigInt64(at + 8, true)),
      time: native.view.getFloat64(at + 16, true),
      body: new Body(this, native.handle(at + 24)),
      other: other === 0n ? null : new Body(this, other),
      impulse,
      duration: native.view.getFloat64(at + 64, true),
    };
  }

  get droppedEvents() {
    this.#call("ts_world_dropped_events", this.native.small);
    return Number(this.native.view.getBigInt64(this.native.small, true));
  }

  /** Return the body in a slot with a number or name; null if the slot is empty. */
  body(name) {
    const slot = this.scene.find("body", name);
    this.#call("ts_world_get_body", slot, this.native.small);
    const handle = this.native.handle(this.native.small);
    return handle === 0n ? null : new Body(this, handle);
  }

  /** All bodies, in the order of their slots. */
  get bodies() {
    return Array.from({ length: this.scene.counts.body }, (_, slot) => this.body(slot)).filter(Boolean);
  }

  spawn(asset, { velocity = [0, 0, 0], spin = [0, 0, 0], ...pose } = {}) {
    const number = this.scene.find("asset", asset);
    const { native } = this;
    native.view.setUint32(native.small, 112, true);
    native.view.setInt32(native.small + 4, 0, true);
    const motion = [...vector(velocity, "velocity"), ...vector(spin, "spin")];
    native.doubles(native.small + 8, [...poseOf({ position: ORIGIN, ...pose }), ...motion]);
    this.#call("ts_world_spawn", number, native.small, native.small + 128);
    return new Body(this, native.handle(native.small + 128));
  }

  /** Find the first surface that a ray hits; null if there is none. */
  raycast(origin, direction, reach = Infinity) {
    const { native } = this;
    native.view.setUint32(native.small, 112, true);
    const at = native.doubles(native.small + 128, [...vector(origin, "origin"), ...vector(direction, "direction")]);
    this.#call("ts_world_raycast", at, at + 24, reach, native.small);
    return this.#hit();
  }

  /** Find the point of all surfaces that is closest to a point; null if none is in range. */
  closest(point, reach = Infinity) {
    const { native } = this;
    native.view.setUint32(native.small, 112, true);
    this.#call("ts_world_closest", native.doubles(native.small + 128, vector(point, "point")), reach, native.small);
    return this.#hit();
  }

  #hit() {
    const { native } = this;
    const { small } = native;
    const handle = native.handle(small + 8);
    if (handle === 0n) return null;
    const numbers = native.read(small + 16, 10);
    return {
      body: new Body(this, handle),
      triangle: native.int(small + 4),
      distance: numbers[0],
      weights: numbers.slice(1, 4),
      point: numbers.slice(4, 7),
      normal: numbers.slice(7),
      vertices: [0, 4, 8].map((at) => native.int(small + 96 + at)),
      isInside: native.int(small + 108) === 1,
    };
  }

  overlapSphere(center, radius) {
    return this.#overlaps((bodies, capacity, count) => {
      const at = this.native.doubles(this.native.small, vector(center, "center"));
      this.#call("ts_world_overlap_sphere", at, radius, bodies, capacity, count);
    });
  }

  overlapBox(pose, size) {
    return this.#overlaps((bodies, capacity, count) => {
      const at = this.native.doubles(this.native.small, [...poseOf(pose), ...vector(size, "size")]);
      this.#call("ts_world_overlap_box", at, at + 56, bodies, capacity, count);
    });
  }

  #overlaps(ask) {
    const { native } = this;
    const capacity = this.scene.counts.body;
    const at = native.allocate(8 * capacity);
    try {
      ask(at, capacity, native.small + 256);
      const count = native.view.getUint32(native.small + 256, true);
      return Array.from({ length: count }, (_, i) => new Body(this, native.handle(at + 8 * i)));
    } finally {
      native.exports.free(at);
    }
  }

  collider(name) {
    return new Collider(this, this.scene.find("collider", name));
  }

  /** Add a plane, sphere, box or capsule. The world must have free `collider_room`. */
  addCollider(shape, pose = {}) {
    return this.#addShape("ts_collider_add", shape, pose);
  }

  /** Add a collider that bodies do not touch, and that reports the bodies in it by the events entered and left. */
  addSensor(shape, pose = {}) {
    return this.#addShape("ts_sensor_add", shape, pose);
  }

  /** Find the bodies that touch or enclose a sensor. */
  bodiesInside(sensor) {
    return this.#overlaps((bodies, capacity, count) => {
      this.#call("ts_sensor_get_bodies", sensor.number, bodies, capacity, count);
    });
  }

  #addShape(
    name,
    { kind, size = ORIGIN, friction = 0.5, restitution = -1, thickness = 0, group = 1, mask = -1 },
    pose,
  ) {
    if (!SHAPES.includes(kind)) throw new SoftError(-1, `kind is ${kind}: give one of ${SHAPES.join(", ")}`);
    const { native } = this;
    const { view, small } = native;
    view.setUint32(small, 64, true);
    view.setInt32(small + 4, SHAPES.indexOf(kind), true);
    native.doubles(small + 8, [...vector(size, "size"), friction, restitution, thickness]);
    view.setInt32(small + 56, bits(group, "group"), true);
    view.setInt32(small + 60, bits(mask, "mask"), true);
    native.doubles(small + 64, poseOf({ position: ORIGIN, ...pose }));
    this.#call(name, small, small + 64, small + 128);
    return new Collider(this, native.int(small + 128));
  }

  frame(name) {
    return new Frame(this, this.scene.find("frame", name));
  }

  addFrame(pose = {}) {
    const { native } = this;
    this.#call("ts_frame_add", native.doubles(native.small, poseOf({ position: ORIGIN, ...pose })), native.small + 64);
    return new Frame(this, native.int(native.small + 64));
  }

  /** Return the grab with an index, 0 to 15; null if there is none. */
  grab(number) {
    this.#call("ts_world_get_grab", whole(number, "number"), this.native.small);
    const handle = this.native.handle(this.native.small);
    return handle === 0n ? null : new Grab(this, handle);
  }

  /** Return the joint with a name or an index, 0 to 63; null if there is none. */
  joint(name) {
    this.#call("ts_world_get_joint", this.scene.find("joint", name), this.native.small);
    const handle = this.native.handle(this.native.small);
    return handle === 0n ? null : new Joint(this, handle);
  }

  /** Return the motor with a name or an index, 0 to 63; null if there is none. */
  motor(name) {
    this.#call("ts_world_get_motor", this.scene.find("motor", name), this.native.small);
    const handle = this.native.handle(this.native.small);
    return handle === 0n ? null : new Motor(this, handle);
  }

  keep(mesh) {
    this.#meshes.add(mesh);
    return mesh;
  }

  forget(mesh) {
    this.#meshes.delete(mesh);
  }
}

/** A body in a world. */
export class Body {
  constructor(world, handle) {
    this.world = world;
    this.handle = handle;
  }

  #call(name, ...args) {
    this.world.native.call(name, this.world.handle, this.handle, ...args);
  }

  get #small() {
    return this.world.native.small;
  }

  despawn() {
    this.#call("ts_world_despawn");
  }

  get asset() {
    this.#call("ts_body_get_asset", this.#small);
    return this.world.native.int(this.#small);
  }

  /** State of the body: "active", "frozen", "asleep" or "disabled". */
  get status() {
    this.#call("ts_body_get_status", this.#small);
    return STATUS[this.world.native.int(this.#small)];
  }

  /** Level of detail; 0 is the finest. */
  get level() {
    this.#call("ts_body_get_level", this.#small);
    return this.world.native.int(this.#small);
  }

  /**
   * Change the level of detail. If joints, motors or attachments cannot be kept at the new level, they are released if
   * `release` is true; otherwise the call fails.
   */
  setLevel(level, { release = false } = {}) {
    this.#call("ts_body_set_level", whole(level, "level"), Number(release));
  }

  /** Number of vertices at the current level. */
  get vertexCount() {
    this.#call("ts_body_get_vertex_count", this.#small);
    return this.world.native.int(this.#small);
  }

  /** Return the vertex positions [m], interpolated between before (alpha 0) and after (alpha 1) the last step. */
  positions(alpha = 1) {
    const block = new Block(this.world.native, Float32Array, 3 * this.vertexCount);
    try {
      this.#call("ts_body_positions", alpha, block.at, block.count);
      return block.view.slice();
    } finally {
      block.free();
    }
  }

  /** Return the mesh with a number or name, or the first mesh of the body's asset and level. Call this only once. */
  mesh(name = null) {
    const { asset, level } = this;
    const { scene } = this.world;
    const isIts = (each) => each.asset === asset && (each.level === null || each.level === level);
    const found = name === null ? scene.meshes.find(isIts) : scene.meshes[scene.find("mesh", name)];
    if (!found) throw new SoftError(-1, `asset ${asset} has no mesh`);
    return this.world.keep(new Mesh(this, found));
  }

  get center() {
    this.#call("ts_body_center", this.#small);
    return this.world.native.read(this.#small, 3);
  }

  setVelocity(linear, spin = [0, 0, 0]) {
    const at = this.world.native.doubles(this.#small, [...vector(linear, "linear"), ...vector(spin, "spin")]);
    this.#call("ts_body_set_velocity", at, at + 24);
  }

  teleport(center, { turn = UPRIGHT, keepsVelocity = false } = {}) {
    const at = this.world.native.doubles(this.#small, [...vector(center, "center"), ...vector(turn, "turn", 4)]);
    this.#call("ts_body_teleport", at, at + 24, Number(keepsVelocity));
  }

  /** Apply an impulse [N s] to vertices, or to the whole body. */
  applyImpulse(impulse, vertices = null) {
    const at = this.world.native.doubles(this.#small, vector(impulse, "impulse"));
    this.world.native.lendingVertices(vertices, (list, count) => this.#call("ts_body_apply_impulse", at, list, count));
  }

  /** Apply a force [N] during the next step, to vertices or to the whole body. */
  applyForce(force, vertices = null) {
    const at = this.world.native.doubles(this.#small, vector(force, "force"));
    this.world.native.lendingVertices(vertices, (list, count) => this.#call("ts_body_apply_force", at, list, count));
  }

  impulseAt(impulse, point, radius) {
    const at = this.world.native.doubles(this.#small, [...vector(impulse, "impulse"), ...vector(point, "point")]);
    this.#call("ts_body_impulse_at", at, at + 24, radius);
  }

  setGravityScale(scale) {
    this.#call("ts_body_set_gravity_scale", scale);
  }

  /** Set the Coulomb coefficient for contact with other bodies. The world must have soft contact. */
  setFriction(friction) {
    this.#call("ts_body_set_friction", friction);
  }

  /** Set group and mask, as bits, from the next step on. */
  setFilter(group, mask) {
    this.#call("ts_body_set_filter", bits(group, "group"), bits(mask, "mask"));
  }

  setDamping(rate) {
    this.#call("ts_body_set_damping", rate);
  }

  /** Switch the body off or on. A body that is off keeps its shape and velocity, and costs no time. Hide its mesh. */
  setEnabled(isEnabled) {
    this.#call("ts_body_set_enabled", Number(isEnabled));
  }

  setSheltered(isSheltered) {
    this.#call("ts_body_set_sheltered", Number(isSheltered));
  }

  pin(vertices) {
    this.world.native.lendingVertices(vertices, (list, count) => this.#call("ts_body_pin", list, count));
  }

  unpin(vertices = null) {
    this.world.native.lendingVertices(vertices, (list, count) => this.#call("ts_body_unpin", list, count));
  }

  /** Set the positions of pinned vertices after the next step [m], 3 numbers each. */
  setTargets(vertices, targets) {
    const { native } = this.world;
    if (targets.length !== 3 * vertices.length) throw new SoftError(-6, `targets has ${targets.length} numbers: give ${3 * vertices.length}`);
    native.lending(Float32Array.from(targets), (places) =>
      native.lendingVertices(vertices, (list, count) => this.#call("ts_body_set_targets", list, count, places)),
    );
  }

  attach(vertices, frame, { feels = false } = {}) {
    const { number } = this.#frame(frame);
    this.world.native.lendingVertices(vertices, (list, count) =>
      this.#call("ts_body_attach", list, count, number, Number(feels)),
    );
  }

  #frame(frame) {
    return ownOf(this.world, frame, Frame, "frame", "one of world.frame(name) or world.addFrame(pose)");
  }

  detach(vertices = null) {
    this.world.native.lendingVertices(vertices, (list, count) => this.#call("ts_body_detach", list, count));
  }

  /** Return `force` [N] and `torque` [N m] that the body exerts on a frame. */
  load(frame) {
    this.#call("ts_body_get_load", this.#frame(frame).number, this.#small, this.#small + 24);
    return { force: this.world.native.read(this.#small, 3), torque: this.world.native.read(this.#small + 24, 3) };
  }

  /** Attach vertices to the body `other`, at their current positions or, with `onto`, each to a vertex in `onto`. */
  join(vertices, other, { onto = null } = {}) {
    const { native } = this.world;
    ownOf(this.world, other, Body, "other", "a body, such as world.body(name)");
    if (onto && onto.length !== vertices.length) throw new SoftError(-6, "onto must have as many vertices as vertices");
    native.lendingVertices(vertices, (list, count) =>
      native.lendingVertices(onto, (partners) =>
        this.#call("ts_body_join", list, count, other.handle, onto ? partners : 0, this.#small),
      ),
    );
    return new Joint(this.world, native.handle(this.#small));
  }

  /**
   * Add a motor. With `maxTorque` [N m], the motor rotates vertices about an axis towards a speed [rad/s]. With
   * `maxForce` [N], the motor pushes vertices along the axis towards a speed [m/s]. The axis rotates with the vertices,
   * or is fixed in space, optionally through a point.
   */
  addMotor(vertices, { axis, speed = 0, maxTorque = null, maxForce = null, isFixed = false, point = null }) {
    const { native } = this.world;
    if ((maxTorque === null) === (maxForce === null)) throw new SoftError(-1, "give one of maxTorque and maxForce");
    native.lendingVertices(vertices, (list, count) => {
      const { view } = native;
      view.setUint32(this.#small, 80, true);
      [maxTorque !== null, isFixed, point !== null].forEach((is, i) => view.setInt32(this.#small + 4 + 4 * i, Number(is), true));
      native.doubles(this.#small + 16, [...vector(axis, "axis"), ...vector(point ?? ORIGIN, "point"), speed, maxTorque ?? maxForce]);
      this.#call("ts_body_add_motor", list, count, this.#small, this.#small + 128);
    });
    return new Motor(this.world, native.handle(this.#small + 128));
  }

  /** Grab the body with a spring at the hit of a ray. */
  grab({ triangle, weights, point }, { frequency = 5, maxForce = -1, target = point } = {}) {
    const { native } = this.world;
    native.view.setUint32(this.#small, 72, true);
    native.view.setInt32(this.#small + 4, whole(triangle, "triangle"), true);
    native.doubles(this.#small + 8, [...vector(weights, "weights"), ...vector(target, "target"), frequency, maxForce]);
    this.#call("ts_body_grab", this.#small, this.#small + 128);
    return new Grab(this.world, native.handle(this.#small + 128));
  }
}

/** A render mesh. `positions` and `normals` are views of the module's memory. Read them again after each `update`. */
export class Mesh {
  #blocks;

  constructor(body, { number, vertexCount, triangles, uv }) {
    const { native } = body.world;
    this.body = body;
    this.number = number;
    this.vertexCount = vertexCount;
    this.#blocks = { triangles, uv };
    for (const name of ["positions", "normals"]) this.#blocks[name] = new Block(native, Float32Array, 3 * vertexCount);
    this.update();
  }

  get positions() {
    return this.#there.positions.view;
  }

  get normals() {
    return this.#there.normals.view;
  }

  /** Vertex indices, three per triangle. */
  get triangles() {
    return this.#there.triangles.view;
  }

  /** Texture coordinates, two numbers per vertex; v points up. Null if there are none. */
  get uv() {
    return this.#there.uv?.view ?? null;
  }

  update() {
    const { world, handle } = this.body;
    const { positions, normals } = this.#there;
    world.native.call("ts_body_mesh", world.handle, handle, this.number, positions.at, normals.at, positions.count);
  }

  get #there() {
    if (this.#blocks) return this.#blocks;
    throw new SoftError(-2, "this mesh was freed, or its world was destroyed");
  }

  /** Free the memory of the mesh. `World.destroy` does this for all meshes. */
  free() {
    this.#blocks?.positions.free();
    this.#blocks?.normals.free();
    this.#blocks = null;
    this.body.world.forget(this);
  }
}

/** A grab: a spring that holds a body. */
export class Grab {
  constructor(world, handle) {
    this.world = world;
    this.handle = handle;
  }

  moveTo(point) {
    const { native } = this.world;
    native.call("ts_grab_move", this.world.handle, this.handle, native.doubles(native.small, vector(point, "point")));
  }

  release() {
    this.world.native.call("ts_grab_release", this.world.handle, this.handle);
  }

  /** Force of the spring [N]. */
  get force() {
    const { native } = this.world;
    native.call("ts_grab_get_force", this.world.handle, this.handle, native.small);
    return native.read(native.small, 3);
  }
}

// An object with a handle and an index.
class Numbered {
  constructor(world, handle) {
    this.world = world;
    this.handle = handle;
    this.number = Number(handle & 0xffffffffn) - 1;
  }

  call(name, ...args) {
    this.world.native.call(name, this.world.handle, this.handle, ...args);
  }

  readNumbers(name, count) {
    this.call(name, this.world.native.small);
    return this.world.native.read(this.world.native.small, count);
  }
}

/** A connection between parts of two bodies. */
export class Joint extends Numbered {
  /** Force that the other body exerts [N], averaged over the last step. */
  get force() {
    return this.readNumbers("ts_joint_get_force", 3);
  }

  release() {
    this.call("ts_joint_release");
  }
}

/** A motor that rotates or pushes a part of a body. */
export class Motor extends Numbered {
  /** Speed of the driven vertices [rad/s] or [m/s]. */
  get measuredSpeed() {
    return this.readNumbers("ts_motor_get_speed", 1)[0];
  }

  /** Torque [N m] or force [N] of the motor, averaged over the last step. */
  get effort() {
    return this.readNumbers("ts_motor_get_effort", 1)[0];
  }

  setSpeed(speed) {
    this.call("ts_motor_set_speed", speed);
  }

  /** Set the largest torque [N m] or force [N]. With 0 the vertices coast. */
  setLimit(limit) {
    this.call("ts_motor_set_limit", limit);
  }

  remove() {
    this.call("ts_motor_remove");
  }
}

// An object with a number and a pose.
class Placed {
  constructor(world, number, prefix) {
    this.world = world;
    this.number = number;
    this.prefix = prefix;
  }

  call(name, ...args) {
    this.world.native.call(`${this.prefix}_${name}`, this.world.handle, this.number, ...args);
  }

  /** Move the object to a pose over the next step. */
  moveTo(pose) {
    this.call("move_to", this.world.native.doubles(this.world.native.small, poseOf(pose)));
  }

  get pose() {
    const { native } = this.world;
    this.call("get_pose", native.small);
    return { position: native.read(native.small, 3), rotation: native.read(native.small + 24, 4) };
  }

  remove() {
    this.call("remove");
  }
}

/** A rigid shape that bodies cannot move. */
export class Collider extends Placed {
  constructor(world, number) {
    super(world, number, "ts_collider");
  }

  setVelocity(linear, spin = [0, 0, 0]) {
    const at = this.world.native.doubles(this.world.native.small, [...vector(linear, "linear"), ...vector(spin, "spin")]);
    this.call("set_velocity", at, at + 24);
  }

  /** Set the Coulomb friction coefficient from the next step on. */
  setFriction(friction) {
    this.call("set_friction", friction);
  }

  /** Set group and mask, as bits, from the next step on. */
  setFilter(group, mask) {
    this.call("set_filter", bits(group, "group"), bits(mask, "mask"));
  }

  /** Move the surface like a conveyor belt. `velocity` is relative to the collider, in its axes; zero stops the surface. */
  setSurfaceVelocity(velocity) {
    this.call("set_surface_velocity", this.world.native.doubles(this.world.native.small, vector(velocity, "velocity")));
  }

  teleport(pose) {
    this.call("teleport", this.world.native.doubles(this.world.native.small, poseOf(pose)));
  }

  /** `impulse` [N s] of all bodies on the collider in the last step, and its `moment` about the collider's position. */
  get impulse() {
    const { native } = this.world;
    this.call("get_impulse", native.small, native.small + 24);
    return { impulse: native.read(native.small, 3), moment: native.read(native.small + 24, 3) };
  }
}

/** A pose that the game moves, together with attached bodies. */
export class Frame extends Placed {
  constructor(world, number) {
    super(world, number, "ts_frame");
  }
}

async function bytesOf(address) {
  let answer;
  try {
    answer = await fetch(address);
  } catch (error) {
    const way = globalThis.document
      ? "A page from a file cannot read files: serve the folder, for example with python -m http.server"
      : "Only URLs can be loaded: pass the bytes of files to sceneOf";
    throw new SoftError(-4, `cannot read ${address}: ${error.message}. ${way}`);
  }
  if (!answer.ok) {
    const way = "is it a folder from taichi-soft export --for web?";
    throw new SoftError(-4, `cannot read ${address}: ${answer.status} ${answer.statusText}; ${way}`);
  }
  return new Uint8Array(await answer.arrayBuffer());
}

const CRC = Uint32Array.from({ length: 256 }, (_, code) => {
  for (let k = 0; k < 8; k += 1) code = code & 1 ? (code >>> 1) ^ 0xedb88320 : code >>> 1;
  return code;
});

function checksum(bytes) {
  let code = -1;
  for (let i = 0; i < bytes.length; i += 1) code = CRC[(code ^ bytes[i]) & 255] ^ (code >>> 8);
  return ~code >>> 0;
}

// Finds an entry of a world file: the offset of its bytes and the count of its numbers. See archive.cpp.
function entryOf(view, wanted) {
  const filled = (size) => Math.ceil(size / 8) * 8;
  const decoder = new TextDecoder();
  const widths = [0, 1, 4, 8, 4, 8]; // size of a number by type [bytes]
  let at = 32;
  for (let left = view.getUint32(12, true); left > 0; left -= 1) {
    const [length, type, dimensions] = [0, 4, 8].map((each) => view.getUint32(at + each, true));
    at += 16;
    let count = 1;
    for (let k = 0; k < dimensions; k += 1, at += 8) count *= Number(view.getBigUint64(at, true));
    const name = new Uint8Array(view.buffer, view.byteOffset + at, length);
    at += filled(length);
    if (length === wanted.length && decoder.decode(name) === wanted) return { at, count };
    at += filled(count * widths[type]);
  }
  throw new RangeError(`no ${wanted}`);
}

// True if a module has the size and checksum that the world file contains. For an invalid world file, the result is
// also true, because the library then refuses the file with a reason.
function isOf(world, code) {
  try {
    const view = new DataView(world.buffer, world.byteOffset, world.byteLength);
    const [files, sums] = ["kernels/files", "kernels/sums"].map((name) => entryOf(view, name));
    const names = new TextDecoder().decode(new Uint8Array(view.buffer, view.byteOffset + files.at, files.count)).split("\0");
    const at = sums.at + 16 * names.indexOf("web.wasm");
    const [size, sum] = [at, at + 8].map((each) => Number(view.getBigInt64(each, true)));
    return size === code.byteLength && sum === checksum(code);
  } catch {
    return true;
  }
}

/** Compiles a world's kernels and reads its world file, from the bytes of `kernels/web.wasm` and of `world.tsw`. */
export async function sceneOf(code, world) {
  if (typeof WebAssembly === "undefined") throw new SoftError(-9, "this browser has no WebAssembly");
  const [module, file] = [bytesIn(code, "code"), bytesIn(world, "world")];
  if (module.subarray(0, 4).join() !== "0,97,115,109") {
    throw new SoftError(-4, "the code is not a WebAssembly module: is the folder from taichi-soft export --for web?");
  }
  const compiling = WebAssembly.compile(module); // runs on another thread
  compiling.catch(() => {}); // a refused module is never awaited, so its errors are ignored
  if (!isOf(file, module)) {
    throw new SoftError(-4, "the kernels belong to another export, or are damaged: export the world again, and ship both");
  }
  let compiled;
  try {
    compiled = await compiling;
  } catch (error) {
    throw new SoftError(-9, `this browser cannot compile the world, which needs SIMD: ${error.message}`);
  }
  return new Scene(compiled, file);
}

/** Loads a folder that `taichi-soft export --for web` wrote. */
export async function loadScene(folder) {
  const base = String(folder).replace(/\/$/, "");
  const [code, world] = await Promise.all([bytesOf(`${base}/kernels/web.wasm`), bytesOf(`${base}/world.tsw`)]);
  return sceneOf(code, world);
}

/** Loads a folder that `taichi-soft export --for web` wrote, and creates a world. */
export async function loadWorld(folder) {
  return (await loadScene(folder)).createWorld();
}

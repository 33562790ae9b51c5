// A world with a record of the visitor's actions, which `taichi-soft replay` repeats on a PC.

const MOST_STEPS = 36_000; // length of the record: ten minutes

const PLAIN = { gravity: 1, damping: 0 }; // values of a new body

const slotOf = (body) => Number(body.handle & 0xffffffffn) - 1;
const plus = (a, b, scale = 1) => a.map((each, i) => each + scale * b[i]);

/** The product of two quaternions [x, y, z, w]: first b, then a. */
function turned([ax, ay, az, aw], [bx, by, bz, bw]) {
  return [
    aw * bx + ax * bw + ay * bz - az * by,
    aw * by - ax * bz + ay * bw + az * bx,
    aw * bz + ax * by - ay * bx + az * bw,
    aw * bw - ax * bx - ay * by - az * bz,
  ];
}

function about(axis, degrees) {
  const half = (degrees * Math.PI) / 360;
  return [...axis.map((each) => each * Math.sin(half)), Math.cos(half)];
}

export class Game {
  constructor(scene, facts) {
    Object.assign(this, { scene, facts });
    this.world = scene.createWorld();
    this.first = this.world.snapshot();
    this.reset();
  }

  /** Begin again. */
  reset() {
    const { handles, controls } = this.facts;
    this.world.restore(this.first);
    this.entries = []; // in the form of a recording made by Python
    this.steps = 0;
    this.serials = [...handles.body]; // handle numbers of the bodies, by slot
    this.next = handles.next; // number of the next handle
    this.spawned = [];
    this.grabs = new Set();
    this.values = new Map(controls.map((each) => [each, each.value]));
    this.movers = this.#movers(controls.filter((each) => each.kind === "move"));
    this.hash = this.world.hash();
  }

  get isTouched() {
    return this.entries.some(([kind]) => kind === "call");
  }

  destroy() {
    this.world.destroy();
    this.scene.unload();
  }

  #note(serial, name, given = [], options = {}) {
    if (this.steps < MOST_STEPS) this.entries.push(["call", serial, name, given, { options }]);
  }

  #body(body) {
    return this.serials[slotOf(body)];
  }

  /** What sliders move: each collider or frame with its sliders, and where it was at first. */
  #movers(controls) {
    const movers = new Map();
    for (const each of controls) {
      const kind = each.collider ? "collider" : "frame";
      const key = `${kind} ${each[kind]}`;
      if (!movers.has(key)) {
        const thing = kind === "collider" ? this.world.collider(each.collider) : this.world.frame(each.frame);
        const serial = this.facts.handles[kind][thing.number];
        movers.set(key, { thing, serial, home: thing.pose.position, parts: [] });
      }
      movers.get(key).parts.push({ control: each, now: each.value });
    }
    return [...movers.values()];
  }

  /** Move what sliders ask for, no faster than it may go. */
  #move({ thing, serial, home, parts }) {
    const isThere = parts.every(({ control, now }) => now === this.values.get(control));
    if (isThere) return;
    let [position, rotation] = [home, [0, 0, 0, 1]];
    for (const part of parts) {
      const { along, about: axis, rate, value } = part.control;
      const most = rate * this.facts.dt;
      const missing = this.values.get(part.control) - part.now;
      part.now = Math.abs(missing) <= most ? this.values.get(part.control) : part.now + Math.sign(missing) * most;
      if (along) position = plus(position, along, part.now - value);
      else rotation = turned(about(axis, part.now), rotation);
    }
    thing.moveTo({ position, rotation });
    this.#note(serial, "move_to", [position, rotation]);
  }

  step() {
    for (const each of this.movers) this.#move(each);
    this.world.step(this.facts.dt);
    this.hash = this.world.hash();
    if (this.steps < MOST_STEPS) this.entries.push(["step", this.facts.dt, null, this.hash, []]);
    this.steps += 1;
  }

  /** A slider was moved. */
  set(control, value) {
    this.values.set(control, value);
    if (control.kind === "wind") this.#setWind();
    else if (control.kind !== "move") for (const body of this.world.bodies) this.#adjust(body, control);
    this.hash = this.world.hash();
  }

  #setWind() {
    let wind = [0, 0, 0];
    for (const [control, value] of this.values) if (control.kind === "wind") wind = plus(wind, control.along, value);
    this.world.setWind(wind);
    this.#note(0, "set_wind", [wind]);
  }

  #adjust(body, control) {
    const value = this.values.get(control);
    if (control.kind === "gravity") body.setGravityScale(value);
    else body.setDamping(value);
    this.#note(this.#body(body), control.kind === "gravity" ? "set_gravity_scale" : "set_linear_damping", [value]);
  }

  /** A button was pressed. */
  press(control) {
    if (control.kind === "spawn") this.#spawn(control);
    if (control.kind === "blast") {
      this.world.radialImpulse(control.at, control.impulse, control.radius);
      this.#note(0, "apply_radial_impulse", [control.at, control.impulse, control.radius]);
    }
    if (control.kind === "throw") {
      for (const body of this.world.bodies) this.#impulse(body, control.velocity.map((each) => each * this.#mass(body)));
    }
    this.hash = this.world.hash();
  }

  #mass(body) {
    return this.scene.asset(body.asset).mass;
  }

  #impulse(body, impulse) {
    body.applyImpulse(impulse);
    this.#note(this.#body(body), "apply_impulse", [impulse]);
  }

  /** Where the pool is full, the first one that was brought goes. */
  #spawn({ asset: name, at, spread }) {
    const { slotCount, number } = this.scene.asset(name);
    const there = this.world.bodies.filter((body) => body.asset === number);
    if (there.length === slotCount) this.#despawn(this.spawned.find((each) => each.asset === number) ?? there[0]);
    const random = () => spread * (2 * Math.random() - 1);
    const position = [at[0] + random(), at[1] + random() / 2, at[2]];
    const rotation = about([0, 0, 1], 360 * Math.random());
    const body = this.world.spawn(name, { position, rotation });
    this.spawned.push(body);
    this.serials[slotOf(body)] = this.next;
    this.next += 1;
    this.#note(0, "spawn", [{ part: this.facts.parts[name] }], { position, rotation });
    for (const [control, value] of this.values) {
      if (control.kind in PLAIN && value !== PLAIN[control.kind]) this.#adjust(body, control);
    }
  }

  #despawn(body) {
    this.#note(0, "despawn", [{ handle: this.#body(body) }]);
    for (const each of this.grabs) if (each.body.handle === body.handle) this.grabs.delete(each);
    body.despawn();
    this.spawned = this.spawned.filter((each) => each.handle !== body.handle);
  }

  /** Push what a ray has hit, along it, by 1.5 m/s. */
  poke(hit, direction) {
    const impulse = direction.map((each) => 1.5 * this.#mass(hit.body) * each);
    hit.body.impulseAt(impulse, hit.point, 0.25);
    this.#note(this.#body(hit.body), "apply_impulse_at_point", [impulse, hit.point, 0.25]);
    this.hash = this.world.hash();
  }

  /** Take hold of what a ray has hit. */
  grab(hit) {
    const options = { frequency: 4, maxForce: 40 * this.#mass(hit.body) * 9.81 };
    const grab = hit.body.grab(hit, options);
    const held = { grab, hit, body: hit.body, serial: this.next, point: hit.point };
    this.next += 1;
    const named = { frequency: options.frequency, max_force: options.maxForce };
    this.#note(this.#body(hit.body), "grab", [hit.triangle, hit.weights], named);
    this.grabs.add(held);
    this.pull(held, hit.point);
    return held;
  }

  pull(held, point) {
    if (!this.grabs.has(held)) return;
    held.point = point;
    held.grab.moveTo(point);
    this.#note(held.serial, "move", [point]);
    this.hash = this.world.hash();
  }

  release(held) {
    if (!this.grabs.delete(held)) return;
    held.grab.release();
    this.#note(held.serial, "release");
    this.hash = this.world.hash();
  }

  /** The hash of the state in which a recording ends. */
  get recordedHash() {
    return this.steps < MOST_STEPS ? this.hash : this.entries.at(-1)[3];
  }

  /** All that was done, and the recording that it began with, for `taichi-soft replay`. */
  recording(start) {
    let text = "";
    for (const byte of start) text += String.fromCharCode(byte);
    return JSON.stringify({ start: btoa(text), entries: this.entries });
  }
}

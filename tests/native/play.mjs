// Plays a recorded game in JavaScript, as play.c does: `play(scene, text)` returns the lines that are told.
//
//     node play.mjs FOLDER < GAME

import { EVENTS } from "../../engine_adapter/web/taichi-soft.js";

const SHAPES = ["plane", "sphere", "box", "capsule"];
const STATUS = { active: 0, frozen: 1, asleep: 2, disabled: 5 };
const MASK = (1n << 64n) - 1n;

// FNV-1a over words of 4 bytes.
function hashOf(numbers) {
  const words = new Uint32Array(Float32Array.from(numbers).buffer);
  let code = 14695981039346656037n;
  for (const word of words) code = ((code ^ BigInt(word)) * 1099511628211n) & MASK;
  return code.toString(16).padStart(16, "0");
}

const slotOf = (body) => (body === null ? -1 : Number(body.handle & 0xffffffffn) - 1);
const flat = ({ position, rotation }) => [...position, ...rotation];

export function play(scene, game) {
  const world = scene.createWorld();
  const told = [];
  const meshes = new Map();
  let numbers = [];
  let kept = null;
  const take = (count) => numbers.splice(0, count);
  const one = () => numbers.shift();
  const list = () => {
    const count = one();
    return count ? take(count) : null; // all
  };
  const body = () => world.body(one());
  const pose = () => ({ position: take(3), rotation: take(4) });
  const tell = (...words) => told.push(words.join(" "));
  const tellHit = (hit) => {
    if (!hit) tell("nothing");
    else tell(slotOf(hit.body), ...hit.vertices, hashOf([hit.distance, ...hit.weights, ...hit.point, ...hit.normal]));
  };
  const tellSlots = (bodies) => tell(...(bodies.length ? bodies.map(slotOf) : ["nothing"]));
  const meshOf = (who, number) => {
    const key = `${who.handle} ${number}`;
    if (!meshes.has(key)) meshes.set(key, who.mesh(number));
    return meshes.get(key);
  };
  const calls = {
    step() {
      world.step(one(), one());
      tell(world.hash());
    },
    impulse: () => body().applyImpulse(take(3), list()),
    force: () => body().applyForce(take(3), list()),
    impulse_at: () => body().impulseAt(take(3), take(3), one()),
    radial_impulse: () => world.radialImpulse(take(3), one(), one()),
    velocity: () => body().setVelocity(take(3), take(3)),
    teleport: () => body().teleport(take(3), { turn: take(4), keepsVelocity: one() === 1 }),
    gravity_scale: () => body().setGravityScale(one()),
    damping: () => body().setDamping(one()),
    sheltered: () => body().setSheltered(one() === 1),
    pin: () => body().pin(list()),
    unpin: () => body().unpin(list()),
    targets() {
      const [who, vertices] = [body(), list()];
      who.setTargets(vertices, take(3 * vertices.length));
    },
    set_level: () => body().setLevel(one(), { release: one() === 1 }),
    level() {
      const who = body();
      tell(who.level, who.vertexCount);
    },
    wind: () => world.setWind(take(3), { density: one(), drag: one() }),
    gravity: () => world.setGravity(take(3)),
    floor_friction: () => world.setFriction(one()),
    body_friction: () => body().setFriction(one()),
    collider_friction: () => world.collider(one()).setFriction(one()),
    surface_velocity: () => world.collider(one()).setSurfaceVelocity(take(3)),
    body_filter: () => body().setFilter(one(), one()),
    collider_filter: () => world.collider(one()).setFilter(one(), one()),
    enabled: () => body().setEnabled(one() === 1),
    bodies_inside: () => tellSlots(world.bodiesInside(world.collider(one()))),
    wake: () => world.wake(),
    spawn: () => world.spawn(one(), { position: take(3), rotation: take(4), velocity: take(3), spin: take(3) }),
    despawn: () => body().despawn(),
    raycast: () => tellHit(world.raycast(take(3), take(3), one())),
    closest() {
      const hit = world.closest(take(3), one());
      tellHit(hit);
      if (hit) tell(Number(hit.isInside));
    },
    overlap_sphere: () => tellSlots(world.overlapSphere(take(3), one())),
    overlap_box: () => tellSlots(world.overlapBox(pose(), take(3))),
    record_events: () => world.recordEvents(one()),
    drain() {
      const events = world.events();
      tell("events", events.length);
      for (const each of events) {
        const { kind, collider, step, time, impulse, duration } = each;
        const row = hashOf([time, ...impulse, duration]);
        tell(EVENTS[kind], collider, step, slotOf(each.body), slotOf(each.other), row);
      }
    },
    attach: () => body().attach(list(), world.frame(one()), { feels: one() === 1 }),
    detach: () => body().detach(list()),
    load() {
      const { force, torque } = body().load(world.frame(one()));
      tell(hashOf([...force, ...torque]));
    },
    grab() {
      const [who, triangle, weights, point] = [body(), one(), take(3), take(3)];
      who.grab({ triangle, weights, point }, { frequency: one(), maxForce: one() });
    },
    move_grab: () => world.grab(one()).moveTo(take(3)),
    release_grab: () => world.grab(one()).release(),
    grab_force: () => tell(hashOf(world.grab(one()).force)),
    join() {
      const [who, vertices, other, onto] = [body(), list(), body(), list()];
      tell(who.join(vertices, other, { onto }).number);
    },
    joint_force: () => tell(hashOf(world.joint(one()).force)),
    release_joint: () => world.joint(one()).release(),
    add_motor() {
      const [who, vertices, turns, isFixed, hasPoint] = [body(), list(), one() === 1, one() === 1, one() === 1];
      const [axis, point, speed, limit] = [take(3), take(3), one(), one()];
      const most = turns ? { maxTorque: limit } : { maxForce: limit };
      tell(who.addMotor(vertices, { axis, speed, isFixed, point: hasPoint ? point : null, ...most }).number);
    },
    motor_speed: () => world.motor(one()).setSpeed(one()),
    motor_limit: () => world.motor(one()).setLimit(one()),
    motor_state() {
      const motor = world.motor(one());
      tell(hashOf([motor.measuredSpeed, motor.effort]));
    },
    remove_motor: () => world.motor(one()).remove(),
    add_frame: () => tell(world.addFrame(pose()).number),
    remove_frame: () => world.frame(one()).remove(),
    frame_pose: () => tell(hashOf(flat(world.frame(one()).pose))),
    add_collider() {
      const [kind, size] = [SHAPES[one()], take(3)];
      const shape = { kind, size, friction: one(), restitution: one(), thickness: one(), group: one(), mask: one() };
      tell(world.addCollider(shape, pose()).number);
    },
    add_sensor() {
      const [kind, size] = [SHAPES[one()], take(3)];
      tell(world.addSensor({ kind, size, group: one(), mask: one() }, pose()).number);
    },
    remove_collider: () => world.collider(one()).remove(),
    move_collider: () => world.collider(one()).moveTo(pose()),
    drive_collider: () => world.collider(one()).setVelocity(take(3), take(3)),
    teleport_collider: () => world.collider(one()).teleport(pose()),
    move_frame: () => world.frame(one()).moveTo(pose()),
    snapshot() {
      kept = world.snapshot();
    },
    restore: () => world.restore(kept),
    positions: () => tell(hashOf(body().positions(one()))),
    mesh() {
      const mesh = meshOf(body(), one());
      mesh.update();
      tell(hashOf(mesh.positions), hashOf(mesh.normals));
    },
    collider_impulse() {
      const { impulse, moment } = world.collider(one()).impulse;
      tell(hashOf([...impulse, ...moment]));
    },
    collider_pose: () => tell(hashOf(flat(world.collider(one()).pose))),
    status: () => tell(STATUS[body().status]),
    stable_substeps: () => tell(world.stableSubsteps(one())),
  };
  for (const line of game.split("\n").filter(Boolean)) {
    const [call, ...rest] = line.trim().split(/\s+/);
    numbers = rest.map(Number);
    calls[call]();
  }
  world.destroy();
  return told;
}

if (globalThis.process?.argv?.[1]?.endsWith("play.mjs")) {
  const { readFileSync } = await import("node:fs");
  const { sceneOf } = await import("../../engine_adapter/web/taichi-soft.js");
  const folder = process.argv[2];
  const scene = await sceneOf(readFileSync(`${folder}/kernels/web.wasm`), readFileSync(`${folder}/world.tsw`));
  console.log(play(scene, readFileSync(0, "utf8")).join("\n"));
}

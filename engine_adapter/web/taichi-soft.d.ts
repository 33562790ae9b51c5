/** Three numbers: a place [m], a velocity [m/s], an impulse [N s]. */
export type Vector = ArrayLike<number> & Iterable<number>;
/** A unit quaternion x, y, z, w. */
export type Rotation = ArrayLike<number> & Iterable<number>;
export interface Pose {
  position: Vector;
  rotation?: Rotation;
}

export const EVENTS: { contactBegan: 1; contactEnded: 2; fellAsleep: 4; woke: 8; froze: 16 };

export class SoftError extends Error {
  code: "ARGUMENT" | "HANDLE" | "BUSY" | "FILE" | "VERSION" | "SIZE" | "STATE" | "SNAPSHOT" | "RUNTIME";
}

export type Kind = "body" | "asset" | "collider" | "frame" | "mesh" | "joint" | "motor";

export class Scene {
  readonly counts: Record<Kind, number>;
  nameOf(kind: Kind, number: number): string;
  find(kind: Kind, name: string | number): number;
  asset(name: string | number): {
    number: number;
    vertexCount: number;
    slotCount: number;
    mass: number;
    levelCount: number;
  };
  createWorld(): World;
  unload(): void;
}

export interface Clock {
  stepsMade: number;
  steps: number;
  time: number;
  alpha: number;
  dropped: number;
}

export interface Hit {
  body: Body;
  triangle: number;
  distance: number;
  weights: number[];
  point: number[];
  normal: number[];
  vertices: number[];
  isInside: boolean;
}

export interface SoftEvent {
  kind: keyof typeof EVENTS;
  collider: number;
  step: number;
  time: number;
  body: Body;
  other: Body | null;
  impulse: number[];
  duration: number;
}

export interface Shape {
  kind: "plane" | "sphere" | "box" | "capsule";
  size?: Vector;
  friction?: number;
  restitution?: number;
  thickness?: number;
  group?: number;
  mask?: number;
}

export class World {
  readonly scene: Scene;
  readonly clock: Clock;
  readonly bodies: Body[];
  readonly droppedEvents: number;
  onStep: (() => void) | null;
  destroy(): void;
  step(dt?: number, substeps?: number): void;
  setFixedStep(step?: { dt?: number; substeps?: number; maxSteps?: number }): void;
  advance(seconds: number): Clock;
  stableSubsteps(dt: number): number;
  wake(): void;
  setGravity(gravity: Vector): void;
  setFriction(friction: number): void;
  setWind(velocity: Vector, air?: { density?: number; drag?: number }): void;
  radialImpulse(center: Vector, impulse: number, radius: number): void;
  hash(): string;
  snapshot(): Uint8Array;
  restore(bytes: Uint8Array): void;
  recordEvents(kinds?: number): void;
  events(): SoftEvent[];
  body(name: string | number): Body | null;
  spawn(
    asset: string | number,
    place?: { position?: Vector; rotation?: Rotation; velocity?: Vector; spin?: Vector },
  ): Body;
  raycast(origin: Vector, direction: Vector, reach?: number): Hit | null;
  closest(point: Vector, reach?: number): Hit | null;
  overlapSphere(center: Vector, radius: number): Body[];
  overlapBox(pose: Pose, size: Vector): Body[];
  collider(name: string | number): Collider;
  addCollider(shape: Shape, pose?: Pose): Collider;
  frame(name: string | number): Frame;
  addFrame(pose?: Pose): Frame;
  grab(number: number): Grab | null;
  joint(name: string | number): Joint | null;
  motor(name: string | number): Motor | null;
}

export class Body {
  readonly world: World;
  readonly handle: bigint;
  readonly asset: number;
  readonly status: "active" | "frozen" | "asleep";
  readonly center: number[];
  /** Of detail, 0 being the finest. */
  readonly level: number;
  /** At its level. */
  readonly vertexCount: number;
  despawn(): void;
  setLevel(level: number, how?: { release?: boolean }): void;
  positions(alpha?: number): Float32Array;
  mesh(name?: string | number | null): Mesh;
  setVelocity(linear: Vector, spin?: Vector): void;
  teleport(center: Vector, how?: { turn?: Rotation; keepsVelocity?: boolean }): void;
  applyImpulse(impulse: Vector, vertices?: ArrayLike<number> | null): void;
  applyForce(force: Vector, vertices?: ArrayLike<number> | null): void;
  impulseAt(impulse: Vector, point: Vector, radius: number): void;
  setGravityScale(scale: number): void;
  setFriction(friction: number): void;
  setDamping(rate: number): void;
  setSheltered(isSheltered: boolean): void;
  pin(vertices: ArrayLike<number>): void;
  unpin(vertices?: ArrayLike<number> | null): void;
  setTargets(vertices: ArrayLike<number>, targets: ArrayLike<number>): void;
  attach(vertices: ArrayLike<number> | null, frame: Frame, how?: { feels?: boolean }): void;
  detach(vertices?: ArrayLike<number> | null): void;
  load(frame: Frame): { force: number[]; torque: number[] };
  join(vertices: ArrayLike<number>, other: Body, how?: { onto?: ArrayLike<number> | null }): Joint;
  addMotor(
    vertices: ArrayLike<number>,
    drive: {
      axis: Vector;
      speed?: number;
      maxTorque?: number | null;
      maxForce?: number | null;
      isFixed?: boolean;
      point?: Vector | null;
    },
  ): Motor;
  grab(
    hit: Pick<Hit, "triangle" | "weights" | "point">,
    spring?: { frequency?: number; maxForce?: number; target?: Vector },
  ): Grab;
}

/** `positions` and `normals` are views of the module's memory: take them anew after each `update`. */
export class Mesh {
  readonly body: Body;
  readonly vertexCount: number;
  readonly positions: Float32Array;
  readonly normals: Float32Array;
  readonly triangles: Uint32Array;
  readonly uv: Float32Array | null;
  update(): void;
  free(): void;
}

export class Grab {
  readonly force: number[];
  moveTo(point: Vector): void;
  release(): void;
}

export class Joint {
  readonly number: number;
  readonly handle: bigint;
  readonly force: number[];
  release(): void;
}

export class Motor {
  readonly number: number;
  readonly handle: bigint;
  readonly measuredSpeed: number;
  readonly effort: number;
  setSpeed(speed: number): void;
  setLimit(limit: number): void;
  remove(): void;
}

export class Collider {
  readonly number: number;
  readonly pose: { position: number[]; rotation: number[] };
  readonly impulse: { impulse: number[]; moment: number[] };
  moveTo(pose: Pose): void;
  setVelocity(linear: Vector, spin?: Vector): void;
  setFriction(friction: number): void;
  teleport(pose: Pose): void;
  remove(): void;
}

export class Frame {
  readonly number: number;
  readonly pose: { position: number[]; rotation: number[] };
  moveTo(pose: Pose): void;
  remove(): void;
}

export function loadWorld(folder: string | URL): Promise<World>;
export function loadScene(folder: string | URL): Promise<Scene>;
export function sceneOf(code: BufferSource, world: Uint8Array): Promise<Scene>;

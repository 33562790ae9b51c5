/** Three numbers: a place [m], a velocity [m/s], an impulse [N s]. */
export type Vector = ArrayLike<number> & Iterable<number>;
/** A unit quaternion x, y, z, w. */
export type Rotation = ArrayLike<number> & Iterable<number>;
export interface Pose {
  position: Vector;
  rotation?: Rotation;
}

export const EVENTS: { contactBegan: 1; contactEnded: 2; fellAsleep: 4; woke: 8; froze: 16 };

/** An error of the library, with a `code` such as ARGUMENT or STATE. A refused call changes nothing. */
export class SoftError extends Error {
  code: "ARGUMENT" | "HANDLE" | "BUSY" | "FILE" | "VERSION" | "SIZE" | "STATE" | "SNAPSHOT" | "RUNTIME";
}

export type Kind = "body" | "asset" | "collider" | "frame" | "mesh" | "joint" | "motor";

/** A world file: `loadScene` reads it. Worlds of one scene share its code. */
export class Scene {
  readonly counts: Record<Kind, number>;
  /** Name of a "body", "asset", "collider", "frame", "mesh", "joint" or "motor". */
  nameOf(kind: Kind, number: number): string;
  /** Number of a thing, by its name. */
  find(kind: Kind, name: string | number): number;
  /** `vertexCount`, `slotCount`, `mass` [kg] and `levelCount` of an asset. */
  asset(name: string | number): {
    number: number;
    vertexCount: number;
    slotCount: number;
    mass: number;
    levelCount: number;
  };
  /** A world as it was exported. */
  createWorld(): World;
  /** Free the scene, as soon as the last of its worlds is destroyed. */
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

/** A simulation of a scene. */
export class World {
  readonly scene: Scene;
  /** `stepsMade` by the last `advance`, `steps`, `time` [s], `alpha`, `dropped` [s]. */
  readonly clock: Clock;
  /** All bodies, by slot. */
  readonly bodies: Body[];
  /** Events that were dropped: more than 10,000 waited, or more pairs touched than there is room for. */
  readonly droppedEvents: number;
  /** A function that is called before each step of `advance`: it moves colliders and frames, and pushes. */
  onStep: (() => void) | null;
  /** Free the world, its meshes included. */
  destroy(): void;
  /** Make one step of `dt` [s]; 0 substeps for as many as are stable. */
  step(dt?: number, substeps?: number): void;
  /** How `advance` steps: time beyond `maxSteps` in a frame is dropped. */
  setFixedStep(step?: { dt?: number; substeps?: number; maxSteps?: number }): void;
  /** Add the time of a frame [s] and make the steps that are due. */
  advance(seconds: number): Clock;
  /** Substeps that a step of `dt` [s] needs. */
  stableSubsteps(dt: number): number;
  /** Wake all bodies. */
  wake(): void;
  /** Gravity [m/s^2], from the next step on. It wakes all bodies. */
  setGravity(gravity: Vector): void;
  /** Coulomb's coefficient of the floor, from the next step on. */
  setFriction(friction: number): void;
  /** Wind [m/s], of air with a density [kg/m^3]. */
  setWind(velocity: Vector, air?: { density?: number; drag?: number }): void;
  /** Push all bodies away from a point: `impulse` [N s] near it, none at `radius` [m]. */
  radialImpulse(center: Vector, impulse: number, radius: number): void;
  /** The state as 16 hexadecimal digits: the same on every platform. */
  hash(): string;
  /** A copy of the state between two steps. */
  snapshot(): Uint8Array;
  /** Put the world back to a snapshot of the same export. */
  restore(bytes: Uint8Array | ArrayBuffer): void;
  /** How often `restore` was called. A history of states is void when somebody else has restored one. */
  readonly restoreCount: number;
  /** Record events of these kinds, a sum of `EVENTS`; all by default, 0 for none. */
  recordEvents(kinds?: number): void;
  /** The events since the last call. */
  events(): SoftEvent[];
  /** The body in a slot, by its number or name; null if the slot is empty. */
  body(name: string | number): Body | null;
  /** Put a body of an asset into a free slot; `velocity` [m/s], `spin` [rad/s]. */
  spawn(
    asset: string | number,
    place?: { position?: Vector; rotation?: Rotation; velocity?: Vector; spin?: Vector },
  ): Body;
  /** The first surface on a ray, or null. */
  raycast(origin: Vector, direction: Vector, reach?: number): Hit | null;
  /** The nearest point of all surfaces, or null. */
  closest(point: Vector, reach?: number): Hit | null;
  /** Bodies with a point in a sphere. */
  overlapSphere(center: Vector, radius: number): Body[];
  /** Bodies with a point in a box. */
  overlapBox(pose: Pose, size: Vector): Body[];
  collider(name: string | number): Collider;
  /** Add a plane, sphere, box or capsule. The world needs `collider_room` for it. */
  addCollider(shape: Shape, pose?: Pose): Collider;
  frame(name: string | number): Frame;
  addFrame(pose?: Pose): Frame;
  /** The grab with a number from 0 to 15, or null. */
  grab(number: number): Grab | null;
  /** The joint of a name or number, 0 to 63; null for none. */
  joint(name: string | number): Joint | null;
  /** The motor of a name or number, 0 to 63; null for none. */
  motor(name: string | number): Motor | null;
}

/** A body in a world. */
export class Body {
  readonly world: World;
  readonly handle: bigint;
  /** Number of its asset. */
  readonly asset: number;
  /** "active", "frozen" or "asleep". */
  readonly status: "active" | "frozen" | "asleep";
  /** Centre of mass [m]. */
  readonly center: number[];
  /** Level of detail, 0 being the finest. */
  readonly level: number;
  /** Number of vertices at its level. */
  readonly vertexCount: number;
  /** Take the body out of the world. */
  despawn(): void;
  /** Go on with more or fewer tetrahedra. With `release`, joints and motors that have no place there are released. */
  setLevel(level: number, how?: { release?: boolean }): void;
  /** A copy of the positions of its vertices [m]: after the last step, or `alpha` of the way to it. */
  positions(alpha?: number): Float32Array;
  /** A mesh to draw: the first one of its asset, or one by its number or name. Call it once, not in each frame. */
  mesh(name?: string | number | null): Mesh;
  /** Velocity [m/s] and angular velocity [rad/s] about the centre of mass. */
  setVelocity(linear: Vector, spin?: Vector): void;
  /** Move the centre of mass there, and turn the body as it is now by `turn`. */
  teleport(center: Vector, how?: { turn?: Rotation; keepsVelocity?: boolean }): void;
  /** Apply an impulse [N s] to vertices, or to the whole body. */
  applyImpulse(impulse: Vector, vertices?: ArrayLike<number> | null): void;
  /** Apply a force [N] during the next step, to vertices or to the whole body. */
  applyForce(force: Vector, vertices?: ArrayLike<number> | null): void;
  /** Apply an impulse [N s] to what is within `radius` [m] of a point. */
  impulseAt(impulse: Vector, point: Vector, radius: number): void;
  /** Factor on gravity for this body. */
  setGravityScale(scale: number): void;
  /** Coulomb's coefficient against other bodies, in worlds with soft contact. */
  setFriction(friction: number): void;
  /** Drag [1/s]. */
  setDamping(rate: number): void;
  /** Whether wind passes it by. */
  setSheltered(isSheltered: boolean): void;
  /** Hold vertices in their places. */
  pin(vertices: ArrayLike<number>): void;
  /** Let pinned vertices go, or all of them. */
  unpin(vertices?: ArrayLike<number> | null): void;
  /** Positions of pinned vertices after the next step [m], 3 numbers each. */
  setTargets(vertices: ArrayLike<number>, targets: ArrayLike<number>): void;
  /** Hang vertices on a frame, from where both are now. With `feels` the load can be read. */
  attach(vertices: ArrayLike<number> | null, frame: Frame, how?: { feels?: boolean }): void;
  /** Let vertices go that hang on a frame, or all of them. */
  detach(vertices?: ArrayLike<number> | null): void;
  /** `force` [N] and `torque` [N m] of the body on a frame. */
  load(frame: Frame): { force: number[]; torque: number[] };
  /** Let vertices be held by another body: where they are in it, or each at a vertex of it, `onto`. */
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
  /** Hold the body where a ray has hit it, by a spring. */
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
  /** Three numbers of vertices each. */
  readonly triangles: Uint32Array;
  /** Two numbers a vertex, v upwards; null where there are none. */
  readonly uv: Float32Array | null;
  /** Write `positions` [m] and `normals` as the body is now. */
  update(): void;
  /** Gives back its memory, as `World.destroy` does for all. */
  free(): void;
}

/** A spring that holds a body. */
export class Grab {
  /** Force of the spring [N]. */
  readonly force: number[];
  /** Move the end of the spring [m]. */
  moveTo(point: Vector): void;
  /** Let go. */
  release(): void;
}

/** A connection between parts of two bodies. */
export class Joint {
  readonly number: number;
  readonly handle: bigint;
  /** Force of the other body, mean over the last step [N]. */
  readonly force: number[];
  /** End the joint. */
  release(): void;
}

/** A motor that turns or pushes a part of a body. */
export class Motor {
  readonly number: number;
  readonly handle: bigint;
  /** Speed of its vertices [rad/s] or [m/s]. */
  readonly measuredSpeed: number;
  /** Its torque [N m] or force [N], mean over the last step. */
  readonly effort: number;
  /** Wanted speed [rad/s] or [m/s]. */
  setSpeed(speed: number): void;
  /** Limit of torque [N m] or force [N]; with 0 its vertices coast. */
  setLimit(limit: number): void;
  /** End the motor. */
  remove(): void;
}

/** A solid that bodies touch and do not move. */
export class Collider {
  readonly number: number;
  readonly pose: { position: number[]; rotation: number[] };
  /** `impulse` [N s] that bodies gave it in the last step, and `moment` about its place. */
  readonly impulse: { impulse: number[]; moment: number[] };
  /** Move to a pose until the end of the next step. */
  moveTo(pose: Pose): void;
  /** Move on at this velocity [m/s] and angular velocity [rad/s]. */
  setVelocity(linear: Vector, spin?: Vector): void;
  /** Coulomb's coefficient, from the next step on. */
  setFriction(friction: number): void;
  /** Be at a pose at once, without touching what is on the way. */
  teleport(pose: Pose): void;
  remove(): void;
}

/** A pose that the game moves, with the bodies that are attached to it. */
export class Frame {
  readonly number: number;
  readonly pose: { position: number[]; rotation: number[] };
  /** Move to a pose until the end of the next step. */
  moveTo(pose: Pose): void;
  remove(): void;
}

/** A world of such a folder. */
export function loadWorld(folder: string | URL): Promise<World>;
/** Loads a folder that `taichi-soft export --for web` wrote. */
export function loadScene(folder: string | URL): Promise<Scene>;
/** Compiles a world's module and reads its file: the bytes of `kernels/web.wasm` and of `world.tsw`. */
export function sceneOf(code: BufferSource, world: Uint8Array): Promise<Scene>;

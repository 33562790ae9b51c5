/** Three numbers: a position [m], a velocity [m/s] or an impulse [N s]. */
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
  /** Number of an object, by its name. */
  find(kind: Kind, name: string | number): number;
  /** `vertexCount`, `slotCount`, `mass` [kg] and `levelCount` of an asset. */
  asset(name: string | number): {
    number: number;
    vertexCount: number;
    slotCount: number;
    mass: number;
    levelCount: number;
  };
  /** Create a world in its exported state. */
  createWorld(): World;
  /** Free the scene when the last of its worlds is destroyed. */
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
  /** Number of dropped events, because more than 10,000 waited, or more pairs touched than there is room for. */
  readonly droppedEvents: number;
  /** Function that is called before each step of `advance`, to move colliders and frames and to apply forces. */
  onStep: (() => void) | null;
  /** Free the world and its meshes. */
  destroy(): void;
  /** Make one step of `dt` [s]; 0 substeps chooses a stable number. */
  step(dt?: number, substeps?: number): void;
  /** Set the steps of `advance`. Time beyond `maxSteps` in a frame is dropped. */
  setFixedStep(step?: { dt?: number; substeps?: number; maxSteps?: number }): void;
  /** Add the time of a frame [s] and make the steps that are due. */
  advance(seconds: number): Clock;
  /** Substeps that a step of `dt` [s] needs. */
  stableSubsteps(dt: number): number;
  /** Wake all bodies. */
  wake(): void;
  /** Gravity [m/s^2], from the next step on. It wakes all bodies. */
  setGravity(gravity: Vector): void;
  /** Coulomb coefficient of the floor, from the next step on. */
  setFriction(friction: number): void;
  /** Wind velocity [m/s], and air density [kg/m^3]. */
  setWind(velocity: Vector, air?: { density?: number; drag?: number }): void;
  /** Push all bodies away from a point: `impulse` [N s] near it, none at `radius` [m]. */
  radialImpulse(center: Vector, impulse: number, radius: number): void;
  /** Hash of the state, 16 hexadecimal digits, equal on every platform. */
  hash(): string;
  /** A copy of the state between two steps. */
  snapshot(): Uint8Array;
  /** Restore a snapshot of the same export. */
  restore(bytes: Uint8Array | ArrayBuffer): void;
  /** Number of `restore` calls. A stored history of states is invalid after a `restore` by other code. */
  readonly restoreCount: number;
  /** Record events of these kinds, a sum of `EVENTS`; all by default, 0 for none. */
  recordEvents(kinds?: number): void;
  /** Return the events since the last call. */
  events(): SoftEvent[];
  /** Return the body in a slot, by number or name; null if the slot is empty. */
  body(name: string | number): Body | null;
  /** Spawn a body of an asset in a free slot; `velocity` [m/s], `spin` [rad/s]. */
  spawn(
    asset: string | number,
    place?: { position?: Vector; rotation?: Rotation; velocity?: Vector; spin?: Vector },
  ): Body;
  /** Find the first surface on a ray, or null. */
  raycast(origin: Vector, direction: Vector, reach?: number): Hit | null;
  /** Find the closest point of all surfaces, or null. */
  closest(point: Vector, reach?: number): Hit | null;
  /** Find the bodies that touch or enclose a sphere. */
  overlapSphere(center: Vector, radius: number): Body[];
  /** Find the bodies that touch or enclose a box. */
  overlapBox(pose: Pose, size: Vector): Body[];
  collider(name: string | number): Collider;
  /** Add a plane, sphere, box or capsule. The world needs `collider_room` for it. */
  addCollider(shape: Shape, pose?: Pose): Collider;
  frame(name: string | number): Frame;
  addFrame(pose?: Pose): Frame;
  /** Return a grab by its index, 0 to 15, or null. */
  grab(number: number): Grab | null;
  /** Return a joint by name or index, 0 to 63; null for none. */
  joint(name: string | number): Joint | null;
  /** Return a motor by name or index, 0 to 63; null for none. */
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
  /** Level of detail; 0 is the finest. */
  readonly level: number;
  /** Number of vertices at its level. */
  readonly vertexCount: number;
  /** Remove the body from the world. */
  despawn(): void;
  /** Change the level of detail. Fails if joints, motors or attachments cannot be kept, unless `release` is true. */
  setLevel(level: number, how?: { release?: boolean }): void;
  /** Copy the positions of its vertices [m], interpolated from the previous step (0) to the last one (1). */
  positions(alpha?: number): Float32Array;
  /** Return a render mesh: the first one of its asset, or one by number or name. Call it once, not in each frame. */
  mesh(name?: string | number | null): Mesh;
  /** Velocity [m/s] and angular velocity [rad/s] about the centre of mass. */
  setVelocity(linear: Vector, spin?: Vector): void;
  /** Move the centre of mass to a position, and rotate the current shape by `turn`. */
  teleport(center: Vector, how?: { turn?: Rotation; keepsVelocity?: boolean }): void;
  /** Apply an impulse [N s] to vertices, or to the whole body. */
  applyImpulse(impulse: Vector, vertices?: ArrayLike<number> | null): void;
  /** Apply a force [N] during the next step, to vertices or to the whole body. */
  applyForce(force: Vector, vertices?: ArrayLike<number> | null): void;
  /** Apply an impulse [N s] to the vertices within `radius` [m] of a point. */
  impulseAt(impulse: Vector, point: Vector, radius: number): void;
  /** Factor on gravity for this body. */
  setGravityScale(scale: number): void;
  /** Coulomb coefficient against other bodies, in worlds with soft contact. */
  setFriction(friction: number): void;
  /** Damping rate of the velocity [1/s]. */
  setDamping(rate: number): void;
  /** Shelter the body from the wind, or expose it. */
  setSheltered(isSheltered: boolean): void;
  /** Pin vertices at their positions. */
  pin(vertices: ArrayLike<number>): void;
  /** Release pinned vertices, or all of them. */
  unpin(vertices?: ArrayLike<number> | null): void;
  /** Positions of pinned vertices after the next step [m], 3 numbers each. */
  setTargets(vertices: ArrayLike<number>, targets: ArrayLike<number>): void;
  /** Attach vertices to a frame at their current positions. Set `feels` to read the load later. */
  attach(vertices: ArrayLike<number> | null, frame: Frame, how?: { feels?: boolean }): void;
  /** Detach vertices from frames, or all of them. */
  detach(vertices?: ArrayLike<number> | null): void;
  /** `force` [N] and `torque` [N m] of the body on a frame. */
  load(frame: Frame): { force: number[]; torque: number[] };
  /** Attach vertices to another body: at their current positions in it, or each to one of its vertices in `onto`. */
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
  /** Grab the body with a spring, where a ray hit it. */
  grab(
    hit: Pick<Hit, "triangle" | "weights" | "point">,
    spring?: { frequency?: number; maxForce?: number; target?: Vector },
  ): Grab;
}

/** `positions` and `normals` are views of the module's memory: read them again after each `update`. */
export class Mesh {
  readonly body: Body;
  readonly vertexCount: number;
  readonly positions: Float32Array;
  readonly normals: Float32Array;
  /** Vertex indices, three per triangle. */
  readonly triangles: Uint32Array;
  /** Texture coordinates, two numbers per vertex, v upwards; null if there are none. */
  readonly uv: Float32Array | null;
  /** Update `positions` [m] and `normals`. */
  update(): void;
  /** Free its memory. `World.destroy` does this for all meshes. */
  free(): void;
}

/** A grab: a spring that holds a body. */
export class Grab {
  /** Force of the spring [N]. */
  readonly force: number[];
  /** Move the end of the spring [m]. */
  moveTo(point: Vector): void;
  /** Release the grab. */
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

/** A motor that rotates or pushes a part of a body. */
export class Motor {
  readonly number: number;
  readonly handle: bigint;
  /** Speed of its vertices [rad/s] or [m/s]. */
  readonly measuredSpeed: number;
  /** Its torque [N m] or force [N], mean over the last step. */
  readonly effort: number;
  /** Target speed [rad/s] or [m/s]. */
  setSpeed(speed: number): void;
  /** Limit of torque [N m] or force [N]; with 0 its vertices coast. */
  setLimit(limit: number): void;
  /** End the motor. */
  remove(): void;
}

/** A rigid shape that bodies cannot move. */
export class Collider {
  readonly number: number;
  readonly pose: { position: number[]; rotation: number[] };
  /** `impulse` [N s] of bodies on it in the last step, and `moment` about its position. */
  readonly impulse: { impulse: number[]; moment: number[] };
  /** Move to a pose over the next step. */
  moveTo(pose: Pose): void;
  /** Move at a constant velocity [m/s] and angular velocity [rad/s]. */
  setVelocity(linear: Vector, spin?: Vector): void;
  /** Coulomb coefficient, from the next step on. */
  setFriction(friction: number): void;
  /** Jump to a pose, without pushing bodies on the way. */
  teleport(pose: Pose): void;
  remove(): void;
}

/** A pose that the game moves, together with attached bodies. */
export class Frame {
  readonly number: number;
  readonly pose: { position: number[]; rotation: number[] };
  /** Move to a pose over the next step. */
  moveTo(pose: Pose): void;
  remove(): void;
}

/** Loads a folder from `taichi-soft export --for web`, and creates a world. */
export function loadWorld(folder: string | URL): Promise<World>;
/** Loads a folder from `taichi-soft export --for web`. */
export function loadScene(folder: string | URL): Promise<Scene>;
/** Compiles a world's module and reads its file: the bytes of `kernels/web.wasm` and of `world.tsw`. */
export function sceneOf(code: BufferSource, world: Uint8Array): Promise<Scene>;

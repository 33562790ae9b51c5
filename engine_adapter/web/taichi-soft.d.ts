/** Three numbers: a position [m], a velocity [m/s] or an impulse [N s]. */
export type Vector = ArrayLike<number> & Iterable<number>;
/** A unit quaternion x, y, z, w. */
export type Rotation = ArrayLike<number> & Iterable<number>;
export interface Pose {
  position: Vector;
  rotation?: Rotation;
}

export const EVENTS: { contactBegan: 1; contactEnded: 2; fellAsleep: 4; woke: 8; froze: 16; entered: 32; left: 64 };

/** An error of the library, with a `code` such as ARGUMENT or STATE. A refused call changes nothing. */
export class SoftError extends Error {
  code: "ARGUMENT" | "HANDLE" | "BUSY" | "FILE" | "VERSION" | "SIZE" | "STATE" | "SNAPSHOT" | "RUNTIME";
}

export type Kind = "body" | "asset" | "collider" | "frame" | "mesh" | "joint" | "motor";

/** A world file, read by `loadScene`. All worlds of a scene share the compiled code. */
export class Scene {
  readonly counts: Record<Kind, number>;
  /** Return the name of a "body", "asset", "collider", "frame", "mesh", "joint" or "motor" with a number. */
  nameOf(kind: Kind, number: number): string;
  /** Return the number of the object with a name. */
  find(kind: Kind, name: string | number): number;
  /** Return `vertexCount`, `slotCount`, `mass` [kg] and `levelCount` of an asset. */
  asset(name: string | number): {
    number: number;
    vertexCount: number;
    slotCount: number;
    mass: number;
    levelCount: number;
  };
  /** Create a world in the exported state. */
  createWorld(): World;
  /** Release the scene. Its memory is freed when the last of its worlds is destroyed. */
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

/** A running instance of a scene. */
export class World {
  readonly scene: Scene;
  /** Clock: `stepsMade` by the last `advance`, total `steps`, `time` [s], `alpha`, total `dropped` time [s]. */
  readonly clock: Clock;
  /** All bodies, in the order of their slots. */
  readonly bodies: Body[];
  /** Number of events dropped because more than 10,000 were waiting or more pairs touched than fit the table. */
  readonly droppedEvents: number;
  /** Function that `advance` calls before each step. Move colliders and frames and apply forces in it. */
  onStep: (() => void) | null;
  /** Free the world and its meshes. */
  destroy(): void;
  /** Make one step of `dt` [s]. With 0 substeps, a stable number is chosen. */
  step(dt?: number, substeps?: number): void;
  /** Set the steps that `advance` makes. Time beyond `maxSteps` steps per frame is dropped. */
  setFixedStep(step?: { dt?: number; substeps?: number; maxSteps?: number }): void;
  /** Add the time of a frame [s] and make the steps that are due. */
  advance(seconds: number): Clock;
  /** Return the number of substeps that a step of `dt` [s] needs. */
  stableSubsteps(dt: number): number;
  /** Wake all bodies. */
  wake(): void;
  /** Set gravity [m/s^2] from the next step on, and wake all bodies. */
  setGravity(gravity: Vector): void;
  /** Set the Coulomb coefficient of the floor from the next step on. */
  setFriction(friction: number): void;
  /** Set the wind velocity [m/s] and the air density [kg/m^3]. */
  setWind(velocity: Vector, air?: { density?: number; drag?: number }): void;
  /** Push all bodies away from a point. The impulse falls from `impulse` [N s] at the point to 0 at `radius` [m]. */
  radialImpulse(center: Vector, impulse: number, radius: number): void;
  /** Return a hash of the state, 16 hexadecimal digits, equal on every platform. */
  hash(): string;
  /** Return a copy of the state between two steps. */
  snapshot(): Uint8Array;
  /** Restore the state of a snapshot from a world of the same export. */
  restore(bytes: Uint8Array | ArrayBuffer): void;
  /** Number of `restore` calls. If this number has changed, states stored before belong to another history. */
  readonly restoreCount: number;
  /** Record events of these kinds, a sum of `EVENTS`. By default, all kinds are recorded; with 0, no kind. */
  recordEvents(kinds?: number): void;
  /** Return the events since the last call. */
  events(): SoftEvent[];
  /** Return the body in a slot with a number or name; null if the slot is empty. */
  body(name: string | number): Body | null;
  /** Spawn a body of an asset in a free slot, with a velocity [m/s] and an angular velocity `spin` [rad/s]. */
  spawn(
    asset: string | number,
    place?: { position?: Vector; rotation?: Rotation; velocity?: Vector; spin?: Vector },
  ): Body;
  /** Find the first surface that a ray hits; null if there is none. */
  raycast(origin: Vector, direction: Vector, reach?: number): Hit | null;
  /** Find the point of all surfaces that is closest to a point; null if none is in range. */
  closest(point: Vector, reach?: number): Hit | null;
  /** Find the bodies that touch or enclose a sphere. */
  overlapSphere(center: Vector, radius: number): Body[];
  /** Find the bodies that touch or enclose a box. */
  overlapBox(pose: Pose, size: Vector): Body[];
  collider(name: string | number): Collider;
  /** Add a plane, sphere, box or capsule. The world must have free `collider_room`. */
  addCollider(shape: Shape, pose?: Pose): Collider;
  /** Add a collider that bodies do not touch, and that reports the bodies in it by the events entered and left. */
  addSensor(shape: Pick<Shape, "kind" | "size" | "group" | "mask">, pose?: Pose): Collider;
  /** Find the bodies that touch or enclose a sensor. */
  bodiesInside(sensor: Collider): Body[];
  frame(name: string | number): Frame;
  addFrame(pose?: Pose): Frame;
  /** Return the grab with an index, 0 to 15; null if there is none. */
  grab(number: number): Grab | null;
  /** Return the joint with a name or an index, 0 to 63; null if there is none. */
  joint(name: string | number): Joint | null;
  /** Return the motor with a name or an index, 0 to 63; null if there is none. */
  motor(name: string | number): Motor | null;
}

/** A body in a world. */
export class Body {
  readonly world: World;
  readonly handle: bigint;
  /** Number of the body's asset. */
  readonly asset: number;
  /** State of the body: "active", "frozen" or "asleep". */
  readonly status: "active" | "frozen" | "asleep" | "disabled";
  /** Centre of mass [m]. */
  readonly center: number[];
  /** Level of detail; 0 is the finest. */
  readonly level: number;
  /** Number of vertices at the current level. */
  readonly vertexCount: number;
  /** Remove the body from the world. */
  despawn(): void;
  /**
   * Change the level of detail. If joints, motors or attachments cannot be kept at the new level, they are released if
   * `release` is true; otherwise the call fails.
   */
  setLevel(level: number, how?: { release?: boolean }): void;
  /** Return the vertex positions [m], interpolated between before (alpha 0) and after (alpha 1) the last step. */
  positions(alpha?: number): Float32Array;
  /** Return the mesh with a number or name, or the first mesh of the body's asset and level. Call this only once. */
  mesh(name?: string | number | null): Mesh;
  /** Set the velocity [m/s] of the centre of mass, and the angular velocity about it [rad/s]. */
  setVelocity(linear: Vector, spin?: Vector): void;
  /** Move the centre of mass to a position, and rotate the current shape by `turn`. */
  teleport(center: Vector, how?: { turn?: Rotation; keepsVelocity?: boolean }): void;
  /** Apply an impulse [N s] to vertices, or to the whole body. */
  applyImpulse(impulse: Vector, vertices?: ArrayLike<number> | null): void;
  /** Apply a force [N] during the next step, to vertices or to the whole body. */
  applyForce(force: Vector, vertices?: ArrayLike<number> | null): void;
  /** Apply an impulse [N s] to the vertices within `radius` [m] of a point. */
  impulseAt(impulse: Vector, point: Vector, radius: number): void;
  /** Set the factor by which gravity is multiplied for this body. */
  setGravityScale(scale: number): void;
  /** Set the Coulomb coefficient for contact with other bodies. The world must have soft contact. */
  setFriction(friction: number): void;
  /** Set group and mask, as bits, from the next step on. */
  setFilter(group: number, mask: number): void;
  /** Set the damping rate of the velocity [1/s]. */
  setDamping(rate: number): void;
  /** Switch the body off or on. A body that is off keeps its shape and velocity, and costs no time. Hide its mesh. */
  setEnabled(isEnabled: boolean): void;
  /** Shelter the body from the wind, or expose it. */
  setSheltered(isSheltered: boolean): void;
  /** Pin vertices at their positions. */
  pin(vertices: ArrayLike<number>): void;
  /** Release pinned vertices; by default, all. */
  unpin(vertices?: ArrayLike<number> | null): void;
  /** Set the positions of pinned vertices after the next step [m], 3 numbers each. */
  setTargets(vertices: ArrayLike<number>, targets: ArrayLike<number>): void;
  /** Attach vertices to a frame at their current positions. Set `feels` to read the load on the frame later. */
  attach(vertices: ArrayLike<number> | null, frame: Frame, how?: { feels?: boolean }): void;
  /** Detach vertices from frames; by default, all. */
  detach(vertices?: ArrayLike<number> | null): void;
  /** Return `force` [N] and `torque` [N m] that the body exerts on a frame. */
  load(frame: Frame): { force: number[]; torque: number[] };
  /** Attach vertices to the body `other`, at their current positions or, with `onto`, each to a vertex in `onto`. */
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
  /** Grab the body with a spring at the hit of a ray. */
  grab(
    hit: Pick<Hit, "triangle" | "weights" | "point">,
    spring?: { frequency?: number; maxForce?: number; target?: Vector },
  ): Grab;
}

/** A render mesh. `positions` and `normals` are views of the module's memory. Read them again after each `update`. */
export class Mesh {
  readonly body: Body;
  readonly vertexCount: number;
  readonly positions: Float32Array;
  readonly normals: Float32Array;
  /** Vertex indices, three per triangle. */
  readonly triangles: Uint32Array;
  /** Texture coordinates, two numbers per vertex; v points up. Null if there are none. */
  readonly uv: Float32Array | null;
  /** Update `positions` [m] and `normals`. */
  update(): void;
  /** Free the memory of the mesh. `World.destroy` does this for all meshes. */
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
  /** Force that the other body exerts [N], averaged over the last step. */
  readonly force: number[];
  /** Remove the joint. */
  release(): void;
}

/** A motor that rotates or pushes a part of a body. */
export class Motor {
  readonly number: number;
  readonly handle: bigint;
  /** Speed of the driven vertices [rad/s] or [m/s]. */
  readonly measuredSpeed: number;
  /** Torque [N m] or force [N] of the motor, averaged over the last step. */
  readonly effort: number;
  /** Set the target speed [rad/s] or [m/s]. */
  setSpeed(speed: number): void;
  /** Set the largest torque [N m] or force [N]. With 0 the vertices coast. */
  setLimit(limit: number): void;
  /** Remove the motor. */
  remove(): void;
}

/** A rigid shape that bodies cannot move. */
export class Collider {
  readonly number: number;
  readonly pose: { position: number[]; rotation: number[] };
  /** `impulse` [N s] of all bodies on the collider in the last step, and its `moment` about the collider's position. */
  readonly impulse: { impulse: number[]; moment: number[] };
  /** Move the collider to a pose over the next step. */
  moveTo(pose: Pose): void;
  /** Move the collider at a constant velocity [m/s] and angular velocity [rad/s]. */
  setVelocity(linear: Vector, spin?: Vector): void;
  /** Set the Coulomb friction coefficient from the next step on. */
  setFriction(friction: number): void;
  /** Set group and mask, as bits, from the next step on. */
  setFilter(group: number, mask: number): void;
  /** Move the surface like a conveyor belt. `velocity` is relative to the collider, in its axes; zero stops the surface. */
  setSurfaceVelocity(velocity: Vector): void;
  /** Move the collider to a pose at once, without pushing bodies in between. */
  teleport(pose: Pose): void;
  remove(): void;
}

/** A pose that the game moves, together with attached bodies. */
export class Frame {
  readonly number: number;
  readonly pose: { position: number[]; rotation: number[] };
  /** Move the frame to a pose over the next step. */
  moveTo(pose: Pose): void;
  remove(): void;
}

/** Loads a folder that `taichi-soft export --for web` wrote, and creates a world. */
export function loadWorld(folder: string | URL): Promise<World>;
/** Loads a folder that `taichi-soft export --for web` wrote. */
export function loadScene(folder: string | URL): Promise<Scene>;
/** Compiles a world's kernels and reads its world file, from the bytes of `kernels/web.wasm` and of `world.tsw`. */
export function sceneOf(code: BufferSource, world: Uint8Array): Promise<Scene>;

import type { Body, Grab, Mesh } from "./taichi-soft.js";

/** A three.js mesh that follows a body. `THREE` is the module of three.js, whose types you can choose. */
export class SoftMesh<ThreeMesh = any> {
  constructor(THREE: any, body: Body, material: any, name?: string | number | null);
  readonly mesh: ThreeMesh;
  readonly drawn: Mesh;
  /** Update the mesh with the current shape of the body. */
  update(): void;
  /** Grab the body where a `THREE.Raycaster` hits it; null if the ray hits nothing or another body. */
  grab(raycaster: any): { grab: Grab; distance: number } | null;
  /** Move the target of a grab to the ray, at the initial distance from the ray's origin. Pass a result of `grab`. */
  pull(held: { grab: Grab; distance: number }, raycaster: any): void;
  dispose(): void;
}

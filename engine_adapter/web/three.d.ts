import type { Body, Grab, Mesh } from "./taichi-soft.js";

/** A three.js mesh that follows a body. `THREE` is the module of three.js; you can choose its types. */
export class SoftMesh<ThreeMesh = any> {
  constructor(THREE: any, body: Body, material: any, name?: string | number | null);
  readonly mesh: ThreeMesh;
  readonly drawn: Mesh;
  /** Update the mesh from the body. */
  update(): void;
  /** Grab the body at the hit of a `THREE.Raycaster`; null if the ray hits nothing or another body. */
  grab(raycaster: any): { grab: Grab; distance: number } | null;
  /** Move a result of `grab` to the ray, at its initial distance from the origin. */
  pull(held: { grab: Grab; distance: number }, raycaster: any): void;
  dispose(): void;
}

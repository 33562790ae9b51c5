import type { Body, Grab, Mesh } from "./taichi-soft.js";

/** A mesh of three.js that follows a body. `THREE` is the module of three.js; its types are yours to name. */
export class SoftMesh<ThreeMesh = any> {
  constructor(THREE: any, body: Body, material: any, name?: string | number | null);
  readonly mesh: ThreeMesh;
  readonly drawn: Mesh;
  /** Draw the body as it is now. */
  update(): void;
  /** Hold the body where the ray of a `THREE.Raycaster` meets it; null if it meets nothing, or another body. */
  grab(raycaster: any): { grab: Grab; distance: number } | null;
  /** Move what `grab` returned to the ray, as far from its origin as at first. */
  pull(held: { grab: Grab; distance: number }, raycaster: any): void;
  dispose(): void;
}

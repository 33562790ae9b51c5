// Soft bodies in a scene of three.js: the game hands over its own three, so that nothing is imported here.
//
//     const jelly = new SoftMesh(THREE, world.body("jelly"), new THREE.MeshStandardMaterial());
//     scene.add(jelly.mesh);
//     renderer.setAnimationLoop(() => {
//       world.advance(clock.getDelta());
//       jelly.update();
//     });

/** A mesh of three.js that follows a body. World files for it are exported with `--axes y-up`. */
export class SoftMesh {
  constructor(THREE, body, material, name = null) {
    this.drawn = body.mesh(name);
    const geometry = new THREE.BufferGeometry();
    for (const [to, from] of [["position", "positions"], ["normal", "normals"]]) {
      // A copy of three's own: views of the module's memory end where it grows.
      const attribute = new THREE.BufferAttribute(new Float32Array(this.drawn[from]), 3);
      geometry.setAttribute(to, attribute.setUsage(THREE.DynamicDrawUsage));
    }
    if (this.drawn.uv) geometry.setAttribute("uv", new THREE.BufferAttribute(new Float32Array(this.drawn.uv), 2));
    geometry.setIndex(new THREE.BufferAttribute(new Uint32Array(this.drawn.triangles), 1));
    this.mesh = new THREE.Mesh(geometry, material);
    this.mesh.frustumCulled = false; // its box changes with every frame
  }

  /** Draw it as it is now. */
  update() {
    this.drawn.update();
    const { position, normal } = this.mesh.geometry.attributes;
    position.array.set(this.drawn.positions);
    normal.array.set(this.drawn.normals);
    position.needsUpdate = normal.needsUpdate = true;
  }

  /** Take hold of the body where a ray of a THREE.Raycaster meets it; null where that misses, or hits another. */
  grab(raycaster) {
    const { origin, direction } = raycaster.ray;
    const { world, handle } = this.drawn.body;
    const hit = world.raycast(origin.toArray(), direction.toArray());
    return hit?.body.handle === handle ? { grab: hit.body.grab(hit), distance: hit.distance } : null;
  }

  /** Move what `grab` gave to where the ray is now, as far from its origin as at first. */
  pull({ grab, distance }, raycaster) {
    const { origin, direction } = raycaster.ray;
    grab.moveTo(origin.clone().addScaledVector(direction, distance).toArray());
  }

  dispose() {
    this.mesh.geometry.dispose();
    this.drawn.free();
  }
}

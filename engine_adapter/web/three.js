// Draws soft bodies in a three.js scene. The game passes its own three.js module, so this file imports nothing.
//
//     const jelly = new SoftMesh(THREE, world.body("jelly"), new THREE.MeshStandardMaterial());
//     scene.add(jelly.mesh);
//     renderer.setAnimationLoop(() => {
//       world.advance(clock.getDelta());
//       jelly.update();
//     });

/** A three.js mesh that follows a body. Export the world file with `--axes y-up`. */
export class SoftMesh {
  constructor(THREE, body, material, name = null) {
    this.drawn = body.mesh(name);
    const geometry = new THREE.BufferGeometry();
    for (const [to, from] of [["position", "positions"], ["normal", "normals"]]) {
      // Make a separate copy, because views of the module's memory become invalid when the memory grows.
      const attribute = new THREE.BufferAttribute(new Float32Array(this.drawn[from]), 3);
      geometry.setAttribute(to, attribute.setUsage(THREE.DynamicDrawUsage));
    }
    if (this.drawn.uv) geometry.setAttribute("uv", new THREE.BufferAttribute(new Float32Array(this.drawn.uv), 2));
    geometry.setIndex(new THREE.BufferAttribute(new Uint32Array(this.drawn.triangles), 1));
    this.mesh = new THREE.Mesh(geometry, material);
    this.mesh.frustumCulled = false; // three.js would compute the bounds only once
  }

  /** Update the mesh with the current shape of the body. */
  update() {
    this.drawn.update();
    const { position, normal } = this.mesh.geometry.attributes;
    position.array.set(this.drawn.positions);
    normal.array.set(this.drawn.normals);
    position.needsUpdate = normal.needsUpdate = true;
  }

  /** Grab the body where a THREE.Raycaster hits it; null if the ray hits nothing or another body. */
  grab(raycaster) {
    const { origin, direction } = raycaster.ray;
    const { world, handle } = this.drawn.body;
    const hit = world.raycast(origin.toArray(), direction.toArray());
    return hit?.body.handle === handle ? { grab: hit.body.grab(hit), distance: hit.distance } : null;
  }

  /** Move the target of a grab to the ray, at the initial distance from the ray's origin. Pass a result of `grab`. */
  pull({ grab, distance }, raycaster) {
    const { origin, direction } = raycaster.ray;
    grab.moveTo(origin.clone().addScaledVector(direction, distance).toArray());
  }

  dispose() {
    this.mesh.geometry.dispose();
    this.drawn.free();
  }
}

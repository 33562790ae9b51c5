// Draws a game: bodies and colliders with shadows, on a floor that fades into the colour of the page.
import * as THREE from "three";
import { OrbitControls } from "./OrbitControls.js";
import { SoftMesh } from "./three.js";

const FRAMED = 1.6; // aspect ratio for which the scenes' cameras are placed
const [LOWEST, FINEST] = [0.5, 2]; // drawn pixels per CSS pixel: fewer if drawing is slow, more for smooth edges
const WANTED = 60; // target frame rate [1/s]

export class Stage {
  constructor(canvas) {
    this.canvas = canvas;
    this.renderer = new THREE.WebGLRenderer({ canvas });
    this.renderer.shadowMap.enabled = true;
    this.camera = new THREE.PerspectiveCamera();
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enablePan = false;
    this.controls.addEventListener("change", () => (this.isStale = true));
    this.sharpness = Math.min(Math.max(window.devicePixelRatio, 1.5), FINEST);
    this.drawn = [];
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.#paint());
    new ResizeObserver(() => this.#fit()).observe(canvas.parentElement);
  }

  /** Show a game from where its camera stands; pictures by the names of their files. */
  async show(game, folder) {
    const { facts } = game;
    const pictures = new Map();
    for (const [asset, file] of Object.entries(facts.textures)) {
      const picture = await new THREE.TextureLoader().loadAsync(`${folder}/${file}`);
      picture.colorSpace = THREE.SRGBColorSpace;
      pictures.set(game.scene.find("asset", asset), picture);
    }
    this.clear();
    Object.assign(this, { game, pictures, scene: new THREE.Scene(), bodies: new Map() });
    const { eye, target } = facts.camera;
    this.distance = new THREE.Vector3(...eye).distanceTo(new THREE.Vector3(...target));
    this.#light(eye, target);
    this.#ground(target);
    this.solids = [
      ...facts.colliders.map((each) => this.#solid(each, game.world.collider(each.number))),
      ...facts.props.map((each) => this.#solid(each, game.world.frame(each.frame))),
    ];
    this.strings = new THREE.LineSegments(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ depthTest: false }));
    this.strings.frustumCulled = false;
    this.strings.renderOrder = 1; // in front of the grabbed body
    this.scene.add(this.strings);
    Object.assign(this.camera, { near: this.distance / 50, far: 30 * this.distance });
    Object.assign(this.controls, { minDistance: this.distance / 4, maxDistance: 2.5 * this.distance, maxPolarAngle: 1.54 });
    this.camera.position.set(...eye);
    this.controls.target.set(...target);
    this.controls.update();
    this.#paint();
    this.#fit();
  }

  clear() {
    if (!this.scene) return;
    for (const each of this.bodies.values()) each.dispose();
    this.scene.traverse((each) => {
      for (const held of [each.geometry, each.material?.map, each.material, each.shadow]) held?.dispose();
    });
    this.scene = null;
  }

  /** The sun over the left shoulder of the camera, and the sky. */
  #light([x, y], target) {
    const reach = 0.55 * this.distance;
    const sun = new THREE.DirectionalLight(0xfff1e0, 2.7);
    const angle = Math.atan2(y - target[1], x - target[0]) - 1.35;
    sun.target.position.set(...target);
    sun.position.set(Math.cos(angle), Math.sin(angle), 1.35).multiplyScalar(reach).add(sun.target.position);
    sun.castShadow = true;
    sun.shadow.mapSize.set(1024, 1024);
    sun.shadow.radius = 3;
    sun.shadow.normalBias = 0.012 * reach;
    Object.assign(sun.shadow.camera, { left: -reach, right: reach, bottom: -reach, top: reach, near: 0.01, far: 5 * reach });
    const sky = new THREE.HemisphereLight(0xe8f1fb, 0xa89f95, 1.6);
    sky.position.set(0, 0, 1);
    this.scene.add(sun, sun.target, sky);
  }

  /** The floor is seen by the shadows on it: the rest of it costs nothing to draw. */
  #ground([x, y]) {
    const geometry = new THREE.CircleGeometry(0.75 * this.distance, 48);
    this.floor = new THREE.Mesh(geometry, new THREE.ShadowMaterial({ opacity: 0.3 }));
    this.floor.receiveShadow = true;
    this.floor.position.set(x, y, -0.002); // below objects that lie on it, against z-fighting
    this.scene.add(this.floor);
  }

  /** In the colours of the page. */
  #paint() {
    if (!this.scene) return;
    const style = getComputedStyle(document.documentElement);
    const color = (name) => new THREE.Color(style.getPropertyValue(name).trim());
    this.scene.background = color("--back");
    this.strings.material.color = color("--text");
    this.isStale = true;
  }

  #solid({ vertices, triangles, color }, thing) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(vertices, 3));
    geometry.setIndex(triangles);
    geometry.computeVertexNormals();
    const mesh = new THREE.Mesh(geometry, this.#material({ roughness: 0.75, color }));
    mesh.castShadow = mesh.receiveShadow = true;
    this.scene.add(mesh);
    return { mesh, thing };
  }

  /** One without highlights where drawing is slow. */
  #material({ color, map = null, roughness }) {
    const looks = { map, color: new THREE.Color().setRGB(...color, THREE.SRGBColorSpace), side: THREE.DoubleSide };
    return this.isPlain ? new THREE.MeshLambertMaterial(looks) : new THREE.MeshStandardMaterial({ roughness, ...looks });
  }

  /** What is drawn of each body that is there: a body that came in the slot of another one is another mesh. */
  #bodies() {
    const there = new Map(this.game.world.bodies.map((body) => [body.handle, body]));
    for (const [handle, each] of this.bodies) {
      if (there.has(handle)) continue;
      this.scene.remove(each.mesh);
      each.mesh.material.dispose();
      each.dispose();
      this.bodies.delete(handle);
    }
    for (const [handle, body] of there) {
      if (this.bodies.has(handle)) continue;
      const slot = Number(handle & 0xffffffffn) - 1;
      const map = this.pictures.get(body.asset) ?? null;
      const color = map ? [1, 1, 1] : this.game.facts.colors[slot];
      const drawn = new SoftMesh(THREE, body, this.#material({ roughness: 0.42, color, map }));
      drawn.mesh.castShadow = drawn.mesh.receiveShadow = true;
      this.scene.add(drawn.mesh);
      this.bodies.set(handle, drawn);
    }
  }

  /** Draw the game as it is now. */
  draw() {
    if (!this.scene) return;
    this.#bodies();
    for (const each of this.bodies.values()) each.update();
    for (const { mesh, thing } of this.solids) {
      const { position, rotation } = thing.pose;
      mesh.position.set(...position);
      mesh.quaternion.set(...rotation);
    }
    const ends = [...this.game.grabs].flatMap((held) => [...this.#heldAt(held), ...held.point]);
    this.strings.geometry.dispose();
    this.strings.geometry = new THREE.BufferGeometry();
    this.strings.geometry.setAttribute("position", new THREE.Float32BufferAttribute(ends, 3));
    this.renderer.render(this.scene, this.camera);
    this.isStale = false;
  }

  /** The grabbed point of a body, where it is now. */
  #heldAt({ body, hit }) {
    const rows = body.positions();
    return [0, 1, 2].map((axis) => hit.vertices.reduce((sum, vertex, i) => sum + hit.weights[i] * rows[3 * vertex + axis], 0));
  }

  /** The width that the scene frames is in the picture, whatever its shape. */
  #fit() {
    const { clientWidth, clientHeight } = this.canvas;
    if (!this.scene || !clientWidth || !clientHeight) return;
    this.renderer.setPixelRatio(this.sharpness);
    this.renderer.setSize(clientWidth, clientHeight, false);
    this.camera.aspect = clientWidth / clientHeight;
    const widening = Math.max(1, FRAMED / this.camera.aspect);
    const half = Math.tan((this.game.facts.camera.fov * Math.PI) / 360);
    this.camera.fov = (360 / Math.PI) * Math.atan(half * widening);
    this.camera.updateProjectionMatrix();
    this.isStale = true;
  }

  /** Draw hard shadows, no highlights and fewer pixels where there are too few frames a second. */
  ease(rate) {
    if (rate > 0.9 * WANTED || this.sharpness === LOWEST) return;
    if (!this.isPlain) {
      this.isPlain = true;
      this.renderer.shadowMap.type = THREE.BasicShadowMap;
      this.floor.material.needsUpdate = true;
      for (const { mesh } of [...this.solids, ...this.bodies.values()]) {
        const { map, color, side } = mesh.material;
        mesh.material.dispose();
        mesh.material = new THREE.MeshLambertMaterial({ map, color, side });
      }
    }
    this.sharpness = Math.max(LOWEST, this.sharpness * Math.sqrt(rate / WANTED));
    this.#fit();
  }

  /** Turn about the target [rad], and come nearer by a factor. */
  turn(around, upwards, factor) {
    const away = this.camera.position.clone().sub(this.controls.target);
    const at = new THREE.Spherical().setFromVector3(new THREE.Vector3(away.x, away.z, -away.y));
    at.theta += around;
    at.phi = Math.min(Math.max(at.phi - upwards, 0.05), this.controls.maxPolarAngle);
    at.radius = Math.min(Math.max(at.radius * factor, this.controls.minDistance), this.controls.maxDistance);
    away.setFromSpherical(at);
    this.camera.position.copy(this.controls.target).add(new THREE.Vector3(away.x, -away.z, away.y));
    this.controls.update();
  }

  /** The ray under a pointer, or through the middle of the picture. */
  ray(event = null) {
    const box = this.canvas.getBoundingClientRect();
    const x = event ? (2 * (event.clientX - box.left)) / box.width - 1 : 0;
    const y = event ? 1 - (2 * (event.clientY - box.top)) / box.height : 0;
    this.camera.updateMatrixWorld();
    const caster = new THREE.Raycaster();
    caster.setFromCamera(new THREE.Vector2(x, y), this.camera);
    return caster;
  }

  /** What a ray meets of the bodies, unless something solid hides it: a hit, or null. */
  hit(caster) {
    const { origin, direction } = caster.ray;
    const hit = this.game.world.raycast(origin.toArray(), direction.toArray());
    const [solid] = caster.intersectObjects(this.solids.map((each) => each.mesh));
    return !hit || (solid && solid.distance < hit.distance - 0.05) ? null : hit;
  }

  /** A plane through a point that faces the camera. */
  facing(point) {
    const normal = this.camera.getWorldDirection(new THREE.Vector3());
    return new THREE.Plane().setFromNormalAndCoplanarPoint(normal, new THREE.Vector3(...point));
  }
}

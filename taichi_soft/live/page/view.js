// The view: renders bodies, colliders and floor with shadows, in one or two panes.
import * as THREE from "three";
import { Room } from "./room.js";
import { OrbitControls } from "./three/OrbitControls.js";

const RAMP = [[77, 133, 204], [107, 191, 194], [242, 224, 133], [242, 145, 71], [204, 46, 56]].map(c => c.map(v => v / 255));
const toLinear = v => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);

// The rendered objects of one world.
class Pane {
  constructor() {
    this.scene = new THREE.Scene();
    this.room = new Room(this.scene);
    this.body = null;
    this.solids = [];
    this.header = null;
  }

  draw(header, arrays) {
    for (const old of [this.body, ...this.solids]) {
      if (old) { this.scene.remove(old); old.geometry.dispose(); old.material.dispose(); }
    }
    this.header = header;
    const geometry = new THREE.BufferGeometry();
    const n = header.vertices;
    geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(3 * n), 3).setUsage(THREE.DynamicDrawUsage));
    geometry.setAttribute("normal", new THREE.BufferAttribute(new Float32Array(3 * n), 3).setUsage(THREE.DynamicDrawUsage));
    this.plain = new Float32Array(3 * n);
    for (let i = 0; i < 3 * n; i++) this.plain[i] = toLinear(arrays.colors[i] / 255);
    geometry.setAttribute("color", new THREE.BufferAttribute(new Float32Array(this.plain), 3));
    geometry.setIndex(new THREE.BufferAttribute(arrays.triangles, 1));
    const material = new THREE.MeshStandardMaterial({ vertexColors: true, roughness: 0.62, side: THREE.DoubleSide });
    this.body = new THREE.Mesh(geometry, material);
    this.body.castShadow = this.body.receiveShadow = true;
    this.body.frustumCulled = false;
    this.scene.add(this.body);
    this.isTinted = false;
    this.drawSolids(header, arrays);
    this.room.drawFloor(header.floor);
    this.room.aim(header.camera.target, Math.max(3, 0.6 * distance(header.camera.eye, header.camera.target)));
  }

  drawSolids(header, arrays) {
    let v = 0, t = 0;
    this.solids = header.colliders.map(each => {
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute("position", new THREE.BufferAttribute(arrays.collider_vertices.slice(3 * v, 3 * (v + each.vertices)), 3));
      geometry.setIndex(new THREE.BufferAttribute(arrays.collider_triangles.slice(3 * t, 3 * (t + each.triangles)), 1));
      v += each.vertices; t += each.triangles;
      const flat = geometry.toNonIndexed();
      flat.computeVertexNormals();
      geometry.dispose();
      const [r, g, b] = header.collider_color;
      const color = new THREE.Color().setRGB(r, g, b, THREE.SRGBColorSpace);
      const mesh = new THREE.Mesh(flat, new THREE.MeshStandardMaterial({ color, roughness: 0.85, side: THREE.DoubleSide }));
      mesh.castShadow = mesh.receiveShadow = true;
      mesh.matrixAutoUpdate = false;
      this.scene.add(mesh);
      return mesh;
    });
  }

  // Return the bounding box of all bodies, or null if there are none.
  box() {
    const box = new THREE.Box3();
    if (this.body) box.setFromBufferAttribute(this.body.geometry.attributes.position);
    return box.isEmpty() ? null : box;
  }

  move(frame) {
    const p = this.body.geometry.attributes.position, q = this.body.geometry.attributes.normal;
    const [x, y, z] = frame.low, [sx, sy, sz] = frame.size.map(s => s / 65535);
    const rows = frame.rows, normals = frame.normals, n = frame.count;
    for (let i = 0, k = 0; i < n; i++, k += 3) {
      p.array[k] = x + sx * rows[k]; p.array[k + 1] = y + sy * rows[k + 1]; p.array[k + 2] = z + sz * rows[k + 2];
      q.array[k] = normals[4 * i]; q.array[k + 1] = normals[4 * i + 1]; q.array[k + 2] = normals[4 * i + 2];
    }
    p.needsUpdate = q.needsUpdate = true;
    this.tint(frame);
    this.solids.forEach((solid, i) => {
      const m = frame.poses.subarray(12 * i, 12 * i + 12);
      solid.matrix.set(m[0], m[1], m[2], m[9], m[3], m[4], m[5], m[10], m[6], m[7], m[8], m[11], 0, 0, 0, 1);
      solid.matrixWorldNeedsUpdate = true;
    });
  }

  tint(frame) {
    if (!frame.isTinted && !this.isTinted) return;
    const color = this.body.geometry.attributes.color;
    if (!frame.isTinted) color.array.set(this.plain);
    else for (let i = 0; i < frame.count; i++) color.array.set(LADDER[frame.normals[4 * i + 3]], 3 * i);
    color.needsUpdate = true;
    this.isTinted = frame.isTinted;
  }
}

// Linear colours of the colour scale, in 128 steps.
const LADDER = Array.from({ length: 128 }, (_, i) => {
  const place = (i / 127) * (RAMP.length - 1), at = Math.min(Math.floor(place), RAMP.length - 2), share = place - at;
  return RAMP[at].map((v, k) => toLinear(v + share * (RAMP[at + 1][k] - v)));
});

const distance = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);

export class View {
  constructor(canvas, hand) {
    this.canvas = canvas;
    this.hand = hand;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: true });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = THREE.PCFShadowMap;
    this.renderer.toneMapping = THREE.NeutralToneMapping;
    this.renderer.autoClear = false;
    this.camera = new THREE.PerspectiveCamera(40, 1, 0.02, 1000);
    this.camera.up.set(0, 0, 1);
    this.camera.position.set(3, -4, 2);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = false;
    this.controls.maxPolarAngle = 1.55;
    this.controls.addEventListener("change", () => { this.isStale = true; });
    this.panes = new Map();
    this.shown = [0];
    this.isPlaced = false;
    this.pointAt = 0;
    this.isStale = true;
    this.held = null;
    this.pointer = null;
    for (const [name, call] of [["pointerdown", "press"], ["pointermove", "pull"], ["pointerup", "release"], ["pointercancel", "release"]]) {
      canvas.addEventListener(name, event => this[call](event), { capture: true });
    }
    canvas.addEventListener("keydown", event => this.key(event));
    canvas.addEventListener("pointerleave", () => { this.pointer = null; });
  }

  pane(number) {
    if (!this.panes.has(number)) this.panes.set(number, new Pane());
    return this.panes.get(number);
  }

  draw(number, header, arrays) {
    this.pane(number).draw(header, arrays);
    if (!this.isPlaced) {
      const { eye, target, fov } = header.camera;
      this.camera.position.set(...eye);
      this.controls.target.set(...target);
      this.fov = fov;
      this.controls.update();
      this.isPlaced = true;
    }
    this.isStale = true;
  }

  move(number, frame) {
    const pane = this.panes.get(number);
    if (!pane || !pane.header || pane.header.version !== frame.version) return false;
    pane.move(frame);
    this.isStale = true;
    return true;
  }

  render() {
    const width = this.canvas.clientWidth, height = this.canvas.clientHeight;
    const size = this.renderer.getSize(new THREE.Vector2());
    this.point();
    if (size.x !== width || size.y !== height) { this.renderer.setSize(width, height, false); this.isStale = true; }
    if (!this.isStale) return;
    this.isStale = false;
    this.renderer.setScissorTest(true);
    const wide = width / this.shown.length;
    this.camera.aspect = wide / height;
    // The field of view is the angle across the shorter side, as in films.
    const half = Math.tan(((this.fov ?? 40) * Math.PI) / 360);
    this.camera.fov = (360 / Math.PI) * Math.atan(this.camera.aspect < 1 ? half / this.camera.aspect : half);
    this.camera.updateProjectionMatrix();
    const away = this.camera.position.distanceTo(this.controls.target);
    this.shown.forEach((number, i) => {
      const pane = this.panes.get(number);
      if (!pane) return;
      this.renderer.setViewport(i * wide, 0, wide, height);
      this.renderer.setScissor(i * wide, 0, wide, height);
      this.renderer.clear();
      pane.room.follow(this.camera, away);
      this.renderer.render(pane.scene, this.camera);
    });
  }

  // Return the ray under a pointer, and its pane.
  ray(event) {
    const box = this.canvas.getBoundingClientRect(), wide = box.width / this.shown.length;
    const i = Math.min(this.shown.length - 1, Math.max(0, Math.floor((event.clientX - box.left) / wide)));
    return this.rayIn(event, i);
  }

  rayIn(event, i) {
    const box = this.canvas.getBoundingClientRect(), wide = box.width / this.shown.length;
    const x = (2 * (event.clientX - box.left - i * wide)) / wide - 1, y = 1 - (2 * (event.clientY - box.top)) / box.height;
    const caster = new THREE.Raycaster();
    caster.setFromCamera(new THREE.Vector2(x, y), this.camera);
    return { place: i, pane: this.shown[i], caster };
  }

  // Return the hit of a ray on a body, or null if the ray hits no body or a collider hides the body.
  hit(pane, caster) {
    const { body, solids } = this.panes.get(pane) ?? {};
    if (!body) return null;
    body.geometry.computeBoundingSphere();
    const hit = caster.intersectObject(body)[0], solid = caster.intersectObjects(solids)[0];
    return !hit || (solid && solid.distance < hit.distance) ? null : hit;
  }

  press(event) {
    if (event.button !== 0 || this.held) return;
    const { place, pane, caster } = this.ray(event);
    const hit = this.hit(pane, caster);
    if (!hit) return;
    event.stopImmediatePropagation();
    this.canvas.setPointerCapture(event.pointerId);
    this.canvas.classList.add("holds");
    const normal = this.camera.getWorldDirection(new THREE.Vector3());
    this.held = { id: event.pointerId, place, pane, plane: new THREE.Plane().setFromNormalAndCoplanarPoint(normal, hit.point) };
    const { origin, direction } = caster.ray;
    this.hand.grab(pane, origin.toArray(), direction.toArray());
  }

  // Update the cursor over bodies that can be grabbed. Call this regularly, because bodies move under the pointer.
  point() {
    if (this.held || performance.now() < this.pointAt) return;
    this.pointAt = performance.now() + 60;
    const { pane, caster } = this.pointer ? this.ray(this.pointer) : {};
    this.canvas.classList.toggle("can-grab", Boolean(caster && this.hit(pane, caster)));
  }

  pull(event) {
    if (event.pointerType === "mouse") this.pointer = event.buttons && !this.held ? null : { clientX: event.clientX, clientY: event.clientY };
    if (!this.held || event.pointerId !== this.held.id) return;
    event.stopImmediatePropagation();
    const point = this.rayIn(event, this.held.place).caster.ray.intersectPlane(this.held.plane, new THREE.Vector3());
    if (point) this.hand.move(this.held.pane, point.toArray());
  }

  release(event) {
    if (!this.held || event.pointerId !== this.held.id) return;
    event.stopImmediatePropagation();
    this.hand.release(this.held.pane);
    this.held = null;
    this.canvas.classList.remove("holds");
  }

  // Move the camera to frame all bodies, and keep its direction.
  frameAll() {
    const box = new THREE.Box3();
    for (const number of this.shown) {
      const own = this.panes.get(number)?.box();
      if (own) box.union(own);
    }
    if (box.isEmpty()) return;
    const ball = box.getBoundingSphere(new THREE.Sphere()), reach = Math.max(0.1, ball.radius);
    const away = this.camera.position.clone().sub(this.controls.target).normalize();
    const half = ((this.fov ?? 40) * Math.PI) / 360;
    this.controls.target.copy(ball.center);
    this.camera.position.copy(ball.center).addScaledVector(away, (1.05 * reach) / Math.sin(half));
    this.camera.far = Math.max(1000, 10 * reach);
    for (const pane of this.panes.values()) pane.room.aim(ball.center.toArray(), Math.max(3, 1.5 * reach));
    this.controls.update();
    this.isStale = true;
  }

  key(event) {
    const turn = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.06], ArrowDown: [0, 0.06] }[event.key];
    const zoom = { "+": 0.9, "=": 0.9, "-": 1.1 }[event.key];
    if (!turn && !zoom) return;
    event.preventDefault();
    const away = this.camera.position.clone().sub(this.controls.target);
    if (zoom) away.multiplyScalar(zoom);
    else {
      const length = away.length(), azimuth = Math.atan2(away.y, away.x) + turn[0];
      const polar = Math.min(1.55, Math.max(0.1, Math.acos(away.z / length) + turn[1]));
      away.set(Math.sin(polar) * Math.cos(azimuth), Math.sin(polar) * Math.sin(azimuth), Math.cos(polar)).multiplyScalar(length);
    }
    this.camera.position.copy(this.controls.target).add(away);
    this.controls.update();
    this.isStale = true;
  }
}

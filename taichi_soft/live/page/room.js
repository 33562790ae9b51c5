// Creates light, sky, and a floor with a grid that fades towards the horizon.
import * as THREE from "three";

const HORIZON = 0xdde3ea, ZENITH = 0x8fadcb, FLOOR = 0xb9bec5, LINE = "rgba(70, 84, 100, 0.34)", BOLD = "rgba(70, 84, 100, 0.6)";
const CELLS = 10, SIDE = 4000;

export class Room {
  constructor(scene) {
    this.scene = scene;
    scene.fog = new THREE.Fog(HORIZON, 10, 60);
    const light = new THREE.HemisphereLight(0xeaf2ff, 0xc9bfb2, 1.7);
    light.position.set(0, 0, 1);
    this.sun = new THREE.DirectionalLight(0xfff1dd, 2.2);
    this.sun.castShadow = true;
    this.sun.shadow.mapSize.set(1024, 1024);
    this.sun.shadow.bias = -0.0005;
    this.sun.shadow.normalBias = 0.02;
    this.sky = sky();
    scene.add(light, this.sun, this.sun.target, this.sky);
    this.floor = null;
    this.reach = 3;
  }

  // Draw a floor at a height, or no floor for null. Its grid has cells of 1 m, and bold lines every 10 m.
  drawFloor(height) {
    if (this.floor) { this.scene.remove(this.floor); this.floor.geometry.dispose(); this.floor.material.map.dispose(); this.floor.material.dispose(); }
    this.floor = null;
    if (height === null) return;
    const material = new THREE.MeshStandardMaterial({ map: grid(), roughness: 0.95 });
    this.floor = new THREE.Mesh(new THREE.PlaneGeometry(SIDE, SIDE), material);
    this.floor.position.z = height;
    this.floor.receiveShadow = true;
    this.scene.add(this.floor);
  }

  // Aim the sun at a point. Shadows cover `reach` metres on each side of the point.
  aim(target, reach) {
    this.reach = reach;
    this.sun.target.position.set(...target);
    this.sun.position.set(target[0] - 0.55 * reach, target[1] - 0.75 * reach, target[2] + 1.5 * reach);
    const eye = this.sun.shadow.camera;
    eye.left = eye.bottom = -reach; eye.right = eye.top = reach; eye.near = 0.1; eye.far = 5 * reach;
    eye.updateProjectionMatrix();
  }

  // Move sky and fog with the camera, which is `away` metres from its target.
  follow(camera, away) {
    this.sky.position.copy(camera.position);
    this.sky.scale.setScalar(0.5 * camera.far);
    this.scene.fog.near = Math.max(4 * this.reach, 1.5 * away);
    this.scene.fog.far = Math.max(20 * this.reach, 6 * away);
  }
}

function sky() {
  const geometry = new THREE.SphereGeometry(1, 16, 32).rotateX(Math.PI / 2);
  const { position } = geometry.attributes, colors = new Float32Array(3 * position.count);
  const low = new THREE.Color(HORIZON), high = new THREE.Color(ZENITH), color = new THREE.Color();
  for (let i = 0; i < position.count; i++) {
    color.lerpColors(low, high, Math.min(1, Math.max(0, position.getZ(i)) ** 0.7 * 1.4)).toArray(colors, 3 * i);
  }
  geometry.setAttribute("color", new THREE.BufferAttribute(colors, 3));
  const material = new THREE.MeshBasicMaterial({ vertexColors: true, side: THREE.BackSide, fog: false, toneMapped: false, depthWrite: false });
  const mesh = new THREE.Mesh(geometry, material);
  mesh.frustumCulled = false;
  mesh.renderOrder = 1; // draw last, behind everything else
  return mesh;
}

function grid() {
  const size = 2048, canvas = document.createElement("canvas");
  canvas.width = canvas.height = size;
  const pen = canvas.getContext("2d");
  pen.fillStyle = `#${FLOOR.toString(16)}`;
  pen.fillRect(0, 0, size, size);
  for (let i = 0; i < CELLS; i++) {
    const isBold = i === 0, at = (i * size) / CELLS, wide = isBold ? 5 : 3;
    pen.fillStyle = isBold ? BOLD : LINE;
    for (const shift of isBold ? [-wide / 2, size - wide / 2] : [-wide / 2]) {
      pen.fillRect(at + shift, 0, wide, size);
      pen.fillRect(0, at + shift, size, wide);
    }
  }
  const texture = new THREE.CanvasTexture(canvas);
  texture.colorSpace = THREE.SRGBColorSpace;
  texture.wrapS = texture.wrapT = THREE.RepeatWrapping;
  texture.repeat.set(SIDE / CELLS, SIDE / CELLS);
  texture.anisotropy = 4;
  return texture;
}

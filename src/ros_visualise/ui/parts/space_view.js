// The 3D view in a canvas: its nodes as packets tell of them, the camera of a person, and what it follows.
import { OrbitControls, THREE } from "nicegui-scene";
import { dispose, make, shared } from "./space_nodes.js";

const FOV = 50;
const TURN = 0.08; // radians, by an arrow key
const ZOOM = 1.15;
const STILL_PX = 5;
const FIELDS = 9; // numbers of a pose: node, visible, position, quaternion w, x, y, z
const TYPES = {
  float16: Uint16Array, float32: Float32Array, float64: Float64Array, uint8: Uint8Array, uint32: Uint32Array, bytes: Uint8Array,
};

// A packet: what was made, set, moved and removed; see live/space/tree.py.
export function unpack(buffer) {
  const length = Number(new DataView(buffer).getBigUint64(0, true));
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 8, length)));
  const array = ([at, type, ...shape]) => new TYPES[type](buffer, 8 + length + at, shape.reduce((all, one) => all * one, 1));
  const set = header.set.map(([number, plain, arrays]) => {
    const found = Object.entries(arrays).map(([name, described]) => [name, array(described)]);
    return [number, { ...plain, ...Object.fromEntries(found) }];
  });
  return { ...header, set, moved: array(header.moved) };
}

// True if a graphics card draws; without one smooth edges would take half of the time.
function isFast() {
  const context = document.createElement("canvas").getContext("webgl2");
  const facts = context?.getExtension("WEBGL_debug_renderer_info");
  const name = facts ? context.getParameter(facts.UNMASKED_RENDERER_WEBGL) : "";
  context?.getExtension("WEBGL_lose_context")?.loseContext();
  return !/swiftshader|llvmpipe|software|basic render/i.test(name);
}

export class SpaceView {
  // Raises an error without WebGL. `on` hears: moved(view) by a person, clicked(ray), drawn(), hinted().
  constructor(canvas, on) {
    Object.assign(this, { canvas, on, parts: new Map(), follow: "robot", scale: 500, offset: new THREE.Vector3(), isMoved: false });
    this.hints = { robot: [], frames: [], places: [], home: [-8, -6, 6, 0, 0, 0], homes: 0 };
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: isFast(), alpha: true });
    this.renderer.outputColorSpace = THREE.LinearSRGBColorSpace;
    this.renderer.setClearColor(0, 0);
    this.scene = new THREE.Scene();
    this.world = new THREE.Group();
    this.pins = new THREE.Group();
    this.scene.add(this.world, this.pins);
    this.camera = new THREE.PerspectiveCamera(FOV, 1, 0.05, 5000);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.zoomToCursor = true;
    this.controls.addEventListener("change", () => this.invalidate());
    this.controls.addEventListener("start", () => {
      this.before = [this.isMoved, this.view.join()];
      this.isMoved = true;
    });
    this.controls.addEventListener("end", () => {
      if (this.view.join() !== this.before[1]) this.moved();
      else this.isMoved = this.before[0]; // a click
    });
    canvas.addEventListener("pointerdown", ({ clientX, clientY }) => (this.pressed = [clientX, clientY]));
    canvas.addEventListener("pointerup", (event) => this.release(event));
    canvas.addEventListener("keydown", (event) => this.key(event));
    this.paint("#fff", "#000");
    this.goHome();
  }

  close() {
    this.isClosed = true;
    cancelAnimationFrame(this.asked);
    for (const part of this.parts.values()) dispose(part);
    this.controls.dispose();
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }

  resize(width, height) {
    if (!width || !height) return;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.scale = (height * this.renderer.getPixelRatio()) / 2 / Math.tan((FOV / 2) * (Math.PI / 180));
    for (const part of this.parts.values()) part.resize?.();
    this.invalidate();
  }

  // The colours of texts and of what is behind them.
  paint(ink, paper) {
    Object.assign(this, { ink, paper });
    for (const part of this.parts.values()) if (part.resize) part.set({});
    this.invalidate();
  }

  take(buffer) {
    const { made, set, gone, moved } = unpack(buffer);
    for (const number of gone) this.drop(number);
    for (const [number, above, kind, name] of made) {
      const part = make(kind, this);
      Object.assign(part, { kind, name });
      this.parts.set(number, part);
      (this.parts.get(above)?.object ?? this.world).add(part.object);
    }
    for (const [number, values] of set) this.parts.get(number)?.set(values);
    for (let at = 0; at < moved.length; at += FIELDS) {
      const { object } = this.parts.get(moved[at]) ?? {};
      if (!object) continue;
      const [visible, x, y, z, w, a, b, c] = moved.subarray(at + 1, at + FIELDS);
      const isPlace = Number.isFinite(x + y + z + w + a + b + c);
      object.visible = !!visible && isPlace;
      if (!isPlace) continue;
      object.position.set(x, y, z);
      object.quaternion.set(a, b, c, w);
    }
    this.followOn();
    this.invalidate();
  }

  drop(number) {
    const part = this.parts.get(number);
    if (!part) return;
    part.object.removeFromParent();
    dispose(part);
    this.parts.delete(number);
  }

  // All nodes are sent again.
  forget() {
    for (const number of [...this.parts.keys()]) this.drop(number);
    this.hints.homes = -1;
  }

  hint(values) {
    const { homes, robot } = this.hints;
    Object.assign(this.hints, values);
    const isNew = this.hints.homes !== homes || (!robot.length && this.hints.robot.length);
    if (isNew && !this.isMoved) this.isHomeWanted = true;
    this.on.hinted?.();
  }

  // Move the world so that what is followed stays where it is in the view.
  followOn() {
    const anchor = this.anchor();
    if (anchor) this.offset.copy(anchor).negate();
    this.world.position.copy(this.offset);
    this.pins.position.copy(this.offset);
    if (this.isHomeWanted) this.goHome();
  }

  anchor() {
    const { robot, frames, places } = this.hints;
    if (this.follow === "robot") return new THREE.Vector3(...(robot.length ? robot : [0, 0, 0]));
    const at = frames.indexOf(this.follow);
    return at < 0 ? null : new THREE.Vector3(...places.slice(3 * at, 3 * at + 3));
  }

  // Follow "robot", a frame or nothing (""); the picture stays as it is.
  setFollow(follow) {
    const before = this.offset.clone();
    this.follow = follow;
    this.followOn();
    const by = this.offset.clone().sub(before);
    this.camera.position.add(by);
    this.controls.target.add(by);
    this.controls.update();
    this.invalidate();
  }

  goHome() {
    this.isHomeWanted = this.isMoved = false;
    this.look(this.hints.home, this.fromRobot());
  }

  fromRobot() {
    return new THREE.Vector3(...(this.hints.robot.length ? this.hints.robot : [0, 0, 0])).add(this.offset);
  }

  look([x, y, z, ...at], from) {
    this.camera.position.set(x, y, z).add(from);
    this.controls.target.set(...at).add(from);
    this.controls.update();
    this.invalidate();
  }

  // Position and target: from what is followed, or else in the fixed frame.
  get view() {
    return this.seenFrom(this.anchor() ? new THREE.Vector3() : this.offset);
  }
  set view(view) {
    this.isMoved = true;
    this.look(view, this.anchor() ? new THREE.Vector3() : this.offset);
  }

  seenFrom(from) {
    const places = [this.camera.position.clone().sub(from), this.controls.target.clone().sub(from)];
    return places.flatMap((place) => place.toArray()).map((xyz) => Number(xyz.toFixed(2)));
  }

  moved() {
    this.on.moved?.(this.view, this.seenFrom(this.fromRobot()));
  }

  fromAbove() {
    this.isMoved = true;
    const distance = this.camera.position.distanceTo(this.controls.target);
    this.camera.position.copy(this.controls.target).add(new THREE.Vector3(0, -1e-4 * distance, distance));
    this.controls.update();
    this.moved();
  }

  key(event) {
    const turns = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    const zoom = { "+": 1 / ZOOM, "=": 1 / ZOOM, "-": ZOOM }[event.key];
    const action = { Home: () => this.on.home?.(), t: () => this.fromAbove() }[event.key];
    if ((!turns && !zoom && !action) || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    event.stopPropagation();
    if (action) return action();
    const way = new THREE.Spherical().setFromVector3(this.camera.position.clone().sub(this.controls.target).applyAxisAngle(new THREE.Vector3(1, 0, 0), -Math.PI / 2));
    way.theta += TURN * (turns?.[0] ?? 0);
    way.phi = Math.min(Math.max(way.phi + TURN * (turns?.[1] ?? 0), 0.01), Math.PI - 0.01);
    way.radius *= zoom ?? 1;
    const from = new THREE.Vector3().setFromSpherical(way).applyAxisAngle(new THREE.Vector3(1, 0, 0), Math.PI / 2);
    this.isMoved = true;
    this.camera.position.copy(this.controls.target).add(from);
    this.controls.update();
    this.moved();
  }

  release({ clientX, clientY, button }) {
    const [x, y] = this.pressed ?? [Infinity, 0];
    if (button !== 0 || Math.hypot(clientX - x, clientY - y) > STILL_PX) return;
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    const caster = new THREE.Raycaster();
    caster.setFromCamera(new THREE.Vector2(((clientX - left) / width) * 2 - 1, 1 - ((clientY - top) / height) * 2), this.camera);
    const { origin, direction } = caster.ray;
    this.on.clicked?.([...origin.sub(this.offset).toArray(), ...direction.toArray()]);
  }

  // Places in the fixed frame, with a line between two and a text.
  pin(places, text) {
    for (const part of this.pinned ?? []) dispose(part);
    this.pins.clear();
    this.pinned = [];
    const add = (kind, values) => {
      const part = make(kind, this);
      part.set(values);
      part.object.renderOrder = 2;
      this.pins.add(part.object);
      this.pinned.push(part);
      return part.object;
    };
    for (const place of places) {
      add("solids", { shape: "sphere", rows: new Float32Array([0, 0, 0, 1, 0, 0, 0, 0.12, 0.12, 0.12, 1, 0.6, 0, 1]) }).position.set(...place);
    }
    if (places.length > 1) add("lines", { points: new Float32Array(places.flat()), colors: [255, 150, 0], width: 2 });
    if (places.length) {
      const middle = [0, 1, 2].map((i) => places.reduce((sum, place) => sum + place[i], 0) / places.length);
      add("label", { text, height: 0, pixels: 13, centred: false }).position.set(...middle);
    }
    this.invalidate();
  }

  invalidate() {
    if (this.isClosed) return;
    this.asked ??= requestAnimationFrame(() => this.draw());
  }

  draw() {
    this.asked = null;
    const distance = this.camera.position.distanceTo(this.controls.target);
    Object.assign(this.camera, { near: Math.max(distance / 500, 0.02), far: Math.max(distance * 200, 2000) });
    this.camera.updateProjectionMatrix();
    this.renderer.getDrawingBufferSize(shared.size.value);
    shared.scale.value = this.scale;
    const ink = new THREE.Color(this.ink);
    const below = this.controls.target.clone().sub(this.offset);
    for (const part of this.parts.values()) part.look?.(below, Math.max(distance, 1), new THREE.Vector3(ink.r, ink.g, ink.b));
    this.renderer.render(this.scene, this.camera);
    this.on.drawn?.();
  }
}

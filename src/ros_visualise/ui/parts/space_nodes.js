// How each kind of node of the 3D view is drawn; `live/space/nodes.py` says what their values mean.
// Colours are drawn as they are sent, without any conversion.
import { THREE } from "nicegui-scene";

THREE.ColorManagement.enabled = false;
const ROW = 14; // numbers of a solid
const AXES = [[0.9, 0.2, 0.2], [0.25, 0.75, 0.25], [0.25, 0.45, 0.95]];
const ALONG = [[0.70710678, 0, 0.70710678, 0], [0.70710678, -0.70710678, 0, 0], [1, 0, 0, 0]]; // z turned to x, y, z
const SHAFT = 0.77; // of an arrow's length
const CAPITAL = 0.72; // height of a capital letter, of a font's size
const FONT_PX = 48;
const SPARE = 1.25; // room for more points than there are

// Uniforms of all materials, set before each drawing: pixels of 1 m at a distance of 1 m, and the view's size.
export const shared = { scale: { value: 500 }, size: { value: new THREE.Vector2(1, 1) } };

const SHAPES = {
  cube: new THREE.BoxGeometry(1, 1, 1),
  sphere: new THREE.SphereGeometry(0.5, 24, 16),
  cylinder: new THREE.CylinderGeometry(0.5, 0.5, 1, 24).rotateX(Math.PI / 2),
  cone: new THREE.ConeGeometry(0.5, 1, 24).rotateX(Math.PI / 2).translate(0, 0, 0.5),
};

const css = ([red, green, blue]) => `rgb(${red}, ${green}, ${blue})`;
const rgb = (color) => new THREE.Vector3(...color).divideScalar(255);

function shader(vertexShader, fragmentShader, uniforms = {}, more = {}) {
  const own = Object.fromEntries(Object.entries(uniforms).map(([name, value]) => [name, { value }]));
  return new THREE.ShaderMaterial({ vertexShader, fragmentShader, uniforms: { ...shared, ...own }, ...more });
}

// Light comes from the camera; what is seen from the side is darker.
const LIT = `vec3 lit(vec3 color, vec3 normal) { return color * (0.35 + 0.65 * abs(normalize(normal).z)); }`;

// Numbers of instances: one array, whose parts are attributes {name: [width, offset]}.
function interleave(geometry, there, array, stride, parts, isByte) {
  if (there?.array.length === array.length) {
    there.array.set(array);
    there.needsUpdate = true;
    return there;
  }
  geometry.dispose(); // with the arrays before
  const buffer = new THREE.InstancedInterleavedBuffer(array.slice(), stride).setUsage(THREE.DynamicDrawUsage);
  for (const [name, [width, at]] of Object.entries(parts))
    geometry.setAttribute(name, new THREE.InterleavedBufferAttribute(buffer, width, at, isByte));
  return buffer;
}

// Values are taken as typed arrays; attributes keep room, so that few of them are made anew.
function fill(geometry, name, array, width, isByte) {
  const Kind = array instanceof Uint16Array ? THREE.Float16BufferAttribute : THREE.BufferAttribute;
  let there = geometry.getAttribute(name);
  if (!there || there.array.constructor !== array.constructor || there.array.length < array.length) {
    const room = new array.constructor(Math.ceil((array.length / width) * SPARE) * width);
    there = new Kind(room, width, !!isByte);
    there.setUsage(THREE.DynamicDrawUsage);
    geometry.dispose();
    geometry.setAttribute(name, there);
  }
  there.array.set(array);
  there.clearUpdateRanges();
  there.addUpdateRange(0, array.length);
  there.needsUpdate = true;
}

class Points {
  constructor() {
    this.material = shader(
      `attribute vec3 color; uniform float pointSize, scale; varying vec3 paint;
      void main() {
        gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
        gl_PointSize = clamp(pointSize * scale / gl_Position.w, 1.5, 96.0);
        paint = color;
      }`,
      `uniform vec3 plain; uniform bool isPlain, square; varying vec3 paint;
      void main() {
        if (!square && length(gl_PointCoord - 0.5) > 0.5) discard;
        gl_FragColor = vec4(isPlain ? plain : paint, 1.0);
      }`,
      { pointSize: 0.05, plain: new THREE.Vector3(1, 1, 1), isPlain: true, square: false },
    );
    this.object = new THREE.Points(new THREE.BufferGeometry(), this.material);
  }
  set(values) {
    const { uniforms } = this.material;
    const { geometry } = this.object;
    const { points, colors } = values;
    if (colors instanceof Uint8Array) fill(geometry, "color", colors, 3, true);
    else if (colors) uniforms.plain.value = rgb(colors);
    if (colors) uniforms.isPlain.value = !(colors instanceof Uint8Array);
    if (points) {
      fill(geometry, "position", points, 3);
      geometry.setDrawRange(0, (this.count = points.length / 3));
    }
    if ("size" in values) uniforms.pointSize.value = values.size;
    if ("square" in values) uniforms.square.value = values.square;
  }
}

// Each line is a rectangle that turns to the camera.
class Lines {
  values = {};
  constructor() {
    this.material = shader(
      `attribute vec3 start, end, startColor, endColor; uniform float width, scale; uniform bool inMetres; uniform vec2 size;
      varying vec3 paint;
      void main() {
        vec4 a = modelViewMatrix * vec4(start, 1.0), b = modelViewMatrix * vec4(end, 1.0);
        float near = -0.02;
        if (a.z > near && b.z > near) { gl_Position = vec4(2.0, 2.0, 2.0, 1.0); return; }
        if (a.z > near) a = mix(a, b, (near - a.z) / (b.z - a.z));
        if (b.z > near) b = mix(b, a, (near - b.z) / (a.z - b.z));
        a = projectionMatrix * a; b = projectionMatrix * b;
        vec2 way = (b.xy / b.w - a.xy / a.w) * size;
        vec2 aside = length(way) > 1e-6 ? normalize(vec2(-way.y, way.x)) : vec2(0.0, 1.0);
        gl_Position = mix(a, b, position.x);
        float pixels = inMetres ? max(width * scale / gl_Position.w, 1.0) : width;
        gl_Position.xy += aside * position.y * pixels / size * gl_Position.w;
        paint = mix(startColor, endColor, position.x);
      }`,
      `uniform vec3 plain; uniform bool isPlain; varying vec3 paint;
      void main() { gl_FragColor = vec4(isPlain ? plain : paint, 1.0); }`,
      { width: 2.5, inMetres: false, plain: new THREE.Vector3(1, 1, 1), isPlain: true },
      { side: THREE.DoubleSide },
    );
    const geometry = new THREE.InstancedBufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute([0, -1, 0, 1, -1, 0, 1, 1, 0, 0, 1, 0], 3));
    geometry.setIndex([0, 1, 2, 0, 2, 3]);
    this.object = new THREE.Mesh(geometry, this.material);
  }
  set(values) {
    const { uniforms } = this.material;
    const { geometry } = this.object;
    const { points, colors } = values;
    if (points) {
      this.ends = interleave(geometry, this.ends, points, 6, { start: [3, 0], end: [3, 3] }, false);
      geometry.instanceCount = points.length / 6;
    }
    if (colors instanceof Uint8Array)
      this.paints = interleave(geometry, this.paints, colors, 6, { startColor: [3, 0], endColor: [3, 3] }, true);
    else if (colors) uniforms.plain.value = rgb(colors);
    if (colors) uniforms.isPlain.value = !(colors instanceof Uint8Array);
    const { width, in_metres: inMetres } = Object.assign(this.values, values);
    uniforms.inMetres.value = !!inMetres;
    uniforms.width.value = width * (inMetres ? 1 : devicePixelRatio);
  }
}

// Copies of one shape, each by a row of numbers.
class Copies {
  constructor(shape) {
    this.material = shader(
      `attribute vec3 place, extent; attribute vec4 turn, rgba; varying vec4 paint; varying vec3 across;
      vec3 turned(vec3 v) { vec3 t = 2.0 * cross(turn.yzw, v); return v + turn.x * t + cross(turn.yzw, t); }
      void main() {
        gl_Position = projectionMatrix * modelViewMatrix * vec4(turned(position * extent) + place, 1.0);
        across = normalMatrix * turned(normal / max(abs(extent), 1e-9));
        paint = rgba;
      }`,
      `${LIT} varying vec4 paint; varying vec3 across; void main() { gl_FragColor = vec4(lit(paint.rgb, across), paint.a); }`,
      {},
      { side: THREE.DoubleSide },
    );
    this.object = new THREE.Mesh(new THREE.InstancedBufferGeometry(), this.material);
    this.shape(shape);
  }
  shape(name) {
    const { geometry } = this.object;
    geometry.dispose();
    geometry.setIndex(SHAPES[name].index.clone()); // its own: who disposes of shared ones breaks the others
    for (const attribute of ["position", "normal"]) geometry.setAttribute(attribute, SHAPES[name].getAttribute(attribute).clone());
  }
  set({ shape, rows }) {
    if (shape) this.shape(shape);
    if (!rows) return;
    const { geometry } = this.object;
    const parts = { place: [3, 0], turn: [4, 3], extent: [3, 7], rgba: [4, 10] };
    this.buffer = interleave(geometry, this.buffer, rows, ROW, parts, false);
    geometry.instanceCount = this.count = rows.length / ROW;
    let isClear = false;
    for (let at = ROW - 1; at < rows.length && !isClear; at += ROW) isClear = rows[at] < 1;
    Object.assign(this.material, { transparent: isClear, depthWrite: !isClear });
  }
}

// Several parts below one object.
class Group {
  constructor(...parts) {
    this.parts = parts;
    this.object = new THREE.Group();
    this.object.add(...parts.map(({ object }) => object));
  }
}

const times = ([w, x, y, z], [a, b, c, d]) => [w * a - x * b - y * c - z * d, w * b + x * a + y * d - z * c, w * c - x * d + y * a + z * b, w * d + x * c - y * b + z * a];

function turned([w, x, y, z], [a, b, c]) {
  const [, ...v] = times(times([w, x, y, z], [0, a, b, c]), [w, -x, -y, -z]);
  return v;
}

class Axes extends Group {
  values = {};
  constructor() {
    super(new Copies("cylinder"), new Copies("sphere"));
  }
  set(values) {
    const { poses, length, radius, origin } = Object.assign(this.values, values);
    if (!poses) return;
    const [rows, balls] = [[], []];
    const first = poses.length ? poses.slice(0, 3) : [0, 0, 0]; // rows hold floats of 32 bits, which jump far away
    for (const { object } of this.parts) object.position.set(...first);
    for (let at = 0; at < poses.length; at += 7) {
      const [place, turn] = [poses.slice(at, at + 3).map((xyz, i) => xyz - first[i]), poses.slice(at + 3, at + 7)];
      ALONG.forEach((along, i) => {
        const axis = times(turn, along);
        const middle = turned(axis, [0, 0, length / 2]).map((xyz, j) => xyz + place[j]);
        rows.push(...middle, ...axis, 2 * radius, 2 * radius, length, ...AXES[i], 1);
      });
      if (origin) balls.push(...place, 1, 0, 0, 0, ...Array(3).fill(5 * radius), ...rgb(origin).toArray(), 1);
    }
    this.parts[0].set({ rows: new Float32Array(rows) });
    this.parts[1].set({ rows: new Float32Array(balls) });
  }
}

class Arrows extends Group {
  values = {};
  constructor() {
    super(new Copies("cylinder"), new Copies("cone"));
  }
  set(values) {
    const { points, color, width } = Object.assign(this.values, values);
    if (!points) return;
    const [shafts, heads] = [[], []];
    const [up, way, turn] = [new THREE.Vector3(0, 0, 1), new THREE.Vector3(), new THREE.Quaternion()];
    for (let at = 0; at < points.length; at += 6) {
      const start = points.slice(at, at + 3);
      way.set(...points.slice(at + 3, at + 6)).sub(new THREE.Vector3(...start));
      const length = way.length();
      if (!(length > 1e-6)) continue;
      const wxyz = ((q) => [q.w, q.x, q.y, q.z])(turn.setFromUnitVectors(up, way.normalize()));
      const on = (share) => start.map((xyz, i) => xyz + way.getComponent(i) * share * length);
      const paint = [...rgb(color).toArray(), 1];
      shafts.push(...on(SHAFT / 2), ...wxyz, width, width, SHAFT * length, ...paint);
      heads.push(...on(SHAFT), ...wxyz, 2.5 * width, 2.5 * width, (1 - SHAFT) * length, ...paint);
    }
    this.parts[0].set({ rows: new Float32Array(shafts) });
    this.parts[1].set({ rows: new Float32Array(heads) });
  }
}

class Mesh {
  constructor() {
    this.material = shader(
      `attribute vec4 color; varying vec4 paint; varying vec3 place;
      void main() { vec4 at = modelViewMatrix * vec4(position, 1.0); place = at.xyz; paint = color; gl_Position = projectionMatrix * at; }`,
      `${LIT} uniform vec3 plain; uniform bool isPlain; uniform float alpha; varying vec4 paint; varying vec3 place;
      void main() {
        vec3 across = cross(dFdx(place), dFdy(place));
        vec4 own = isPlain ? vec4(plain, 1.0) : paint;
        gl_FragColor = vec4(lit(own.rgb, across), own.a * alpha);
      }`,
      { plain: new THREE.Vector3(1, 1, 1), isPlain: true, alpha: 1 },
      { side: THREE.DoubleSide },
    );
    this.object = new THREE.Mesh(new THREE.BufferGeometry(), this.material);
  }
  set({ vertices, faces, colors, opacity }) {
    const { geometry } = this.object;
    const { uniforms } = this.material;
    if (vertices) {
      geometry.dispose();
      geometry.setAttribute("position", new THREE.BufferAttribute(vertices.slice(), 3));
    }
    if (faces) geometry.setIndex(new THREE.BufferAttribute(faces.slice(), 1));
    if (colors instanceof Uint8Array) geometry.setAttribute("color", new THREE.BufferAttribute(colors.slice(), 4, true));
    else if (colors) uniforms.plain.value = rgb(colors);
    if (colors) uniforms.isPlain.value = !(colors instanceof Uint8Array);
    if (opacity !== undefined) uniforms.alpha.value = opacity;
    const isClear = uniforms.alpha.value < 1 || (colors instanceof Uint8Array && colors.some((value, i) => i % 4 === 3 && value < 255));
    Object.assign(this.material, { transparent: isClear, depthWrite: !isClear });
  }
}

class Label {
  values = {};
  constructor(view) {
    this.view = view;
    this.material = new THREE.SpriteMaterial({ transparent: true });
    this.object = new THREE.Sprite(this.material);
  }
  set(values) {
    const { text, height, centred, color } = Object.assign(this.values, values);
    const lines = text.split("\n").slice(0, 50);
    const canvas = document.createElement("canvas");
    const to = canvas.getContext("2d");
    const font = `500 ${FONT_PX}px system-ui, sans-serif`;
    to.font = font;
    this.lines = lines.length;
    canvas.width = Math.min(Math.ceil(Math.max(...lines.map((line) => to.measureText(line).width))) + 16, 4096);
    canvas.height = Math.ceil(lines.length * FONT_PX * 1.2 + 12);
    Object.assign(to, { font, textAlign: "center", textBaseline: "top", lineJoin: "round", lineWidth: 8 });
    Object.assign(to, { strokeStyle: this.view.paper, fillStyle: color ? css(color) : this.view.ink });
    lines.forEach((line, i) => {
      to.strokeText(line, canvas.width / 2, 6 + i * FONT_PX * 1.2);
      to.fillText(line, canvas.width / 2, 6 + i * FONT_PX * 1.2);
    });
    this.material.map?.dispose();
    const map = new THREE.CanvasTexture(canvas);
    Object.assign(this.material, { map, depthTest: height > 0, sizeAttenuation: height > 0, needsUpdate: true });
    this.object.renderOrder = height > 0 ? 0 : 1;
    this.object.center.set(0.5, centred ? 0.5 : 0);
    this.resize();
  }
  resize() {
    const { map } = this.material;
    if (!map) return;
    const { height, pixels } = this.values;
    const em = height > 0 ? height / CAPITAL : (pixels * devicePixelRatio) / this.view.scale;
    this.object.scale.set((map.image.width / FONT_PX) * em, (map.image.height / FONT_PX) * em, 1);
  }
}

class Plane {
  constructor(view) {
    this.view = view;
    this.material = new THREE.MeshBasicMaterial({ side: THREE.DoubleSide });
    this.plane = new THREE.Mesh(new THREE.PlaneGeometry(1, 1), this.material);
    this.plane.visible = false;
    this.object = new THREE.Group();
    this.object.add(this.plane);
  }
  set({ image, width, height }) {
    if (width !== undefined) this.plane.scale.x = width;
    if (height !== undefined) this.plane.scale.y = height;
    if (image?.length) this.show(image);
  }
  async show(image) {
    const number = (this.number = (this.number ?? 0) + 1);
    const bitmap = await createImageBitmap(new Blob([image]), { imageOrientation: "flipY" }).catch(() => null);
    if (!bitmap || number !== this.number) return bitmap?.close();
    this.material.map?.image.close();
    this.material.map?.dispose();
    const map = new THREE.Texture(bitmap);
    Object.assign(map, { flipY: false, needsUpdate: true, magFilter: THREE.NearestFilter, anisotropy: 4 });
    Object.assign(this.material, { map, needsUpdate: true });
    this.plane.visible = true;
    this.view.invalidate();
  }
}

class Frustum extends Group {
  values = {};
  constructor(view) {
    super(new Lines(), new Plane(view));
    this.parts[1].object.rotation.x = Math.PI; // its top is towards -y
  }
  set(values) {
    const { fov, aspect, length, color } = Object.assign(this.values, values);
    const [lines, plane] = this.parts;
    const y = length * Math.tan(fov / 2);
    const x = y * aspect;
    const corners = [[-x, -y, length], [x, -y, length], [x, y, length], [-x, y, length]];
    const points = corners.flatMap((corner, i) => [0, 0, 0, ...corner, ...corner, ...corners[(i + 1) % 4]]);
    lines.set({ points: new Float32Array(points), colors: color, width: 1.5 });
    plane.set({ image: values.image, width: 2 * x, height: 2 * y });
    plane.object.position.z = length;
  }
}

// Lines 1 m apart, or 10 m and so on farther away, on a plane that follows the camera.
class Grid {
  constructor(view) {
    this.view = view;
    this.material = shader(
      `uniform float reach; uniform vec2 middle; varying vec2 at, away;
      void main() { away = position.xy * 2.0; at = position.xy * reach;
        gl_Position = projectionMatrix * modelViewMatrix * vec4(at + middle, 0.0, 1.0); }`,
      `uniform float cell; uniform vec2 rest; uniform vec3 ink; varying vec2 at, away;
      float line(float apart) {
        vec2 place = (at + rest) / apart, blur = fwidth(place);
        vec2 near = abs(fract(place - 0.5) - 0.5) / max(blur, 1e-6);
        return clamp(1.0 - min(near.x, near.y), 0.0, 1.0) * clamp(1.0 - 2.0 * max(blur.x, blur.y), 0.0, 1.0);
      }
      void main() {
        float alpha = max(0.16 * line(cell), 0.34 * line(10.0 * cell)) * pow(clamp(1.0 - length(away), 0.0, 1.0), 1.5);
        if (alpha < 0.004) discard;
        gl_FragColor = vec4(ink, alpha);
      }`,
      { reach: 100, middle: new THREE.Vector2(), rest: new THREE.Vector2(), cell: 1, ink: new THREE.Vector3(1, 1, 1) },
      { transparent: true, depthWrite: false, side: THREE.DoubleSide },
    );
    this.object = new THREE.Mesh(new THREE.PlaneGeometry(1, 1), this.material);
  }
  set() {}
  look(target, distance, ink) {
    const { uniforms } = this.material;
    const cell = 10 ** Math.max(0, Math.ceil(Math.log10(distance / 60)));
    uniforms.cell.value = cell;
    uniforms.reach.value = Math.max(120, 12 * distance);
    uniforms.middle.value.set(target.x, target.y);
    uniforms.rest.value.set(target.x % (10 * cell), target.y % (10 * cell));
    uniforms.ink.value = ink;
  }
}

class Frame {
  constructor() {
    this.object = new THREE.Group();
  }
  set() {}
}

// What browsers choose their views by; nothing is drawn.
class View extends Frame {
  constructor(view) {
    super();
    this.view = view;
  }
  set(values) {
    this.view.hint(values);
  }
}

export const KINDS = {
  frame: Frame, points: Points, lines: Lines, arrows: Arrows, axes: Axes, solids: Copies, mesh: Mesh,
  label: Label, picture: Plane, frustum: Frustum, grid: Grid, view: View,
};

export function make(kind, view) {
  const part = kind === "solids" ? new Copies("cube") : new KINDS[kind](view);
  part.object.traverse((one) => (one.frustumCulled = false)); // nothing has a size that is known
  return part;
}

export function dispose(part) {
  for (const { material, object } of part.parts ?? [part]) {
    material?.map?.dispose();
    material?.dispose();
    object.traverse((one) => one.isSprite || one.geometry?.dispose()); // all sprites share one
  }
}

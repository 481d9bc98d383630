// The points, drawn a budget at a time into a picture of their own, which grows while the camera rests.
// Every prefix of a node is a fair sample of it, and the coarsest nodes come first, so that the first
// budget shows the whole.
import * as THREE from "three";
import { SCANS, stopsOf } from "./colours.js";
import { Pace } from "./pace.js";

export const GROUND = 0xf3f5f7;
const MOVING = [33, 20_000]; // aim of a frame, ms, and least points
const RESTING = [120, 150_000];
const POINT_M = 0.0035; // what a point is drawn as, between one pixel and ...
const MOST_PX = 3;

const MODES = ["kind", "residual", "intensity", "scan", "height"];
const OFF_TARGET = -32768;
const NEAR_PX = 8; // of the pointer, where a point is taken by it

const POINT_VERTEX = `
attribute uint extra; // from the lowest bit: 16 of residual, micrometres, 8 of intensity, 8 of scan
uniform float size, most;
uniform int mode;
uniform bool bare; // targets without their points
uniform vec2 range;
uniform vec3 other, target, scans[SCAN_COLOURS], stops[5];
uniform uint hidden[8]; // a bit for each scan
uniform vec4 section;
varying vec3 colour;
vec3 ramp(float value) {
  float at = clamp((value - range.x) / (range.y - range.x), 0.0, 1.0) * 4.0;
  int first = int(min(3.0, floor(at)));
  return mix(stops[first], stops[first + 1], at - float(first));
}
void main() {
  vec4 real = modelMatrix * vec4(position, 1.0);
  vec4 seen = viewMatrix * real;
  gl_Position = projectionMatrix * seen;
  gl_PointSize = clamp(size / -seen.z, 1.0, most);
  int residual = int(extra << 16u) >> 16;
  uint scan = extra >> 24u;
  bool on = residual > OFF_TARGET;
  colour = on ? target : other;
  if (mode == 1) colour = on ? ramp(float(residual)) : other;
  if (mode == 2) colour = ramp(float(extra >> 16u & 255u));
  if (mode == 3) colour = scans[scan % uint(SCAN_COLOURS)];
  if (mode == 4) colour = ramp(real.z);
  bool gone = (hidden[scan >> 5u] >> (scan & 31u) & 1u) == 1u;
  if (gone || dot(real.xyz, section.xyz) > section.w || (bare && on)) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
}`;
const POINT_FRAGMENT = `
varying vec3 colour;
void main() { gl_FragColor = vec4(colour, 1.0); }`;

const SCREEN_VERTEX = `
varying vec2 at;
void main() { at = position.xy * 0.5 + 0.5; gl_Position = vec4(position.xy, 0.0, 1.0); }`;
// Eye-dome lighting (Boucheny 2009): a pixel behind its neighbours is darker, which shows shape.
const SCREEN_FRAGMENT = `
uniform sampler2D picture, depths;
uniform vec2 pixel;
uniform vec3 ground;
uniform float near, far, strength;
varying vec2 at;
float logDepth(float d) { return log2(near * far / (far - d * (far - near))); }
void main() {
  float d = texture2D(depths, at).r;
  gl_FragDepth = d;
  if (d >= 1.0) { gl_FragColor = vec4(ground, 1.0); return; }
  float mine = logDepth(d), over = 0.0;
  for (int i = 0; i < 4; i++) {
    vec2 step = i < 2 ? vec2(float(i * 2 - 1), 0.0) : vec2(0.0, float(i * 2 - 5));
    float other = texture2D(depths, at + step * pixel).r;
    if (other < 1.0) over += max(0.0, mine - logDepth(other));
  }
  gl_FragColor = vec4(texture2D(picture, at).rgb * max(0.62, exp(-strength * over)), 1.0);
}`;

export class Cloud {
  constructor(renderer) {
    this.renderer = renderer;
    this.nodes = new Set(); // of points that were added, or of the tree
    this.list = []; // nodes that are drawn, in that order
    this.tree = null;
    this.scans = []; // names
    this.most = Infinity;
    this.moving = new Pace(...MOVING);
    this.resting = new Pace(...RESTING);
    this.shown = true;
    this.drawn = 0;
    this.loaded = 0;
    this.sketched = true;
    this.scene = new THREE.Scene();
    this.material = new THREE.ShaderMaterial({
      vertexShader: POINT_VERTEX,
      fragmentShader: POINT_FRAGMENT,
      defines: { SCAN_COLOURS: SCANS.length, OFF_TARGET },
      uniforms: {
        size: { value: 1 },
        most: { value: 1 },
        other: { value: plain(0x7d8b99) },
        target: { value: plain(0x0f8a6a) },
        scans: { value: SCANS.map(plain) },
        hidden: { value: new Uint32Array(8) },
        mode: { value: 0 },
        bare: { value: false },
        range: { value: new THREE.Vector2(0, 1) },
        stops: { value: stopsOf("height").map(plain) },
        section: { value: new THREE.Vector4(0, 0, 0, 1) },
      },
    });
    const depths = new THREE.DepthTexture(1, 1);
    this.picture = new THREE.WebGLRenderTarget(1, 1, {
      depthTexture: depths,
      minFilter: THREE.NearestFilter,
      magFilter: THREE.NearestFilter,
    });
    this.screen = screenOf(this.picture, depths);
    this.flat = new THREE.Camera();
  }

  /** Add points: xyz in steps of step_m from the origin, columns of their values, scan: index or a column. */
  add(xyz, { shade, residual, intensity, scan = 0 }, origin, step_m) {
    const count = xyz.length / 3;
    const places = Float32Array.from(xyz, (steps) => steps * step_m);
    const extra = new Uint32Array(count);
    for (let i = 0; i < count; i++) {
      const off = residual ? residual[i] : shade?.[i] ? 0 : OFF_TARGET;
      extra[i] = (off & 0xffff) | ((intensity ? intensity[i] : 0) << 16) | ((scan[i] ?? scan) << 24);
    }
    this.addNode(places, extra, origin);
  }

  /** Add points: places, metres from the origin, and what the shader reads of each. */
  addNode(places, extra, origin) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(places, 3));
    geometry.setAttribute("extra", new THREE.BufferAttribute(extra, 1));
    const points = new THREE.Points(geometry, this.material);
    points.position.fromArray(origin);
    points.updateMatrix();
    points.frustumCulled = false;
    points.visible = false;
    this.scene.add(points);
    const node = { points, count: extra.length, drawn: 0, box: new THREE.Box3().setFromArray(places).translate(points.position) };
    this.nodes.add(node);
    this.loaded += node.count;
    return node;
  }

  remove(node) {
    node.points.geometry.dispose();
    this.scene.remove(node.points);
    this.nodes.delete(node);
    this.loaded -= node.count;
  }

  /** Show the nodes of a tree instead of the points so far. */
  grow(tree) {
    for (const node of this.nodes) if (!tree.holds(node)) this.remove(node);
    this.tree = tree;
    this.scans = [];
    this.material.uniforms.hidden.value.fill(0);
  }

  /** Colour the points by their kind, residual, intensity, scan or height, over this range. */
  colourBy(mode, range) {
    const { uniforms } = this.material;
    uniforms.mode.value = MODES.indexOf(mode);
    uniforms.stops.value = stopsOf(mode).map(plain);
    if (range) uniforms.range.value.fromArray(range);
  }

  /** Leave out points beyond `at` along `way` (3,); all are shown without. */
  cut(way, at) {
    this.material.uniforms.section.value.set(...(way ?? [0, 0, 0]), way ? at : 1);
  }

  /** Leave out the points on targets, where maps stand for them. */
  bare(left) {
    this.material.uniforms.bare.value = left;
  }

  /** Index of a scan, added if it is new. */
  scan(name) {
    if (!this.scans.includes(name)) this.scans.push(name);
    return this.scans.indexOf(name);
  }

  showScan(name, shown) {
    const index = this.scans.indexOf(name);
    if (index < 0) return;
    const hidden = this.material.uniforms.hidden.value;
    if (shown) hidden[index >> 5] &= ~(1 << (index & 31));
    else hidden[index >> 5] |= 1 << (index & 31);
  }

  /** Box of all points. */
  box() {
    return this.tree ? this.tree.bounds.clone() : [...this.nodes].reduce((all, { box }) => all.union(box), new THREE.Box3());
  }

  /** The shown point nearest to the eye within a few pixels of a place on the screen; null if there is none. */
  nearest(x, y, camera, [width, height]) {
    const seen = matrixOf(camera);
    const { section: { value: section }, hidden: { value: hidden } } = this.material.uniforms;
    const about = new THREE.Matrix4().makeScale(width / 2 / NEAR_PX, height / 2 / NEAR_PX, 1).multiply(new THREE.Matrix4().makeTranslation(-x, -y, 0));
    const beam = new THREE.Frustum().setFromProjectionMatrix(about.multiply(seen));
    let best = null;
    let least = Infinity;
    for (const { points, box } of this.shown ? this.list : []) {
      if (!beam.intersectsBox(box)) continue;
      const { x: ox, y: oy, z: oz } = points.position;
      const places = points.geometry.getAttribute("position").array;
      const extra = points.geometry.getAttribute("extra").array;
      const m = new THREE.Matrix4().multiplyMatrices(seen, points.matrix).elements;
      for (let i = 0; i < places.length; i += 3) {
        const [a, b, c] = [places[i], places[i + 1], places[i + 2]];
        const w = m[3] * a + m[7] * b + m[11] * c + m[15];
        if (w <= 0) continue;
        const dx = ((m[0] * a + m[4] * b + m[8] * c + m[12]) / w - x) * width / 2;
        const dy = ((m[1] * a + m[5] * b + m[9] * c + m[13]) / w - y) * height / 2;
        const apart = dx * dx + dy * dy;
        if (apart > NEAR_PX * NEAR_PX) continue;
        const worth = w * (1 + 0.02 * apart / NEAR_PX / NEAR_PX);
        if (worth >= least) continue;
        const scan = extra[i / 3] >>> 24;
        if ((hidden[scan >> 5] >>> (scan & 31)) & 1) continue;
        const at = [a + ox, b + oy, c + oz];
        if (at[0] * section.x + at[1] * section.y + at[2] * section.z > section.w) continue;
        [best, least] = [at, worth];
      }
    }
    return best;
  }

  resize() {
    const size = this.renderer.getDrawingBufferSize(new THREE.Vector2());
    this.picture.setSize(size.x, size.y);
    this.screen.material.uniforms.pixel.value.set(1 / size.x, 1 / size.y);
    this.height = size.y;
  }

  /** Draw a budget of points straight to the screen, while the camera moves. */
  sketch(camera, now) {
    this.resting.stop();
    this.moving.tick(now);
    this.renderer.clear();
    this.#begin(camera);
    this.#drawNext(camera, this.moving.budget);
    this.sketched = true;
  }

  /** Draw the next budget into the picture, all anew after a sketch, and show it; whether more is to come. */
  refine(camera, now) {
    this.moving.stop();
    this.resting.tick(now);
    this.renderer.setRenderTarget(this.picture);
    if (this.sketched) {
      this.renderer.clear();
      this.#begin(camera);
    } else if (this.tree?.arrived) this.list = this.tree.choose(camera, this.height);
    const more = this.#drawNext(camera, this.resting.budget);
    this.sketched = false;
    this.renderer.setRenderTarget(null);
    const { near, far } = this.screen.material.uniforms;
    near.value = camera.near;
    far.value = camera.far;
    this.renderer.render(this.screen, this.flat);
    return more;
  }

  /** Nothing more to draw. */
  rest() {
    this.resting.stop();
  }

  dispose() {
    this.tree?.dispose();
    for (const node of this.nodes) this.remove(node);
    this.material.dispose();
    this.picture.depthTexture.dispose();
    this.picture.dispose();
    this.screen.geometry.dispose();
    this.screen.material.dispose();
  }

  /** Choose the nodes in view, of which nothing is drawn yet. */
  #begin(camera) {
    const frustum = new THREE.Frustum().setFromProjectionMatrix(matrixOf(camera));
    this.list = this.tree ? this.tree.choose(camera, this.height) : [...this.nodes].filter(({ box }) => frustum.intersectsBox(box));
    for (const node of this.list) node.drawn = 0;
    this.drawn = 0;
    const { size, most } = this.material.uniforms;
    size.value = (POINT_M * this.height) / Math.tan((camera.fov * Math.PI) / 360) / 2;
    most.value = MOST_PX * this.renderer.getPixelRatio();
  }

  /** Draw the next budget; whether some points are left. */
  #drawNext(camera, budget) {
    let left = Math.ceil(Math.min(budget, this.most));
    const begun = this.shown ? this.list.filter((node) => node.drawn < node.count) : [];
    const now = [];
    for (const node of begun) {
      if (left <= 0) break;
      const count = Math.min(left, node.count - node.drawn);
      node.points.geometry.setDrawRange(node.drawn, count);
      node.points.visible = true;
      node.drawn += count;
      left -= count;
      now.push(node);
      this.drawn += count;
    }
    if (now.length) this.renderer.render(this.scene, camera);
    for (const { points } of now) points.visible = false;
    return begun.some((node) => node.drawn < node.count);
  }
}

function matrixOf(camera) {
  return new THREE.Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
}

function screenOf(picture, depths) {
  const material = new THREE.ShaderMaterial({
    vertexShader: SCREEN_VERTEX,
    fragmentShader: SCREEN_FRAGMENT,
    depthFunc: THREE.AlwaysDepth,
    uniforms: {
      picture: { value: picture.texture },
      depths: { value: depths },
      pixel: { value: new THREE.Vector2() },
      ground: { value: plain(GROUND) },
      near: { value: 1 },
      far: { value: 2 },
      strength: { value: 1 },
    },
  });
  const corners = new Float32Array([-1, -1, 0, 3, -1, 0, -1, 3, 0]);
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(corners, 3));
  const mesh = new THREE.Mesh(geometry, material);
  mesh.frustumCulled = false;
  return mesh;
}

/** A colour as it stands on the screen: these shaders convert none. */
function plain(hex) {
  return new THREE.Color().setHex(hex, THREE.LinearSRGBColorSpace);
}


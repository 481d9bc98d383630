// The points, drawn a budget at a time into a picture of their own, which grows while the camera rests.
// Every prefix of a group is a fair sample of it, so that the first budget shows the whole.
import * as THREE from "three";
import { ofScan, stopsOf } from "./colours.js";
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
attribute vec4 place;
attribute vec2 extra; // residual, micrometres, and intensity, 0 to 255
uniform float size, most;
uniform int mode;
uniform bool bare; // targets without their points
uniform vec2 range;
uniform vec3 other, target, own, stops[5];
uniform vec4 section;
varying vec3 colour;
vec3 ramp(float value) {
  float at = clamp((value - range.x) / (range.y - range.x), 0.0, 1.0) * 4.0;
  int first = int(min(3.0, floor(at)));
  return mix(stops[first], stops[first + 1], at - float(first));
}
void main() {
  vec4 real = modelMatrix * vec4(place.xyz, 1.0);
  vec4 seen = viewMatrix * real;
  gl_Position = projectionMatrix * seen;
  gl_PointSize = clamp(size / -seen.z, 1.0, most);
  bool on = place.w > 0.5;
  colour = on ? target : other;
  if (mode == 1) colour = extra.x < -32767.5 ? other : ramp(extra.x);
  if (mode == 2) colour = ramp(extra.y);
  if (mode == 3) colour = own;
  if (mode == 4) colour = ramp(real.z);
  if (dot(real.xyz, section.xyz) > section.w || (bare && on)) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
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
    this.groups = new Map();
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
      uniforms: {
        size: { value: 1 },
        most: { value: 1 },
        other: { value: plain(0x7d8b99) },
        target: { value: plain(0x0f8a6a) },
        own: { value: plain(0) },
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

  add(xyz, { shade, residual, intensity }, origin, step_m, name) {
    const count = xyz.length / 3;
    const place = new xyz.constructor(4 * count);
    const extra = new Int16Array(2 * count);
    for (let i = 0, from = 0, to = 0; i < count; i++, to += 4, from += 3) {
      place[to] = xyz[from];
      place[to + 1] = xyz[from + 1];
      place[to + 2] = xyz[from + 2];
      place[to + 3] = shade ? shade[i] : 0;
      extra[2 * i] = residual ? residual[i] : OFF_TARGET;
      extra[2 * i + 1] = intensity ? intensity[i] : 0;
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("place", new THREE.BufferAttribute(place, 4));
    geometry.setAttribute("extra", new THREE.BufferAttribute(extra, 2));
    const points = new THREE.Points(geometry, this.material);
    points.position.fromArray(origin);
    points.scale.setScalar(step_m);
    points.frustumCulled = false;
    points.visible = false;
    this.scene.add(points);
    const box = boxOf(place).applyMatrix4(points.matrix.compose(points.position, points.quaternion, points.scale));
    const group = this.groups.get(name) ?? { blocks: [], count: 0, drawn: 0, box: new THREE.Box3(), shown: true, own: plain(ofScan(this.groups.size)) };
    group.blocks.push({ points, count });
    group.count += count;
    group.box.union(box);
    this.groups.set(name, group);
    this.loaded += count;
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

  showScan(name, shown) {
    if (this.groups.has(name)) this.groups.get(name).shown = shown;
  }

  /** Box of all points. */
  box() {
    return [...this.groups.values()].reduce((all, { box }) => all.union(box), new THREE.Box3());
  }

  /** The shown point nearest to the eye within a few pixels of a place on the screen; null if there is none. */
  nearest(x, y, camera, [width, height]) {
    const seen = new THREE.Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
    const section = this.material.uniforms.section.value;
    let best = null;
    let least = Infinity;
    for (const group of this.shown ? this.#seen(camera) : []) for (const { points } of group.blocks) {
      const { position, scale } = points;
      const place = points.geometry.getAttribute("place").array;
      const m = new THREE.Matrix4().multiplyMatrices(seen, points.matrix).elements;
      for (let i = 0; i < place.length; i += 4) {
        const [a, b, c] = [place[i], place[i + 1], place[i + 2]];
        const w = m[3] * a + m[7] * b + m[11] * c + m[15];
        if (w <= 0) continue;
        const dx = ((m[0] * a + m[4] * b + m[8] * c + m[12]) / w - x) * width / 2;
        const dy = ((m[1] * a + m[5] * b + m[9] * c + m[13]) / w - y) * height / 2;
        const apart = dx * dx + dy * dy;
        if (apart > NEAR_PX * NEAR_PX) continue;
        const worth = w * (1 + 0.02 * apart / NEAR_PX / NEAR_PX);
        if (worth >= least) continue;
        const at = [a * scale.x + position.x, b * scale.x + position.y, c * scale.x + position.z];
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
    this.#drawNext(camera, this.moving.budget, true);
    this.sketched = true;
  }

  /** Draw the next budget into the picture, all anew after a sketch, and show it; whether more is to come. */
  refine(camera, now) {
    this.moving.stop();
    this.resting.tick(now);
    this.renderer.setRenderTarget(this.picture);
    if (this.sketched) this.renderer.clear();
    const more = this.#drawNext(camera, this.resting.budget, this.sketched);
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
    for (const { blocks } of this.groups.values()) for (const { points } of blocks) points.geometry.dispose();
    this.material.dispose();
    this.picture.depthTexture.dispose();
    this.picture.dispose();
    this.screen.geometry.dispose();
    this.screen.material.dispose();
  }

  #seen(camera) {
    const matrix = new THREE.Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
    const frustum = new THREE.Frustum().setFromProjectionMatrix(matrix);
    return [...this.groups.values()].filter((group) => group.shown && frustum.intersectsBox(group.box));
  }

  /** Draw the next budget, a like share of every group in view; whether some points are left. */
  #drawNext(camera, budget, anew) {
    const seen = this.shown ? this.#seen(camera) : [];
    if (anew) {
      this.drawn = 0;
      for (const group of this.groups.values()) group.drawn = 0;
    }
    const uniforms = this.material.uniforms;
    uniforms.size.value = (POINT_M * this.height) / Math.tan((camera.fov * Math.PI) / 360) / 2;
    uniforms.most.value = MOST_PX * this.renderer.getPixelRatio();
    const total = seen.reduce((sum, group) => sum + group.count, 0);
    const share = Math.min(1, Math.min(budget, this.most) / Math.max(1, total));
    for (const group of seen) this.drawn += this.#draw(group, Math.ceil(share * group.count), camera);
    return seen.some((group) => group.drawn < group.count);
  }

  #draw(group, most, camera) {
    const end = Math.min(group.count, group.drawn + most);
    let first = 0;
    for (const { points, count } of group.blocks) {
      const from = Math.max(group.drawn, first) - first;
      const to = Math.min(end, first + count) - first;
      points.visible = to > from;
      if (points.visible) points.geometry.setDrawRange(from, to - from);
      first += count;
    }
    this.material.uniforms.own.value = group.own;
    this.renderer.render(this.scene, camera);
    for (const { points } of group.blocks) points.visible = false;
    const done = end - group.drawn;
    group.drawn = end;
    return done;
  }
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

function boxOf(place) {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  for (let i = 0; i < place.length; i++) {
    const axis = i & 3;
    if (axis === 3) continue;
    if (place[i] < low[axis]) low[axis] = place[i];
    if (place[i] > high[axis]) high[axis] = place[i];
  }
  return new THREE.Box3(new THREE.Vector3(...low), new THREE.Vector3(...high));
}

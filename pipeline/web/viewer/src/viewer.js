// The 3D view of a measurement: its point cloud, and over it wheels, normals and the vehicle's frame.
// Right-handed vehicle frame, metres: x forward, y left, z up.
import * as THREE from "three";
import { Cloud, GROUND } from "./cloud.js";
import { roundUp } from "./colours.js";
import { Labels } from "./labels.js";
import { Model } from "./model.js";
import { Pilot } from "./pilot.js";
import { Ruler } from "./ruler.js";
import { adoptStyle } from "./style.js";
import { Toolbar } from "./toolbar.js";
import { Tree } from "./tree.js";
import { ENGLISH } from "./words.js";

const COARSE = 0.6;
const AXES = ["x", "y", "z"];
const COUNT_MS = 500; // between two counts of the points in view
const SOFTWARE = /swiftshader|llvmpipe|software|basic render/i;

/** Show `scene` (wheelplane/scene/1) in `element`; without WebGL, a sentence in its place. */
export function mount(element, scene, { onWheel = () => {}, words = {}, controls = true } = {}) {
  const texts = { ...ENGLISH, ...words };
  adoptStyle();
  const root = document.createElement("div");
  root.className = "w3d";
  element.replaceChildren(root);
  try {
    return new Viewer(root, scene, onWheel, texts, controls);
  } catch {
    root.classList.add("w3d-none");
    root.textContent = texts.no_webgl;
    return absent(root);
  }
}

class Viewer {
  constructor(root, scene, onWheel, words, controls) {
    this.root = root;
    this.onWheel = onWheel;
    this.words = words;
    this.about = { residual_um: 0, intensity: null };
    this.colour = "kind";
    this.coarse = false;
    this.canvas = document.createElement("canvas");
    this.renderer = new THREE.WebGLRenderer({ canvas: this.canvas, context: contextOf(this.canvas) });
    this.renderer.autoClear = false;
    this.renderer.setClearColor(GROUND);
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute("role", "application");
    this.canvas.setAttribute("aria-label", words.canvas);
    root.append(this.canvas);

    this.model = new Model(scene);
    this.pilot = new Pilot(this.canvas, this.model.bounds, () => this.#wake());
    this.cloud = new Cloud(this.renderer);
    this.labels = new Labels(root, this.model, (name) => this.#choose(name));
    this.ruler = new Ruler(this.model, words, (value, digits) => this.number(value, digits), () => this.#measure());
    if (controls) this.toolbar = new Toolbar(root, this, this.model.layers(scene), words);
    if (scene.cloud) this.addCloud(scene.cloud);

    this.pilot.onTap = (x, y) => this.#tap(x, y);
    this.observer = new ResizeObserver(() => this.#resize());
    this.observer.observe(root);
    this.canvas.addEventListener("webglcontextrestored", () => this.#wake());
    this.#resize();
    this.pilot.look("iso", false);
  }

  /** More points: xyz Float32Array in metres from `origin`, or Int16Array in steps of `step_m` from it.
   *  shade: 1 where a point is on a target; residual: its distance from the plane, micrometres; intensity:
   *  0 to 255. Any prefix of a group's points should be a fair sample. */
  addPoints(xyz, shade = null, { origin = [0, 0, 0], step_m = 1, group = "", residual = null, intensity = null } = {}) {
    const scan = group ? this.#addScan(group) : 0;
    this.cloud.add(xyz, { shade, residual, intensity, scan }, origin, step_m);
    this.toolbar?.show("cloud");
    this.#offer();
    this.#wake();
  }

  /** What the points are a sample of. count: of these points; total: of the scans; residual_um: half the
   *  range of the residuals; intensity: values of 0 and 255. */
  describe({ count, total, residual_um = 0, intensity = null }) {
    Object.assign(this.about, { residual_um, intensity });
    if (total !== undefined) this.#count("shown_of", { count, total });
    this.#offer();
  }

  /** Show the nodes of a tree in place of the points so far, once the first is here; head and load as
   *  Tree takes them, onFailure is called with the error if a node cannot be loaded. */
  async openTree(head, load, onFailure = () => {}) {
    if (!head.count) return;
    const tree = new Tree(head, load, this.cloud, this.pilot.controls.target, () => this.#request(), onFailure);
    await tree.begin();
    if (this.disposed) return;
    this.head = head;
    this.cloud.grow(tree);
    this.toolbar?.tools.forgetScans();
    for (const name of head.groups) this.#addScan(name);
    Object.assign(this.about, { residual_um: head.residual_um, intensity: head.intensity });
    this.toolbar?.show("cloud");
    this.#offer();
    this.#wake();
  }

  /** The points that a scene holds. */
  addCloud(cloud) {
    const { positions, origin, step_m, class: classes, residual, residual_um, scans } = cloud;
    const xyz = new Int16Array(bytes(positions).buffer);
    const shade = classes ? bytes(classes) : null;
    const off = residual ? micrometres(bytes(residual), residual_um) : null;
    const scan = new Uint8Array(xyz.length / 3);
    let first = 0;
    for (const { name, count } of scans ?? []) scan.fill(this.#addScan(name), first, (first += count));
    const own = mixed({ xyz, shade, residual: off, scan });
    this.cloud.add(own.xyz, own, origin, step_m);
    this.describe(cloud);
    this.#wake();
  }

  /** At most this many points a frame; fewer where the machine is slow. */
  setBudget(points) {
    this.cloud.most = Math.max(1, Math.floor(points));
    this.#wake();
  }

  /** Colour the points by kind, residual, intensity, scan or height. */
  colourBy(colour) {
    this.colour = colour;
    this.#showScale();
    this.#wake();
  }

  showScan(name, shown) {
    this.cloud.showScan(name, shown);
    this.#wake();
  }

  /** Leave out what lies beyond a share of the vehicle's extent along an axis, or before it if `flipped`;
   *  the position, metres, or null without an axis. */
  cut(axis, share, flipped) {
    const index = AXES.indexOf(axis);
    this.renderer.clippingPlanes = [];
    this.cloud.cut(null);
    this.labels.cut = null;
    this.#wake();
    if (index < 0) return null;
    const { min, max } = this.#extent();
    const at = min.getComponent(index) + share * (max.getComponent(index) - min.getComponent(index));
    const sign = flipped ? -1 : 1;
    const way = AXES.map((_, i) => (i === index ? sign : 0));
    this.cloud.cut(way, sign * at);
    const kept = new THREE.Plane(new THREE.Vector3(...way).negate(), sign * at);
    this.renderer.clippingPlanes = [kept];
    this.labels.cut = kept;
    return at;
  }

  /** A number as it is written in the language of the page. */
  number(value, digits) {
    return value.toLocaleString(document.documentElement.lang || undefined, { minimumFractionDigits: digits, maximumFractionDigits: digits });
  }

  /** Place of a point (3,), metres, in the picture, pixels from its upper left corner. */
  screenOf(place) {
    const { x, y } = new THREE.Vector3(...place).project(this.pilot.camera);
    return [((x + 1) / 2) * this.root.clientWidth, ((1 - y) / 2) * this.root.clientHeight];
  }

  redraw() {
    this.#wake();
  }

  setLayer(name, shown) {
    if (name === "form") {
      this.cloud.bare(shown);
      this.formShown = shown;
    }
    if (name === "cloud") this.cloud.shown = shown;
    else if (name === "labels") this.labels.show(shown);
    else this.model.show(name, shown);
    this.toolbar?.mark(name, shown);
    this.#showScale();
    this.#wake();
  }

  look(view) {
    this.pilot.look(view);
  }

  focus(name) {
    const wheel = this.model.wheel(name);
    if (wheel) this.pilot.face(wheel.centre, wheel.normal);
    this.mark(name);
  }

  /** Show which wheel is chosen, and leave the camera where it is. */
  mark(name) {
    this.model.mark(name);
    this.labels.mark(name);
    this.#wake();
  }

  /** Write other angles at the wheels, as in another unit. */
  rewrite(texts) {
    this.labels.rewrite(texts);
    this.#wake();
  }

  stats() {
    const { moving, drawn, loaded, tree } = this.cloud;
    return { fps: moving.fps, drawn, loaded, ...tree?.counts(this.pilot.camera) };
  }

  dispose() {
    this.disposed = true;
    cancelAnimationFrame(this.frame);
    this.observer.disconnect();
    this.pilot.dispose();
    this.cloud.dispose();
    this.ruler.dispose();
    this.model.dispose();
    this.renderer.dispose();
    this.root.remove();
  }

  #choose(name) {
    this.mark(name);
    this.onWheel(name);
  }

  /** Offer the colours that the points have. */
  #offer() {
    const { residual_um, intensity } = this.about;
    const has = { kind: true, residual: residual_um > 0, intensity, scan: this.cloud.scans.length > 1, height: this.cloud.loaded > 0 };
    this.toolbar?.tools.offer(Object.keys(has).filter((name) => has[name]));
    this.#showScale();
  }

  /** Show the scale of the maps, where they are seen, or that of the points. */
  #showScale() {
    const { words, about, model } = this;
    const box = this.cloud.box();
    const ranges = {
      residual: [-roundUp(about.residual_um || 1), roundUp(about.residual_um || 1)],
      intensity: [0, 255],
      height: box.isEmpty() ? [0, 1] : [box.min.z, box.max.z],
    };
    const range = ranges[this.colour];
    this.cloud.colourBy(this.colour, range);
    const show = (...given) => this.toolbar?.scale.show(...given);
    const ends = ([low, high], digits) => [low, (low + high) / 2, high].map((value) => this.number(value + 0, digits));
    if (this.formShown) {
      const { range_mm: most, width_mm, u_mm } = model.form;
      const parts = { width: this.number(width_mm, 0), u: this.number(u_mm, 3) };
      show("residual", words.scale_form.replace(/\{(\w+)\}/g, (_, part) => parts[part]), ends([-most, most], 3));
    } else if (this.colour === "residual") show("residual", words.scale_residual, ends(range.map((um) => um / 1000), 2));
    else if (this.colour === "intensity") show("intensity", words.scale_intensity, ends(about.intensity ?? [0, 1], 2));
    else if (this.colour === "height") show("height", words.scale_height, ends(range, 2));
    else show();
  }

  #extent() {
    const box = this.cloud.box();
    const { center, radius } = this.model.bounds;
    return box.isEmpty() ? new THREE.Box3(center.clone().subScalar(radius), center.clone().addScalar(radius)) : box;
  }

  #measure() {
    this.toolbar?.tools.showMeasured(this.ruler.read(), this.ruler.chosen);
    this.#wake();
  }

  #tap(x, y) {
    if (this.ruler.active) {
      const size = [this.root.clientWidth, this.root.clientHeight];
      return this.ruler.take(x, y, this.pilot.camera, size, () => this.cloud.nearest(x, y, this.pilot.camera, size));
    }
    const name = this.model.wheelAt(x, y, this.pilot.camera);
    if (name) this.#choose(name);
  }

  #resize() {
    const { clientWidth: width, clientHeight: height } = this.root;
    if (!width || !height) return;
    this.#setSize(this.coarse);
    this.model.resize(width, height);
    this.pilot.resize(width, height, ...(this.toolbar?.covered(this.root) ?? [0, 0]));
    this.#wake();
  }

  /** coarse: fewer pixels and thin lines, for a slow machine while the camera moves. */
  #setSize(coarse) {
    this.coarse = coarse;
    this.model.setCoarse(coarse);
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2) * (coarse ? COARSE : 1));
    this.renderer.setSize(this.root.clientWidth, this.root.clientHeight, false);
    this.cloud.resize();
  }

  #wake() {
    this.stale = true;
    this.#request();
  }

  #request() {
    if (!this.disposed) this.frame ??= requestAnimationFrame((now) => this.#draw(now));
  }

  #addScan(name) {
    this.toolbar?.tools.addScan(name);
    return this.cloud.scan(name);
  }

  #count(word, counts) {
    this.toolbar?.say(this.words[word].replace(/\{(\w+)\}/g, (_, part) => this.number(counts[part], 0)));
  }

  /** Say how many of the points in view are shown, at intervals while they come. */
  #countView(now, isLast) {
    if (!this.head || (!isLast && now - (this.counted ?? 0) < COUNT_MS)) return;
    this.counted = now;
    const { shown, view } = this.cloud.tree.counts(this.pilot.camera);
    this.#count("shown_view", { count: shown, view, near: this.head.count, total: this.head.total });
  }

  /** One frame; another follows while the camera moves, and until every point is drawn. */
  #draw(now) {
    this.frame = null;
    const moving = this.pilot.advance(now);
    const sketch = this.stale || moving;
    this.stale = false;
    const coarse = sketch && this.cloud.moving.slow;
    if (coarse !== this.coarse) this.#setSize(coarse);
    if (sketch) this.cloud.sketch(this.pilot.camera, now);
    const more = sketch || this.cloud.refine(this.pilot.camera, now);
    this.renderer.render(this.model.scene, this.pilot.camera);
    this.labels.place(this.pilot.camera, this.root, this.toolbar?.bars ?? []);
    if (!sketch) this.#countView(now, !more);
    if (more || this.stale) this.#request();
    else this.cloud.rest();
  }
}

/** An opaque WebGL2 context, whose edges are smoothed unless the processor has to draw them. */
function contextOf(canvas) {
  const probe = document.createElement("canvas").getContext("webgl2");
  const name = probe.getExtension("WEBGL_debug_renderer_info")?.UNMASKED_RENDERER_WEBGL ?? probe.RENDERER;
  const slow = SOFTWARE.test(probe.getParameter(name));
  probe.getExtension("WEBGL_lose_context")?.loseContext();
  const context = canvas.getContext("webgl2", { alpha: false, antialias: !slow, powerPreference: "high-performance" });
  if (!context) throw new Error("no WebGL");
  return context;
}

function bytes(base64) {
  return Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
}

/** Distances, micrometres, that signed bytes state in 127 steps of their range; -128: none. */
function micrometres(steps, range_um) {
  return Int16Array.from(new Int8Array(steps.buffer), (step) => (step === -128 ? -32768 : Math.round((step * range_um) / 127)));
}

/** The same points in an order whose every prefix is a fair sample: one golden stride after the other. */
function mixed({ xyz, ...columns }) {
  const count = xyz.length / 3;
  let stride = Math.max(1, Math.round(0.618034 * count));
  while (divisor(stride, count) > 1) stride++;
  const reorder = (column, size) => {
    if (!column) return null;
    const other = new column.constructor(column.length);
    for (let to = 0, from = 0; to < count; to++, from = (from + stride) % count)
      for (let k = 0; k < size; k++) other[size * to + k] = column[size * from + k];
    return other;
  };
  return { xyz: reorder(xyz, 3), ...Object.fromEntries(Object.entries(columns).map(([name, column]) => [name, reorder(column, 1)])) };
}

function divisor(a, b) {
  return b ? divisor(b, a % b) : a;
}

/** What stands in for a viewer where there is no WebGL: the same methods, which do nothing. */
function absent(root) {
  const nothing = () => {};
  const methods = ["addPoints", "addCloud", "openTree", "describe", "colourBy", "showScan", "cut", "setBudget", "setLayer", "look", "focus", "mark", "rewrite"];
  return {
    ...Object.fromEntries(methods.map((name) => [name, nothing])),
    stats: () => ({ fps: 0, drawn: 0, loaded: 0 }),
    dispose: () => root.remove(),
  };
}

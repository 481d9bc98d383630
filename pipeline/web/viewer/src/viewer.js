// The 3D view of a measurement: its point cloud, and over it wheels, normals and the vehicle's frame.
// Right-handed vehicle frame, metres: x forward, y left, z up.
import * as THREE from "three";
import { Cloud, GROUND } from "./cloud.js";
import { Labels } from "./labels.js";
import { Model } from "./model.js";
import { Pilot } from "./pilot.js";
import { adoptStyle } from "./style.js";
import { Toolbar } from "./toolbar.js";
import { ENGLISH } from "./words.js";

const COARSE = 0.6;
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
    this.labels = new Labels(root, this.model.labels(), (name) => this.#choose(name));
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
   *  shade: 1 where a point is on a target. Any prefix of a group's points should be a fair sample. */
  addPoints(xyz, shade = null, { origin = [0, 0, 0], step_m = 1, group = "" } = {}) {
    this.cloud.add(xyz, shade, origin, step_m, group);
    if (this.toolbar) this.toolbar.show("cloud");
    this.#wake();
  }

  /** The points that a scene holds. */
  addCloud({ positions, origin, step_m, class: classes }) {
    const { xyz, shade } = mixed(new Int16Array(bytes(positions).buffer), classes ? bytes(classes) : null);
    this.addPoints(xyz, shade, { origin, step_m });
  }

  /** At most this many points a frame; fewer where the machine is slow. */
  setBudget(points) {
    this.cloud.most = Math.max(1, Math.floor(points));
    this.#wake();
  }

  setLayer(name, shown) {
    if (name === "cloud") this.cloud.shown = shown;
    else if (name === "labels") this.labels.show(shown);
    else this.model.show(name, shown);
    this.toolbar?.mark(name, shown);
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

  stats() {
    return { fps: this.cloud.moving.fps, drawn: this.cloud.drawn, loaded: this.cloud.loaded };
  }

  dispose() {
    cancelAnimationFrame(this.frame);
    this.observer.disconnect();
    this.pilot.dispose();
    this.cloud.dispose();
    this.model.dispose();
    this.renderer.dispose();
    this.root.remove();
  }

  #choose(name) {
    this.mark(name);
    this.onWheel(name);
  }

  #tap(x, y) {
    const name = this.model.wheelAt(x, y, this.pilot.camera);
    if (name) this.#choose(name);
  }

  #resize() {
    const { clientWidth: width, clientHeight: height } = this.root;
    if (!width || !height) return;
    this.#setSize(this.coarse);
    this.model.resize(width, height);
    this.pilot.resize(width, height);
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
    this.frame ??= requestAnimationFrame((now) => this.#draw(now));
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
    if (more || this.stale) this.frame ??= requestAnimationFrame((t) => this.#draw(t));
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

/** The same points in an order whose every prefix is a fair sample: one golden stride after the other. */
function mixed(xyz, shade) {
  const count = xyz.length / 3;
  let stride = Math.max(1, Math.round(0.618034 * count));
  while (divisor(stride, count) > 1) stride++;
  const order = { xyz: new Int16Array(xyz.length), shade: shade && new Uint8Array(count) };
  for (let to = 0, from = 0; to < count; to++, from = (from + stride) % count) {
    order.xyz.set(xyz.subarray(3 * from, 3 * from + 3), 3 * to);
    if (shade) order.shade[to] = shade[from];
  }
  return order;
}

function divisor(a, b) {
  return b ? divisor(b, a % b) : a;
}

/** What stands in for a viewer where there is no WebGL: the same methods, which do nothing. */
function absent(root) {
  const nothing = () => {};
  const methods = ["addPoints", "addCloud", "setBudget", "setLayer", "look", "focus", "mark"];
  return {
    ...Object.fromEntries(methods.map((name) => [name, nothing])),
    stats: () => ({ fps: 0, drawn: 0, loaded: 0 }),
    dispose: () => root.remove(),
  };
}

// The camera and what moves it: mouse, touch, keys, and the named views.
import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";

const FIELD = 35; // degrees, upright
const TURN = Math.PI / 24; // a key press
const ZOOM = 1.15;
const GLIDE_MS = 350;
const NEARNESS = 0.78; // a vehicle does not fill the ball about it
const LEAST_CLEAR = 0.5; // of the height: a vehicle is not shown smaller for what covers the rest
const TAP_PX = 5;
const UP = new THREE.Vector3(0, 0, 1);
const FROM = {
  front: [1, 0, 0.08],
  rear: [-1, 0, 0.08],
  left: [0, 1, 0.08],
  right: [0, -1, 0.08],
  top: [-0.001, 0, 1], // forward is up on the screen
  iso: [0.75, 0.8, 0.55],
};

export class Pilot {
  constructor(canvas, bounds, onMove) {
    this.canvas = canvas;
    this.bounds = bounds;
    this.onMove = onMove;
    this.onTap = () => {};
    this.camera = new THREE.PerspectiveCamera(FIELD, 1, 0.02, 100);
    this.camera.up.copy(UP);
    this.clear = 1;
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.zoomToCursor = true;
    this.controls.minDistance = 0.05;
    this.controls.maxDistance = 12 * bounds.radius;
    this.controls.addEventListener("change", onMove);
    this.listeners = [
      ["keydown", (event) => this.#key(event)],
      ["pointerdown", (event) => this.#press(event)],
      ["pointerup", (event) => this.#release(event)],
    ];
    for (const [name, listener] of this.listeners) canvas.addEventListener(name, listener);
  }

  look(view, glide = true) {
    const from = new THREE.Vector3(...(FROM[view] ?? FROM.iso)).normalize();
    const half = Math.min(FIELD * this.clear, FIELD * this.camera.aspect) * Math.PI / 360;
    this.view = view;
    this.#go(this.bounds.center.clone(), from.multiplyScalar(NEARNESS * this.bounds.radius / Math.sin(half)), glide);
  }

  /** Stand before a wheel, on its outer side. */
  face(centre, normal) {
    const from = new THREE.Vector3(...normal).addScaledVector(UP, 0.15).normalize();
    this.view = null;
    this.#go(new THREE.Vector3(...centre), from.multiplyScalar(1.6), true);
  }

  /** above, below: height of what covers the picture there; the vehicle is shown between. */
  resize(width, height, above, below) {
    this.clear = Math.max(LEAST_CLEAR, 1 - (above + below) / height);
    this.camera.setViewOffset(width, height, 0, (below - above) / 2, width, height);
    if (this.view) this.look(this.view, false);
  }

  /** Move on to time `now` (ms); whether the camera is gliding. */
  advance(now) {
    if (this.glide) {
      this.glide.start ??= now;
      const share = Math.min(1, (now - this.glide.start) / GLIDE_MS);
      const eased = share * share * (3 - 2 * share);
      const { from, to } = this.glide;
      const target = from.target.clone().lerp(to.target, eased);
      const length = from.offset.length() ** (1 - eased) * to.offset.length() ** eased;
      const way = slerp(from.offset, to.offset, eased);
      this.controls.target.copy(target);
      this.camera.position.copy(target).addScaledVector(way, length);
      if (share === 1) this.glide = null;
    }
    this.controls.update();
    this.camera.updateMatrixWorld();
    const { center, radius } = this.bounds;
    const distance = this.camera.position.distanceTo(center);
    this.camera.near = Math.max(0.02, 0.02 * (distance - radius), 0.002 * distance);
    this.camera.far = distance + 6 * radius;
    this.camera.updateProjectionMatrix();
    return this.glide !== null && this.glide !== undefined;
  }

  dispose() {
    this.controls.dispose();
    for (const [name, listener] of this.listeners) this.canvas.removeEventListener(name, listener);
  }

  #go(target, offset, glide) {
    const still = window.matchMedia("(prefers-reduced-motion: reduce)").matches;
    if (glide && !still) {
      const from = this.camera.position.clone().sub(this.controls.target);
      this.glide = { from: { target: this.controls.target.clone(), offset: from }, to: { target, offset } };
    } else {
      this.glide = null;
      this.controls.target.copy(target);
      this.camera.position.copy(target).add(offset);
      this.controls.update();
    }
    this.onMove();
  }

  #key(event) {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const act = {
      ArrowLeft: () => this.#turn(-TURN, 0),
      ArrowRight: () => this.#turn(TURN, 0),
      ArrowUp: () => this.#turn(0, TURN),
      ArrowDown: () => this.#turn(0, -TURN),
      "+": () => this.#zoom(1 / ZOOM),
      "=": () => this.#zoom(1 / ZOOM),
      "-": () => this.#zoom(ZOOM),
      Home: () => this.look("iso"),
    }[event.key];
    if (!act) return;
    event.preventDefault();
    act();
  }

  #turn(around, above) {
    const offset = this.camera.position.clone().sub(this.controls.target);
    const level = Math.hypot(offset.x, offset.y);
    const height = Math.atan2(offset.z, level) + above;
    const bound = Math.max(-1.55, Math.min(1.55, height));
    const heading = Math.atan2(offset.y, offset.x) + around;
    const length = offset.length();
    offset.set(Math.cos(heading) * Math.cos(bound), Math.sin(heading) * Math.cos(bound), Math.sin(bound));
    this.#moveTo(offset.multiplyScalar(length));
  }

  #zoom(factor) {
    this.#moveTo(this.camera.position.clone().sub(this.controls.target).multiplyScalar(factor));
  }

  #moveTo(offset) {
    this.view = this.glide = null;
    this.camera.position.copy(this.controls.target).add(offset);
    this.onMove();
  }

  #press(event) {
    this.glide = null;
    this.pressed = [event.clientX, event.clientY];
    this.canvas.focus({ preventScroll: true });
  }

  #release(event) {
    const [x, y] = this.pressed ?? [NaN, NaN];
    if (Math.hypot(event.clientX - x, event.clientY - y) > TAP_PX) this.view = null;
    else this.#tap(event);
  }

  #tap(event) {
    const box = this.canvas.getBoundingClientRect();
    const x = (event.clientX - box.left) / box.width;
    const y = (event.clientY - box.top) / box.height;
    this.onTap(2 * x - 1, 1 - 2 * y);
  }
}

/** Unit vector on the way from a to b, round the upright axis, so that a glide does not roll over. */
function slerp(a, b, share) {
  const [heading, height] = angles(a);
  const [toHeading, toHeight] = angles(b);
  const around = ((toHeading - heading + 3 * Math.PI) % (2 * Math.PI)) - Math.PI;
  const h = heading + share * around;
  const e = height + share * (toHeight - height);
  return new THREE.Vector3(Math.cos(h) * Math.cos(e), Math.sin(h) * Math.cos(e), Math.sin(e));
}

function angles(v) {
  return [Math.atan2(v.y, v.x), Math.atan2(v.z, Math.hypot(v.x, v.y))];
}

// Distances and angles between targets' centres and planes, planes of the frame, and scanned points.
import * as THREE from "three";

const SNAP_PX = 14; // of the pointer from a target's centre
const COLOUR = 0xc2185b;
const FRAME = { x: [1, 0, 0], y: [0, 1, 0], z: [0, 0, 1] };
const VERTEX = 2; // place in `chosen` of the point where an angle is measured

export class Ruler {
  constructor(model, words, number, onChange) {
    Object.assign(this, { model, words, number, onChange });
    this.active = false;
    this.chosen = [null, null, null]; // from, to, vertex
    this.picked = [null, null, null]; // scanned points
    this.next = 0;
    this.items = new Map(this.#known().map((item) => [item.key, item]));
    this.material = new THREE.LineBasicMaterial({ color: COLOUR, depthTest: false });
    this.dots = new THREE.PointsMaterial({ color: COLOUR, size: 9, sizeAttenuation: false, depthTest: false });
    this.geometry = new THREE.BufferGeometry().setAttribute("position", new THREE.BufferAttribute(new Float32Array(9), 3));
    this.drawn = new THREE.Group();
    this.drawn.add(new THREE.Line(this.geometry, this.material), new THREE.Points(this.geometry, this.dots));
    this.drawn.renderOrder = 1;
    this.drawn.visible = false;
    for (const each of this.drawn.children) each.frustumCulled = false;
    model.scene.add(this.drawn);
  }

  /** What a list offers: centres and planes, and its own scanned point; the vertex only points. */
  offered(list) {
    const known = [...this.items.values()].filter((item) => list !== VERTEX || !item.normal);
    return [...known, { key: `point-${list}`, text: this.words.ruler_point }];
  }

  choose(list, key) {
    this.chosen[list] = key || null;
    this.onChange();
  }

  /** Take what lies at a place on the screen: a target's centre, its plane, or a scanned point. */
  take(x, y, camera, size, nearest) {
    const found = this.#centreAt(x, y, camera, size) ?? this.#planeAt(x, y, camera);
    const point = found ? null : nearest();
    if (!found && !point) return;
    const list = this.next;
    this.next = 1 - list;
    if (point) this.picked[list] = point;
    this.choose(list, found?.key ?? `point-${list}`);
  }

  /** Lines of text: what lies between the two. */
  read() {
    const [from, to, vertex] = this.chosen.map((key, list) => this.#item(key, list));
    this.#draw(vertex ? [from, vertex, to] : [from, to]);
    if (!from || !to) return [];
    if (vertex && !from.normal && !to.normal) return [this.#atVertex(from, to, vertex)];
    if (from.normal && to.normal) return [this.#angle(this.words.ruler_planes, angleOf(from.normal, to.normal, true))];
    if (from.normal || to.normal) {
      const [plane, point] = from.normal ? [from, to] : [to, from];
      const off = minus(point.at, plane.at).reduce((sum, d, i) => sum + d * plane.normal[i], 0);
      return [`${this.words.ruler_off}: ${this.#mm(Math.abs(off))}`];
    }
    const d = minus(to.at, from.at);
    return [`${this.words.ruler_distance}: ${this.#mm(Math.hypot(...d))}`, `x ${this.#mm(d[0])}, y ${this.#mm(d[1])}, z ${this.#mm(d[2])}`];
  }

  dispose() {
    this.geometry.dispose();
    this.material.dispose();
    this.dots.dispose();
  }

  #known() {
    const { words } = this;
    const frame = Object.entries(FRAME).map(([axis, normal]) => ({ key: `frame-${axis}`, text: words[`plane_${axis}`], at: [0, 0, 0], normal }));
    return [
      ...this.model.wheels.flatMap(({ name, label, centre, normal }) => [
        { key: `centre-${name}`, text: `${label ?? name}: ${words.ruler_centre}`, at: centre },
        { key: `plane-${name}`, text: `${label ?? name}: ${words.ruler_plane}`, at: centre, normal },
      ]),
      ...frame,
    ];
  }

  #item(key, list) {
    if (key?.startsWith("point-")) return this.picked[list] && { at: this.picked[list] };
    return this.items.get(key) ?? null;
  }

  #centreAt(x, y, camera, [width, height]) {
    const apart = ({ at }) => {
      const seen = new THREE.Vector3(...at).project(camera);
      return seen.z > 1 ? Infinity : Math.hypot((seen.x - x) * width / 2, (seen.y - y) * height / 2);
    };
    const centres = [...this.items.values()].filter(({ key }) => key.startsWith("centre-"));
    const [best] = centres.map((item) => [apart(item), item]).sort((a, b) => a[0] - b[0]);
    return best && best[0] < SNAP_PX ? best[1] : null;
  }

  #planeAt(x, y, camera) {
    const ray = new THREE.Raycaster();
    ray.setFromCamera(new THREE.Vector2(x, y), camera);
    const hit = ray.intersectObjects(this.model.discs).find(({ object, point }) => {
      const { centre, radius_m: radius } = object.userData.wheel;
      return point.distanceTo(new THREE.Vector3(...centre)) < radius;
    });
    return hit ? this.items.get(`plane-${hit.object.userData.wheel.name}`) : null;
  }

  #draw(items) {
    const places = items.filter(Boolean);
    const position = this.geometry.getAttribute("position");
    for (const [i, { at }] of places.entries()) position.setXYZ(i, ...at);
    position.needsUpdate = true;
    this.geometry.setDrawRange(0, places.length);
    this.drawn.visible = places.length > 0;
  }

  #atVertex(from, to, vertex) {
    return this.#angle(this.words.ruler_corner, angleOf(minus(from.at, vertex.at), minus(to.at, vertex.at), false));
  }

  #angle(name, radians) {
    const degrees = (radians * 180) / Math.PI;
    const seconds = Math.round(degrees * 3600);
    const parts = [Math.floor(seconds / 3600), Math.floor(seconds / 60) % 60, seconds % 60];
    const dms = `${parts[0]}\u00b0 ${String(parts[1]).padStart(2, "0")}\u2032 ${String(parts[2]).padStart(2, "0")}\u2033`;
    return `${name}: ${dms} (${this.number(degrees, 4)}\u00b0)`;
  }

  #mm(metres) {
    return `${this.number(1000 * metres, 2)} mm`;
  }
}

const minus = (a, b) => a.map((x, i) => x - b[i]);

/** Angle between two vectors, or between the planes that they are normal to. */
function angleOf(a, b, isPlanes) {
  const [u, v] = [new THREE.Vector3(...a), new THREE.Vector3(...b)];
  const along = u.dot(v);
  return Math.atan2(u.clone().cross(v).length(), isPlanes ? Math.abs(along) : along);
}

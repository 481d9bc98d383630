// The octree of all points, of which the nodes in view are loaded, the coarsest and nearest to the eye and to
// the place that is looked at first.
// pipeline/web/content/points.py and tree.py define its head and its nodes.
import * as THREE from "three";

const GRID = 128; // cells along a node's edge, of which each holds one point
const FINEST_PX = 0.1; // between the points of a node that needs no finer ones
const MOST_SHOWN = 5e6; // points, of some 60 bytes in the browser
const MOST_KEPT = 6e6;
const LOADING = 6; // at a time
const FOCUS = 10; // a metre farther from the pivot than the eye is counts as so many more away from the eye
const AT_FIRST = 2; // depth of the nodes that are there before any is shown
const POINT_BYTES = 16;

export class Tree {
  /** head: what points.json holds; load(first, bytes): promise of a part of points.bin; pivot: Vector3,
   *  the place that is looked at. */
  constructor(head, load, cloud, pivot, onChange, onFailure) {
    Object.assign(this, { load, cloud, pivot, onChange, onFailure, origin: head.origin, edge_m: head.edge_m });
    this.arrived = false; // whether nodes came since the last choice
    this.failed = false;
    this.chosen = [];
    this.kept = 0;
    this.loading = 0;
    this.turn = 0;
    this.known = new Map();
    const [low, high] = head.box.map((corner) => new THREE.Vector3(...corner).add(new THREE.Vector3(...head.origin)));
    this.bounds = new THREE.Box3(low, high);
    this.root = this.#node(0, 0, 0, 0);
    let first = 0;
    for (const [depth, x, y, z, count] of head.nodes) {
      Object.assign(this.#node(depth, x, y, z), { count, first });
      first += POINT_BYTES * count;
    }
  }

  /** Load the coarsest nodes. */
  async begin() {
    const coarse = [...this.known.values()].filter(({ edge_m, count }) => count && edge_m * 2 ** AT_FIRST >= this.edge_m);
    await Promise.all(coarse.map((node) => this.#fetch(node)));
  }

  holds(part) {
    return [...this.known.values()].some((node) => node.part === part);
  }

  /** Choose nodes for a camera and the height of its picture, pixels; return the parts that are here, as
   *  the cloud draws them, and load others. */
  choose(camera, height) {
    const frustum = frustumOf(camera);
    const scale = height / 2 / Math.tan((camera.fov * Math.PI) / 360);
    const reach = camera.position.distanceTo(this.pivot);
    const found = [];
    const visit = (node) => {
      if (!frustum.intersectsBox(node.box)) return;
      const beyond = Math.max(0, node.box.distanceToPoint(this.pivot) - reach);
      const far = Math.max(camera.near, node.box.distanceToPoint(camera.position) + FOCUS * beyond);
      node.worth = node.edge_m / far;
      if (node.count) found.push(node);
      if ((node.worth / GRID) * scale > FINEST_PX) for (const child of node.children) visit(child);
    };
    visit(this.root);
    found.sort((a, b) => b.worth - a.worth);
    let points = 0;
    this.chosen = found.filter(({ count }) => (points += count) <= MOST_SHOWN);
    this.turn++;
    for (const node of this.chosen) node.turn = this.turn;
    this.arrived = false;
    this.#loadNext();
    return this.chosen.filter(({ part }) => part).map(({ part }) => part);
  }

  /** Numbers of points in view and no farther from the pivot than the eye: shown, and of all; nodes that
   *  reach there count whole. */
  counts(camera) {
    const frustum = frustumOf(camera);
    const reach = camera.position.distanceTo(this.pivot);
    const isHere = ({ box }) => frustum.intersectsBox(box) && box.distanceToPoint(this.pivot) <= reach;
    const counts = { shown: 0, view: 0 };
    for (const node of this.known.values()) {
      if (!isHere(node)) continue;
      counts.view += node.count;
      if (node.part && node.turn === this.turn) counts.shown += node.count;
    }
    return counts;
  }

  dispose() {
    this.failed = true;
  }

  /** The node of a cell, made with those above it where it is new. */
  #node(depth, x, y, z) {
    const key = `${depth}/${x}/${y}/${z}`;
    if (this.known.has(key)) return this.known.get(key);
    const edge_m = this.edge_m / 2 ** depth;
    const corner = [x, y, z].map((index, axis) => this.origin[axis] - this.edge_m / 2 + index * edge_m);
    const low = new THREE.Vector3(...corner);
    const node = { edge_m, box: new THREE.Box3(low, low.clone().addScalar(edge_m)), count: 0, children: [], part: null, turn: 0 };
    this.known.set(key, node);
    if (depth) this.#node(depth - 1, x >> 1, y >> 1, z >> 1).children.push(node);
    return node;
  }

  #loadNext() {
    for (const node of this.chosen) {
      if (this.loading >= LOADING || this.failed) return;
      if (node.part || node.isComing) continue;
      this.#fetch(node).then(() => { this.#loadNext(); this.onChange(); }, (error) => {
        if (!this.failed) this.onFailure(error);
        this.failed = true;
      });
    }
  }

  async #fetch(node) {
    node.isComing = true;
    this.loading++;
    try {
      const bytes = await this.load(node.first, POINT_BYTES * node.count);
      if (this.failed) return;
      const [places, extra] = [new Float32Array(bytes, 0, 3 * node.count), new Uint32Array(bytes, 12 * node.count)];
      node.part = this.cloud.addNode(places, extra, this.origin);
      if (!node.children.length) node.box = node.part.box;
      this.kept += node.count;
      this.arrived = true;
      this.#forget();
    } finally {
      node.isComing = false;
      this.loading--;
    }
  }

  /** Drop the nodes that were out of view for longest, where too many are kept. */
  #forget() {
    if (this.kept <= MOST_KEPT) return;
    const idle = [...this.known.values()].filter(({ part, turn }) => part && turn < this.turn).sort((a, b) => a.turn - b.turn);
    for (const node of idle) {
      if (this.kept <= MOST_KEPT) return;
      this.cloud.remove(node.part);
      node.part = null;
      this.kept -= node.count;
    }
  }
}

function frustumOf(camera) {
  return new THREE.Frustum().setFromProjectionMatrix(new THREE.Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse));
}

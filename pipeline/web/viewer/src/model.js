// Wheels, planes, normals, outlines and the lines of the frame, in layers that can be hidden.
import * as THREE from "three";
import { LineMaterial } from "three/examples/jsm/lines/LineMaterial.js";
import { LineSegments2 } from "three/examples/jsm/lines/LineSegments2.js";
import { LineSegmentsGeometry } from "three/examples/jsm/lines/LineSegmentsGeometry.js";
import { formOf } from "./form.js";

// Okabe and Ito's colours, distinct to the colour-blind.
const OF_CLASS = { reference: 0x0072b2, trial: 0xb35c00, bad: 0xc43302 };
const OF_LAYER = { frame: 0x37474f, kingpin: 0x8e3a73 };
const OF_AXIS = [0xc43302, 0x0a7d4f, 0x1f5fbf]; // forward, left, up
const MARKED = 0xffb000;
const DISC_M = 0.3; // of the disc that shows a wheel's plane: about a tyre's
const OPACITY = 0.14; // of that disc
const NORMAL_M = 0.45;
const ARROWS = new Set(["axes"]);
const LABELLED = new Set(["axes", "kingpin"]);
const X = new THREE.Vector3(1, 0, 0);
const Z = new THREE.Vector3(0, 0, 1);

export class Model {
  constructor({ wheels = [], lines = [] }) {
    this.scene = new THREE.Scene();
    this.groups = {};
    this.materials = [];
    this.paths = new Map();
    this.drawn = []; // each path twice
    this.thin = new THREE.LineBasicMaterial({ vertexColors: true });
    this.materials.push(this.thin);
    this.wheels = wheels.filter((wheel) => wheel.centre).map((wheel) => ({ ...wheel, radius_m: radiusOf(wheel) }));
    this.lines = lines;
    this.discs = this.wheels.map((wheel) => this.#addWheel(wheel));
    for (const line of lines) this.#addLine(line);
    this.#drawPaths();
    this.form = formOf(this.wheels);
    if (this.form) this.scene.add((this.groups.form = this.form.group));
    this.bounds = boundsOf(this.wheels, lines);
  }

  wheel(name) {
    return this.wheels.find((wheel) => wheel.name === name);
  }

  /** Names of the layers that have something to show. */
  layers(scene) {
    const own = ["wheels", "normals", "form", "frame", "axes", "kingpin"].filter((name) => this.groups[name]);
    return [...(scene.cloud ? ["cloud"] : []), ...own, "labels"];
  }

  labels() {
    return [
      ...this.wheels.map((wheel) => ({ wheel: wheel.name, at: wheel.centre, lines: wordsOf(wheel), kind: kindOf(wheel), plate: wheel })),
      ...this.lines.filter((line) => line.name && LABELLED.has(line.layer)).map((line) => ({ at: line.to, lines: [line.name] })),
    ];
  }

  show(layer, shown) {
    if (this.groups[layer]) this.groups[layer].visible = shown;
  }

  mark(name) {
    for (const disc of this.discs) {
      const marked = disc.userData.wheel.name === name;
      disc.material.color.set(marked ? MARKED : colourOf(disc.userData.wheel));
      disc.material.opacity = marked ? 0.3 : OPACITY;
    }
  }

  /** Name of the wheel under a place on the screen, both coordinates from -1 to 1. */
  wheelAt(x, y, camera) {
    const ray = new THREE.Raycaster();
    ray.setFromCamera(new THREE.Vector2(x, y), camera);
    return ray.intersectObjects(this.discs)[0]?.object.userData.wheel.name ?? null;
  }

  /** Lines of one pixel, which a slow machine draws faster than wide ones. */
  setCoarse(coarse) {
    for (const { wide, thin } of this.drawn) {
      wide.visible = !coarse;
      thin.visible = coarse;
    }
  }

  resize(width, height) {
    for (const material of this.materials) material.resolution?.set(width, height);
  }

  dispose() {
    this.scene.traverse((object) => object.geometry?.dispose());
    for (const { material } of this.form?.group.children ?? []) {
      material.map.dispose();
      material.dispose();
    }
    for (const material of this.materials) material.dispose();
  }

  #addWheel(wheel) {
    const centre = new THREE.Vector3(...wheel.centre);
    const normal = new THREE.Vector3(...wheel.normal);
    const colour = colourOf(wheel);
    const disc = this.#add("wheels", new THREE.CircleGeometry(DISC_M, 64), new THREE.MeshBasicMaterial({
      color: colour, transparent: true, opacity: OPACITY, side: THREE.DoubleSide, depthWrite: false,
    }));
    disc.position.copy(centre);
    disc.quaternion.setFromUnitVectors(Z, normal);
    disc.userData.wheel = wheel;
    disc.updateMatrixWorld();
    this.#addPath("wheels", circle(disc), colour, 1.2);
    for (const polygon of wheel.outline ?? []) this.#addPath("wheels", polygon, colour, 2.6);
    this.#addArrow("normals", centre, centre.clone().addScaledVector(normal, NORMAL_M), colour);
    return disc;
  }

  #addLine({ layer, from, to }) {
    if (ARROWS.has(layer)) this.#addArrow(layer, new THREE.Vector3(...from), new THREE.Vector3(...to), OF_AXIS[mainAxis(from, to)]);
    else this.#addPath(layer, [from, to], OF_LAYER[layer] ?? OF_LAYER.frame, 2, false);
  }

  #addArrow(layer, from, to, colour) {
    const length = from.distanceTo(to);
    const way = to.clone().sub(from).normalize();
    const head = Math.min(0.07, 0.3 * length);
    const cone = this.#add(layer, new THREE.ConeGeometry(0.28 * head, head, 16).rotateZ(-Math.PI / 2), new THREE.MeshBasicMaterial({ color: colour }));
    cone.position.copy(to).addScaledVector(way, -head / 2);
    cone.quaternion.setFromUnitVectors(X, way);
    this.#addPath(layer, [from.toArray(), to.clone().addScaledVector(way, -head).toArray()], colour, 2.6, false);
  }

  /** Lines of one layer and width are drawn at once: see #drawPaths. */
  #addPath(layer, places, colour, width, closed = true) {
    const ends = closed ? places : places.slice(0, -1);
    const key = `${layer} ${width}`;
    const path = this.paths.get(key) ?? { layer, width, places: [], colours: [] };
    const { r, g, b } = new THREE.Color(colour);
    for (const [i, place] of ends.entries()) {
      path.places.push(...place, ...places[(i + 1) % places.length]);
      path.colours.push(r, g, b, r, g, b);
    }
    this.paths.set(key, path);
  }

  #drawPaths() {
    for (const { layer, width, places, colours } of this.paths.values()) {
      const material = new LineMaterial({ vertexColors: true, linewidth: width });
      this.materials.push(material);
      const wide = new LineSegments2(new LineSegmentsGeometry().setPositions(places).setColors(colours), material);
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute("position", new THREE.Float32BufferAttribute(places, 3));
      geometry.setAttribute("color", new THREE.Float32BufferAttribute(colours, 3));
      const thin = new THREE.LineSegments(geometry, this.thin);
      thin.visible = false;
      this.drawn.push({ wide, thin });
      this.#group(layer).add(wide, thin);
    }
  }

  #add(layer, geometry, material) {
    const mesh = new THREE.Mesh(geometry, material);
    this.materials.push(material);
    this.#group(layer).add(mesh);
    return mesh;
  }

  #group(layer) {
    if (!this.groups[layer]) this.scene.add((this.groups[layer] = new THREE.Group()));
    return this.groups[layer];
  }
}

function colourOf(wheel) {
  return OF_CLASS[wheel.colour_class] ?? OF_CLASS.reference;
}

/** A trial's angles are shown when it is chosen or pointed at: it may stand where others stand. */
function kindOf({ colour_class: kind, role }) {
  return `${kind === "bad" ? " w3d-bad" : ""}${role === "reference" ? "" : " w3d-brief"}`;
}

export function wordsOf({ name, label, toe_text: toe, camber_text: camber }) {
  return [label ?? name, ...[toe, camber].filter(Boolean)];
}

/** Radius of the ball about the target's edge. */
function radiusOf({ centre, outline = [] }) {
  const places = outline.flat();
  return places.length ? Math.max(...places.map((place) => Math.hypot(...place.map((x, i) => x - centre[i])))) : 0;
}

function mainAxis(from, to) {
  const lengths = to.map((x, axis) => Math.abs(x - from[axis]));
  return lengths.indexOf(Math.max(...lengths));
}

function circle(disc) {
  return Array.from({ length: 64 }, (_, i) => {
    const angle = (i / 32) * Math.PI;
    const place = new THREE.Vector3(Math.cos(angle), Math.sin(angle), 0).multiplyScalar(DISC_M);
    return disc.localToWorld(place).toArray();
  });
}

function boundsOf(wheels, lines) {
  const places = [...wheels.map((wheel) => wheel.centre), ...lines.flatMap(({ from, to }) => [from, to])];
  const box = new THREE.Box3().setFromPoints(places.map((place) => new THREE.Vector3(...place)));
  if (box.isEmpty()) box.set(new THREE.Vector3(-1, -1, -1), new THREE.Vector3(1, 1, 1));
  return box.expandByScalar(DISC_M).getBoundingSphere(new THREE.Sphere());
}

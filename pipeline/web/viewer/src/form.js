// Smoothed deviation of each target from its plane, drawn on the target.
import * as THREE from "three";
import { colourAt, roundUp, stopsOf } from "./colours.js";

const OFF = -128;
const FINER = 4; // pixels of the picture along a cell
const SHARE = 0.98; // of the values lie within the colour scale
const BEFORE_M = 0.001; // of the plane, so that the disc of the wheel does not show through

/** Maps of all wheels in one group, on one scale; null where no wheel has one. */
export function formOf(wheels) {
  const shown = wheels.filter((wheel) => wheel.form);
  if (!shown.length) return null;
  const maps = shown.map((wheel) => ({ wheel, values: values(wheel.form) }));
  const sizes = maps.flatMap(({ values: each }) => [...each].filter((um) => !Number.isNaN(um)).map(Math.abs)).sort((a, b) => a - b);
  const range_um = roundUp(Math.max(1, sizes[Math.floor(SHARE * (sizes.length - 1))] ?? 1));
  const group = new THREE.Group();
  group.visible = false;
  for (const { wheel, values: each } of maps) group.add(plateOf(wheel, each, range_um));
  return {
    group, range_mm: range_um / 1000,
    width_mm: Math.max(...shown.map(({ form }) => form.width_mm)), u_mm: Math.max(...shown.map(({ form }) => form.u_mm)),
  };
}

/** Deviations, micrometres, row by row from the top; NaN off the target. */
function values({ deviation, most_um: most }) {
  const steps = new Int8Array(Uint8Array.from(atob(deviation), (c) => c.charCodeAt(0)).buffer);
  return Float32Array.from(steps, (step) => (step === OFF ? NaN : (step * most) / 127));
}

/** Value between the cells, of those that are known; NaN where most of the four are not. */
function between(um, cells, row, column) {
  let sum = 0;
  let weight = 0;
  for (const i of [Math.floor(row), Math.floor(row) + 1]) for (const j of [Math.floor(column), Math.floor(column) + 1]) {
    const value = i >= 0 && j >= 0 && i < cells && j < cells ? um[i * cells + j] : NaN;
    if (Number.isNaN(value)) continue;
    const share = (1 - Math.abs(row - i)) * (1 - Math.abs(column - j));
    sum += share * value;
    weight += share;
  }
  return weight > 0.5 ? sum / weight : NaN;
}

function plateOf({ form, normal }, um, range_um) {
  const { cells, half_width_m: half } = form;
  const size = FINER * cells;
  const pixels = new Uint8Array(4 * size * size);
  for (let y = 0; y < size; y++) for (let x = 0; x < size; x++) {
    const value = between(um, cells, (y + 0.5) / FINER - 0.5, (x + 0.5) / FINER - 0.5);
    if (Number.isNaN(value)) continue;
    pixels.set([...colourAt(stopsOf("residual"), 0.5 + value / range_um / 2), 255], 4 * ((size - 1 - y) * size + x));
  }
  const texture = new THREE.DataTexture(pixels, size, size);
  texture.colorSpace = THREE.SRGBColorSpace;
  texture.needsUpdate = true;
  const [centre, u, v, out] = [form.centre, form.u, form.v, normal].map((each) => new THREE.Vector3(...each));
  centre.addScaledVector(out, BEFORE_M);
  const corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]].flatMap(([a, b]) => centre.clone().addScaledVector(u, a * half).addScaledVector(v, b * half).toArray());
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.Float32BufferAttribute(corners, 3));
  geometry.setAttribute("uv", new THREE.Float32BufferAttribute([0, 0, 1, 0, 1, 1, 0, 1], 2));
  geometry.setIndex([0, 1, 2, 0, 2, 3]);
  return new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({ map: texture, alphaTest: 0.5, side: THREE.DoubleSide }));
}

// Names in the picture; a wheel's is a button, so that it can be chosen by keyboard too.
import * as THREE from "three";
import { wordsOf } from "./model.js";

const ABOVE_PX = 12;
const GAP_PX = 2;
const BEHIND = -0.35; // cosine between a target's normal and the way to the eye, beyond which it is seen from behind
const APART_M = 0.3; // along the line of sight: nearer targets are at the same wheel
const WHOLE = 0.4; // of the picture: a target larger than that leaves no room beside it

export class Labels {
  constructor(root, model, onWheel) {
    this.plates = model.wheels.filter(({ role, radius_m: radius }) => role === "reference" && radius > 0);
    this.cut = null; // plane, beyond which there is nothing
    this.layer = document.createElement("div");
    this.layer.className = "w3d-labels";
    root.append(this.layer);
    this.labels = model.labels().map((label) => {
      const element = document.createElement(label.wheel ? "button" : "span");
      element.className = `w3d-label${label.kind ?? ""}`;
      if (label.wheel) {
        element.type = "button";
        element.addEventListener("click", () => onWheel(label.wheel));
      }
      element.append(...label.lines.map((text, i) => line(text, i)));
      this.layer.append(element);
      return { ...label, element, place: new THREE.Vector3(...label.at) };
    });
  }

  show(shown) {
    this.layer.hidden = !shown;
  }

  mark(name) {
    this.chosen = name;
    for (const label of this.labels) {
      if (label.wheel) label.element.setAttribute("aria-pressed", String(label.wheel === name));
      label.half = null;
    }
  }

  /** Write other texts at the wheels, {label, toe_text, camber_text} by their names. */
  rewrite(texts) {
    for (const label of this.labels) {
      if (!texts[label.wheel]) continue;
      label.element.replaceChildren(...wordsOf({ name: label.wheel, ...texts[label.wheel] }).map((text, i) => line(text, i)));
      label.half = null;
    }
  }

  /** Put every label above its place, the chosen one first, or at the free spot nearest to that: none
   *  covers another, a target, a bar, or the edge; what finds no room is hidden, as that of a target which
   *  is seen from behind or lies behind another one. */
  place(camera, root, bars) {
    const { clientWidth: width, clientHeight: height } = root;
    const shown = this.labels.filter((label) => this.#isSeen(label, camera, [width, height]));
    const isChosen = (label) => Boolean(label.wheel) && label.wheel === this.chosen;
    shown.sort((a, b) => isChosen(b) - isChosen(a) || b.wanted[1] - a.wanted[1]);
    const { left, top } = root.getBoundingClientRect();
    const taken = bars.map((each) => each.getBoundingClientRect()).filter((box) => box.width)
      .map((box) => ({ at: [box.left - left + box.width / 2, box.top - top + box.height / 2], half: [box.width / 2, box.height / 2] }));
    for (const plate of this.plates) {
      const box = boxOf(plate, camera, [width, height]);
      if (box && box.half[0] < WHOLE * width && box.half[1] < WHOLE * height) taken.push(box);
    }
    for (const { element, wanted, half } of shown) {
      const at = freeSpot(wanted, half, taken, [width, height]);
      element.hidden = !at;
      if (!at) continue;
      taken.push({ at, half });
      element.style.transform = `translate(${at.map((x) => `${x.toFixed(1)}px`)}) translate(-50%, -50%)`;
    }
  }

  /** Whether its place is in the picture; where its middle should be, and half its size, in pixels. */
  #isSeen(label, camera, [width, height]) {
    const seen = label.place.clone().project(camera);
    const { element } = label;
    element.hidden = seen.z > 1 || Math.abs(seen.x) > 1.05 || Math.abs(seen.y) > 1.05 || this.#isBehind(label, camera);
    if (element.hidden) return false;
    label.half ??= [(element.offsetWidth + 1) / 2, (element.offsetHeight + 1) / 2];
    const above = label.plate ? boxOf(label.plate, camera, [width, height])?.half[1] ?? 0 : 0;
    const raised = Math.max(ABOVE_PX, above < WHOLE * height ? above + GAP_PX : 0);
    label.wanted = [((seen.x + 1) / 2) * width, ((1 - seen.y) / 2) * height - raised - label.half[1]];
    return true;
  }

  /** Whether its target is seen from behind, through another target, or is cut away. */
  #isBehind({ plate, place }, camera) {
    if (this.cut && this.cut.distanceToPoint(place) < 0) return true;
    if (!plate) return false;
    const sight = place.clone().sub(camera.position);
    const far = sight.length();
    sight.divideScalar(far);
    if (-sight.dot(new THREE.Vector3(...plate.normal)) < BEHIND) return true;
    return this.plates.some(({ centre, normal, radius_m: radius }) => {
      const middle = new THREE.Vector3(...centre);
      const out = new THREE.Vector3(...normal);
      const along = middle.clone().sub(camera.position).dot(out) / sight.dot(out);
      return along > 0 && along < far - APART_M && camera.position.clone().addScaledVector(sight, along).distanceTo(middle) < radius;
    });
  }
}

/** Middle and half the size, in pixels, of a target's edge in the picture; null behind the eye or without an edge. */
function boxOf({ centre, outline, radius_m: radius }, camera, [width, height]) {
  if (!radius) return null;
  const places = outline[0].map((place) => new THREE.Vector3(...place).project(camera));
  if (new THREE.Vector3(...centre).project(camera).z > 1 || places.some(({ z }) => z > 1)) return null;
  const ends = (key, size, sign) => {
    const all = places.map((place) => ((sign * place[key] + 1) / 2) * size);
    return [Math.min(...all), Math.max(...all)];
  };
  const [x, y] = [ends("x", width, 1), ends("y", height, -1)];
  return { at: [(x[0] + x[1]) / 2, (y[0] + y[1]) / 2], half: [(x[1] - x[0]) / 2, (y[1] - y[0]) / 2] };
}

/** The spot for a box nearest to the one wanted, inside the bounds and clear of what is taken; null if
 *  there is none. Candidates are those that touch what is taken. */
function freeSpot(wanted, half, taken, bounds) {
  const start = wanted.map((x, axis) => Math.max(half[axis], Math.min(bounds[axis] - half[axis], x)));
  const isFree = (at) => at.every((x, axis) => x >= half[axis] && x <= bounds[axis] - half[axis])
    && taken.every((other) => at.some((x, axis) => Math.abs(x - other.at[axis]) >= half[axis] + other.half[axis]));
  if (isFree(start)) return start;
  const [xs, ys] = start.map((x, axis) => [x, ...taken.flatMap((other) => {
    const apart = half[axis] + other.half[axis] + GAP_PX;
    return [other.at[axis] - apart, other.at[axis] + apart];
  })]);
  let best = null;
  let least = Infinity;
  for (const x of xs) for (const y of ys) {
    const far = (x - start[0]) ** 2 + (y - start[1]) ** 2;
    if (far < least && isFree([x, y])) [best, least] = [[x, y], far];
  }
  return best;
}

function line(text, i) {
  const element = document.createElement(i ? "span" : "b");
  element.textContent = text;
  return element;
}

// Names in the picture; a wheel's is a button, so that it can be chosen by keyboard too.
import * as THREE from "three";

const ABOVE_PX = 12;
const GAP_PX = 2;

export class Labels {
  constructor(root, labels, onWheel) {
    this.layer = document.createElement("div");
    this.layer.className = "w3d-labels";
    root.append(this.layer);
    this.labels = labels.map((label) => {
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

  /** Put every label above its place, the chosen one first, or at the free spot nearest to that: none
   *  covers another, a bar, or the edge; what finds no room is hidden. */
  place(camera, { clientWidth: width, clientHeight: height }, bars) {
    const shown = this.labels.filter((label) => this.#isSeen(label, camera, [width, height]));
    const isChosen = (label) => Boolean(label.wheel) && label.wheel === this.chosen;
    shown.sort((a, b) => isChosen(b) - isChosen(a) || b.wanted[1] - a.wanted[1]);
    const taken = bars.map(({ offsetLeft: x, offsetTop: y, offsetWidth: w, offsetHeight: h }) => ({ at: [x + w / 2, y + h / 2], half: [w / 2, h / 2] }));
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
    element.hidden = seen.z > 1 || Math.abs(seen.x) > 1.05 || Math.abs(seen.y) > 1.05;
    if (element.hidden) return false;
    label.half ??= [(element.offsetWidth + 1) / 2, (element.offsetHeight + 1) / 2];
    label.wanted = [((seen.x + 1) / 2) * width, ((1 - seen.y) / 2) * height - ABOVE_PX - label.half[1]];
    return true;
  }
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

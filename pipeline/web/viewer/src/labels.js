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
      label.size = null;
    }
  }

  /** Put every label above its place; one that would cover another moves further up, but the chosen
   *  one, which grows, stays and covers. */
  place(camera, { clientWidth: width, clientHeight: height }) {
    const shown = [];
    for (const label of this.labels) {
      const seen = label.place.clone().project(camera);
      label.element.hidden = seen.z > 1 || Math.abs(seen.x) > 1.05 || Math.abs(seen.y) > 1.05;
      if (label.element.hidden) continue;
      label.size ??= [label.element.offsetWidth / 2, label.element.offsetHeight];
      label.x = ((seen.x + 1) / 2) * width;
      label.y = ((1 - seen.y) / 2) * height - ABOVE_PX;
      shown.push(label);
    }
    shown.sort((a, b) => b.y - a.y);
    const fixed = (label) => label.wheel && label.wheel === this.chosen;
    for (const [i, label] of shown.entries()) {
      for (const below of shown.slice(0, i)) if (!fixed(label) && !fixed(below) && covers(label, below)) label.y = below.y - below.size[1] - GAP_PX;
      label.y = Math.max(label.y, label.size[1]);
      label.element.style.transform = `translate(${label.x.toFixed(1)}px, ${label.y.toFixed(1)}px) translate(-50%, -100%)`;
    }
  }
}

function covers(a, b) {
  const beside = Math.abs(a.x - b.x) >= a.size[0] + b.size[0] + GAP_PX;
  const above = a.y <= b.y - b.size[1] - GAP_PX || b.y <= a.y - a.size[1] - GAP_PX;
  return !beside && !above;
}

function line(text, i) {
  const element = document.createElement(i ? "span" : "b");
  element.textContent = text;
  return element;
}

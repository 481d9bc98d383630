// The panel of tools: colours, scans, section, and distances and angles.
import { hex, ofScan, stopsOf } from "./colours.js";

const COLOURS = ["kind", "residual", "intensity", "scan", "height"];
const AXES = ["x", "y", "z"];
const STEPS = 400; // of the slider of the section

export class Tools {
  constructor(root, viewer, words) {
    Object.assign(this, { viewer, words, scans: new Map() });
    this.panel = element("div", "w3d-bar w3d-panel", { role: "group", "aria-label": words.tools });
    this.panel.hidden = true;
    this.panel.append(this.#colours(), this.#scans(), this.#section(), this.#ruler());
    root.append(this.panel);
  }

  toggle(open = this.panel.hidden) {
    this.panel.hidden = !open;
    this.viewer.ruler.active = open;
    this.viewer.redraw();
    return open;
  }

  /** Offer the colours that the points have. */
  offer(colours) {
    const chosen = this.colour.value;
    this.colour.replaceChildren(...COLOURS.filter((name) => colours.includes(name)).map((name) => option(name, this.words[`colour_${name}`])));
    this.colour.value = colours.includes(chosen) ? chosen : "kind";
    this.colours.hidden = colours.length < 2;
  }

  addScan(name) {
    if (this.scans.has(name)) return;
    const box = tick(name, true, (shown) => this.viewer.showScan(name, shown));
    const patch = element("i", "w3d-patch");
    patch.style.background = hex(ofScan(this.scans.size));
    box.querySelector("input").after(patch);
    this.scans.set(name, box);
    this.ticks.append(box);
    this.ticks.parentElement.hidden = this.scans.size < 2;
  }

  forgetScans() {
    this.scans.clear();
    this.ticks.replaceChildren();
  }

  /** Show what was measured, and in the lists what it was measured of. */
  showMeasured(lines, chosen) {
    this.said.replaceChildren(...lines.map((text) => Object.assign(document.createElement("p"), { textContent: text })));
    for (const [i, list] of this.lists.entries()) list.value = chosen[i] ?? "";
  }

  #colours() {
    this.colour = element("select", "", { name: "colour" });
    this.colour.addEventListener("change", () => this.viewer.colourBy(this.colour.value));
    this.colours = labelled(this.words.colour, this.colour);
    this.offer(["kind"]);
    return this.colours;
  }

  #scans() {
    const [set, ticks] = fieldset(this.words.scans);
    this.ticks = ticks;
    set.hidden = true;
    return set;
  }

  #section() {
    const { words } = this;
    const axis = element("select", "", { name: "section" });
    axis.append(option("", words.section_none), ...AXES.map((name) => option(name, words[`section_${name}`])));
    const at = element("input", "", { type: "range", min: "0", max: String(STEPS), value: String(STEPS / 2), "aria-label": words.section_at });
    const value = element("output", "", {});
    const other = tick(words.section_flip, false, () => act());
    const rest = element("div", "w3d-rest", {});
    rest.append(at, value, other);
    const act = () => {
      rest.hidden = !axis.value;
      const where = this.viewer.cut(axis.value, at.valueAsNumber / STEPS, other.querySelector("input").checked);
      value.textContent = where === null ? "" : `${this.viewer.number(where, 3)} m`;
      at.setAttribute("aria-valuetext", value.textContent);
    };
    axis.addEventListener("change", act);
    at.addEventListener("input", act);
    rest.hidden = true;
    const set = element("div", "", {});
    set.append(labelled(words.section, axis), rest);
    return set;
  }

  #ruler() {
    const { words, viewer } = this;
    const [set, inside] = fieldset(words.ruler);
    this.lists = ["from", "to", "vertex"].map((name, i) => {
      const list = element("select", "", { name: `ruler-${name}` });
      list.append(option("", "\u2013"), ...viewer.ruler.offered(i).map(({ key, text }) => option(key, text)));
      list.addEventListener("change", () => viewer.ruler.choose(i, list.value));
      inside.append(labelled(words[`ruler_${name}`], list));
      return list;
    });
    this.said = element("div", "w3d-said", { role: "status" });
    inside.append(Object.assign(document.createElement("p"), { textContent: words.ruler_hint }), this.said);
    return set;
  }
}

/** The colour scale that is shown: its ends and middle, and what it is of. */
export class Scale {
  constructor(root) {
    this.place = element("div", "w3d-bar w3d-scale", { role: "img" });
    this.place.hidden = true;
    root.append(this.place);
  }

  show(kind, text, values) {
    this.place.hidden = !values;
    if (!values) return;
    const strip = element("i", "", {});
    strip.style.background = `linear-gradient(to right, ${stopsOf(kind).map(hex).join(", ")})`;
    const ends = element("span", "", {});
    ends.append(...values.map((value) => Object.assign(document.createElement("b"), { textContent: value })));
    this.place.replaceChildren(Object.assign(document.createElement("span"), { textContent: text }), strip, ends);
    this.place.setAttribute("aria-label", `${text}: ${values.join(", ")}`);
  }
}

export function element(tag, name, properties = {}) {
  const made = document.createElement(tag);
  if (name) made.className = name;
  for (const [key, value] of Object.entries(properties)) made.setAttribute(key, value);
  return made;
}

export function tick(text, checked, act) {
  const box = Object.assign(document.createElement("input"), { type: "checkbox", checked });
  box.addEventListener("change", () => act(box.checked));
  const label = document.createElement("label");
  label.append(box, text);
  return label;
}

function option(value, text) {
  return Object.assign(document.createElement("option"), { value, textContent: text });
}

function labelled(text, control) {
  const label = document.createElement("label");
  label.append(text, control);
  return label;
}

function fieldset(text) {
  const set = element("fieldset", "");
  const inside = element("div", "w3d-ticks");
  set.append(Object.assign(document.createElement("legend"), { textContent: text }), inside);
  return [set, inside];
}

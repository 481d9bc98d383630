// Buttons for the views, switches for the layers, and what opens the tools.
import { Scale, Tools, element, tick } from "./tools.js";

const VIEWS = ["iso", "front", "rear", "left", "right", "top"];
const OFF_AT_FIRST = new Set(["form"]);

export class Toolbar {
  constructor(root, viewer, layers, words) {
    this.viewer = viewer;
    this.words = words;
    this.boxes = new Map();
    const head = element("div", "w3d-head");
    root.append(head);
    const views = bar(head, "w3d-views", words.views);
    for (const view of VIEWS) views.append(button(words[view], () => viewer.look(view)));
    this.tools = new Tools(head, viewer, words);
    const opener = button(words.tools, () => opener.setAttribute("aria-expanded", String(this.tools.toggle())));
    opener.classList.add("w3d-opener");
    opener.setAttribute("aria-expanded", "false");
    views.append(opener);
    if (document.fullscreenEnabled) views.append(this.#fullScreen(root));
    const foot = element("div", "w3d-foot");
    root.append(foot);
    this.scale = new Scale(foot);
    this.switches = bar(foot, "w3d-layers", words.layers);
    this.ticks = element("div", "w3d-ticks");
    this.count = element("p", "w3d-count", { role: "status" });
    this.count.hidden = true;
    this.switches.append(this.ticks, this.count);
    this.views = views;
    this.bars = [views, this.switches, this.scale.place, this.tools.panel];
    for (const layer of layers) this.#addSwitch(layer);
  }

  /** Heights of the bars above and below the picture. */
  covered(root) {
    const { top, bottom } = root.getBoundingClientRect();
    return [this.views.getBoundingClientRect().bottom - top, bottom - this.switches.getBoundingClientRect().top];
  }

  /** Add the switch of a layer that came later. */
  show(layer) {
    if (!this.boxes.has(layer)) this.#addSwitch(layer, true);
  }

  mark(layer, shown) {
    if (this.boxes.has(layer)) this.boxes.get(layer).checked = shown;
  }

  say(text) {
    this.count.textContent = text;
    this.count.hidden = !text;
  }

  #addSwitch(layer, first = false) {
    const label = tick(this.words[layer], !OFF_AT_FIRST.has(layer), (shown) => this.viewer.setLayer(layer, shown));
    if (first) this.ticks.prepend(label);
    else this.ticks.append(label);
    this.boxes.set(layer, label.querySelector("input"));
  }

  #fullScreen(root) {
    const made = button(this.words.full_screen, () => (document.fullscreenElement ? document.exitFullscreen() : root.requestFullscreen()));
    made.setAttribute("aria-pressed", "false");
    root.addEventListener("fullscreenchange", () => made.setAttribute("aria-pressed", String(document.fullscreenElement === root)));
    return made;
  }
}

function bar(root, name, label) {
  const made = element("div", `w3d-bar ${name}`, { role: "group", "aria-label": label });
  root.append(made);
  return made;
}

function button(text, act) {
  const made = Object.assign(document.createElement("button"), { type: "button", textContent: text });
  made.addEventListener("click", act);
  return made;
}

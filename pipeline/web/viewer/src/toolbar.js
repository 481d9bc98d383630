// Buttons for the views, switches for the layers.
const VIEWS = ["iso", "front", "rear", "left", "right", "top"];

export class Toolbar {
  constructor(root, viewer, layers, words) {
    this.viewer = viewer;
    this.words = words;
    this.boxes = new Map();
    const views = bar(root, "w3d-views", words.views);
    for (const view of VIEWS) views.append(button(words[view], () => viewer.look(view)));
    this.switches = bar(root, "w3d-layers", words.layers);
    this.bars = [views, this.switches];
    for (const layer of layers) this.#addSwitch(layer);
  }

  /** Add the switch of a layer that came later. */
  show(layer) {
    if (!this.boxes.has(layer)) this.#addSwitch(layer, true);
  }

  mark(layer, shown) {
    if (this.boxes.has(layer)) this.boxes.get(layer).checked = shown;
  }

  #addSwitch(layer, first = false) {
    const label = document.createElement("label");
    const box = document.createElement("input");
    box.type = "checkbox";
    box.checked = true;
    box.addEventListener("change", () => this.viewer.setLayer(layer, box.checked));
    label.append(box, this.words[layer]);
    this.switches[first ? "prepend" : "append"](label);
    this.boxes.set(layer, box);
  }
}

function bar(root, name, label) {
  const element = document.createElement("div");
  element.className = `w3d-bar ${name}`;
  element.setAttribute("role", "group");
  element.setAttribute("aria-label", label);
  root.append(element);
  return element;
}

function button(text, act) {
  const element = document.createElement("button");
  element.type = "button";
  element.textContent = text;
  element.addEventListener("click", act);
  return element;
}

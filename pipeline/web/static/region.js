// Region of the target, drawn over the picture of a scan, or entered by its borders.
import { el, t } from "./base.js";

const SIDES = ["left", "right", "bottom", "top"];
const LEAST = 0.01; // of the picture: a shorter drag draws nothing
const DIGITS = { m: 3, mm: 0, in: 2 }; // of a border, in the unit of the scans

export class Region {
  /** corners: upper left, upper right and lower left of the picture; onDraw is called with those of the region, or null. */
  constructor(name, picture, corners, unit, onDraw) {
    Object.assign(this, { picture, corners, onDraw, digits: DIGITS[unit] });
    const [origin, right, down] = corners;
    this.size = [right, down].map((end) => Math.hypot(...end.map((x, i) => x - origin[i])));
    this.box = el("div", { class: "drawn", hidden: true });
    picture.append(this.box);
    this.fields = Object.fromEntries(SIDES.map((side, i) => [side, el("input", {
      type: "number", name: side, min: "0", max: this.#text(this.size[i >> 1]), step: String(10 ** (1 - this.digits)), oninput: () => this.#entered(),
    })]));
    const borders = SIDES.map((side) => el("label", { class: "cell" }, t(`region_${side}`, { unit }), this.fields[side]));
    this.form = el("fieldset", { hidden: true }, el("legend", {}, t("region_of", { name })), el("p", { class: "hint" }, t("region_hint")),
      el("div", { class: "cells" }, ...borders, el("button", { type: "button", onclick: () => this.clear() }, t("region_none"))));
    this.button = el("button", { type: "button", "aria-expanded": "false", onclick: () => this.#open(this.form.hidden) }, t("region"));
    this.element = el("div", { class: "region" }, el("p", { class: "buttons left" }, this.button), this.form);
    for (const [event, act] of [["pointerdown", this.#begin], ["pointermove", this.#drag], ["pointerup", this.#end], ["pointercancel", this.#end]]) {
      picture.addEventListener(event, (given) => act.call(this, given));
    }
  }

  /** Forget the region. */
  clear() {
    for (const field of Object.values(this.fields)) field.value = "";
    this.#show(null);
  }

  #open(isOpen) {
    this.form.hidden = !isOpen;
    this.button.setAttribute("aria-expanded", String(isOpen));
    this.picture.classList.toggle("drawing", isOpen);
    if (!isOpen) this.clear();
  }

  #at({ clientX, clientY }) {
    const { left, top, width, height } = this.picture.getBoundingClientRect();
    return [(clientX - left) / width, (clientY - top) / height].map((share) => Math.min(1, Math.max(0, share)));
  }

  #begin(event) {
    if (this.form.hidden || event.button) return;
    event.preventDefault(); // a picture would be dragged
    this.picture.setPointerCapture(event.pointerId);
    this.from = this.#at(event);
  }

  #drag(event) {
    if (!this.from) return;
    const [[x0, y0], [x1, y1]] = [this.from, this.#at(event)];
    const [left, right, top, bottom] = [Math.min(x0, x1), Math.max(x0, x1), Math.min(y0, y1), Math.max(y0, y1)];
    if (right - left < LEAST || bottom - top < LEAST) return this.clear();
    const [wide, high] = this.size;
    const borders = { left: left * wide, right: right * wide, bottom: (1 - bottom) * high, top: (1 - top) * high };
    for (const side of SIDES) this.fields[side].value = this.#text(borders[side]);
    return this.#entered();
  }

  #end(event) {
    this.#drag(event);
    this.from = null;
  }

  /** The borders were entered, or drawn: the region is theirs. */
  #entered() {
    const [left, right, bottom, top] = SIDES.map((side) => this.fields[side].valueAsNumber);
    const [wide, high] = this.size;
    this.#show(left < right && bottom < top ? [left / wide, right / wide, 1 - top / high, 1 - bottom / high] : null);
  }

  #show(shares) {
    this.box.hidden = !shares;
    if (!shares) return this.onDraw(null);
    const [left, right, top, bottom] = shares;
    Object.assign(this.box.style, { left: `${100 * left}%`, top: `${100 * top}%`, width: `${100 * (right - left)}%`, height: `${100 * (bottom - top)}%` });
    return this.onDraw([[left, top], [right, top], [right, bottom], [left, bottom]].map(([x, y]) => this.#place(x, y)));
  }

  /** Point of the scan at shares of the picture's width and height. */
  #place(x, y) {
    const [origin, right, down] = this.corners;
    return origin.map((from, i) => Number((from + x * (right[i] - from) + y * (down[i] - from)).toFixed(this.digits + 1)));
  }

  #text(length) {
    return length.toFixed(this.digits);
  }
}

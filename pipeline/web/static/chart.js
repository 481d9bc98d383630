// Control chart: individual values above, moving ranges below; a point is read by pointer or keyboard.
import { el, language, t, tableOf } from "./base.js";

const NS = "http://www.w3.org/2000/svg";
const LEFT = 62, RIGHT = 14, TOP = 26, GAP = 46, VALUES = 220, RANGES = 110, BOTTOM = 30, MARGIN = 0.08;
const CLOSE = 14, WIDE = 60; // pixels from point to point, below which fewer rules are written

export class ControlChart {
  /** onOpen is called with the key of a capture. */
  constructor(found, onOpen) {
    Object.assign(this, { found, onOpen });
    const last = found.points.length - 1;
    const title = t("chart_of", { name: found.name });
    this.picture = el("div", { class: "chart" });
    this.slider = el("input", { type: "range", min: 0, max: last, step: 1, value: last, class: "along", oninput: () => this.#read(), "aria-label": t("chart_point") });
    this.output = el("p", { class: "reading", "aria-live": "polite" });
    const open = el("button", { type: "button", onclick: () => onOpen(this.point.key) }, t("chart_opens"));
    const broken = found.table.rows.length ? tableOf(found.table, { kind: "broken" }) : el("p", {}, t("no_rules_broken"));
    this.heading = el("h2", { tabindex: "-1" }, title);
    this.element = el("section", {}, this.heading,
      el("dl", { class: "facts" }, ...found.facts.flatMap(([name, value]) => [el("dt", {}, name), el("dd", {}, value)])),
      this.picture, this.slider, this.output, el("p", { class: "buttons left" }, open), el("p", { class: "hint" }, t("chart_hint")), broken);
    for (const [i, cell] of [...this.element.querySelectorAll("tbody th")].entries()) {
      const button = el("button", { type: "button", class: "link", onclick: () => this.#choose(found.broken[i]) }, cell.textContent);
      cell.replaceChildren(button);
    }
    new ResizeObserver(() => this.#draw()).observe(this.picture);
    this.#read();
  }

  get point() {
    return this.found.points[Number(this.slider.value)];
  }

  #choose(index) {
    this.slider.value = index;
    this.#read();
    this.slider.focus();
  }

  /** Say the chosen point, and mark it in the picture. */
  #read() {
    const { name, date, text, range_text: range, says } = this.point;
    const parts = [[date, name].filter(Boolean).join(" "), text, range && t("chart_mean_range", { range }), ...says].filter(Boolean);
    this.output.textContent = parts.join(" · ");
    this.slider.setAttribute("aria-valuetext", parts.join(", "));
    this.#mark();
  }

  #mark() {
    const at = Number(this.slider.value);
    if (!this.cursor) return;
    this.cursor.setAttribute("x1", this.x(at));
    this.cursor.setAttribute("x2", this.x(at));
    for (const one of this.svg.querySelectorAll("circle")) one.classList.toggle("chosen", Number(one.dataset.at) === at);
  }

  #draw() {
    const { points, limits, unit, name } = this.found;
    const width = Math.max(300, Math.floor(this.picture.clientWidth));
    if (width === this.width) return;
    this.width = width;
    const height = TOP + VALUES + GAP + RANGES + BOTTOM;
    this.x = (i) => LEFT + 8 + (points.length > 1 ? i / (points.length - 1) : 0) * (width - LEFT - RIGHT - 16);
    this.svg = svg("svg", { viewBox: `0 0 ${width} ${height}`, width, height, role: "img", "aria-label": t("chart_of", { name }) });
    const values = points.map((point) => point.value);
    this.#panel(`${t("chart_alone")} / ${unit}`, TOP, VALUES, values, [["limit", limits.upper], ["mean", limits.mean], ["limit", limits.lower]], (point) => point.rules.length > 0);
    this.#panel(`${t("chart_range")} / ${unit}`, TOP + VALUES + GAP, RANGES, points.map((point) => point.range), [["limit", limits.range_upper], ["mean", limits.range_mean]], (point) => point.jumps, 0);
    for (const [i, anchor] of [[0, "start"], [points.length - 1, "end"]]) this.#write(this.x(i), height - 10, points[i].date || points[i].name.slice(-16), anchor);
    this.cursor = svg("line", { class: "cursor", y1: TOP, y2: height - BOTTOM });
    this.svg.prepend(this.cursor);
    const nearest = ({ clientX }) => {
      const { left, width: shown } = this.svg.getBoundingClientRect();
      const share = ((clientX - left) * (width / shown) - this.x(0)) / Math.max(1, this.x(points.length - 1) - this.x(0));
      return Math.round(Math.min(1, Math.max(0, share)) * (points.length - 1));
    };
    this.svg.addEventListener("pointermove", (event) => { this.slider.value = nearest(event); this.#read(); });
    this.svg.addEventListener("click", (event) => { this.#choose(nearest(event)); });
    this.picture.replaceChildren(this.svg);
    this.#mark();
  }

  /** One panel: its lines with their values, the curve, and its points, those out of control with their rules. */
  #panel(title, top, height, values, lines, isOut, least = null) {
    const known = values.filter((value) => value !== null);
    const all = [...known, ...lines.map(([, value]) => value)];
    const low = least ?? Math.min(...all), high = Math.max(...all);
    const room = MARGIN * Math.max(high - low, 1e-9);
    const y = (value) => top + height - ((value - low + (least === null ? room : 0)) / (high - low + (least === null ? 2 : 1) * room)) * height;
    const right = this.width - RIGHT;
    this.#write(LEFT, top - 8, title, "start", "title");
    for (const [kind, value] of lines) {
      this.svg.append(svg("line", { class: kind, x1: LEFT, x2: right, y1: y(value), y2: y(value) }));
      this.#write(LEFT - 6, y(value) + 4, value.toLocaleString(language, { maximumSignificantDigits: 4 }), "end");
    }
    const at = values.flatMap((value, i) => (value === null ? [] : [[i, this.x(i), y(value)]]));
    this.svg.append(svg("polyline", { class: "curve", points: at.map(([, x, h]) => `${x.toFixed(1)},${h.toFixed(1)}`).join(" ") }));
    for (const [i, x, h] of at) {
      const point = this.found.points[i];
      const out = isOut(point);
      this.svg.append(svg("circle", { class: out ? "out" : "in", cx: x, cy: h, r: out ? 5 : at.length > 150 ? 1.5 : 3, "data-at": i }));
      if (!out || least !== null) continue;
      const room = at.length > 1 ? at[1][1] - at[0][1] : Infinity;
      if (room < CLOSE && i && isOut(this.found.points[i - 1])) continue; // the first of those in a row is named
      const named = room < WIDE ? point.rules[0] : point.rules.join(",");
      this.#write(x, h + (values[i] >= lines[1][1] ? -9 : 18), named, "middle", "rule");
    }
  }

  #write(x, y, text, anchor, kind = "tick") {
    const written = svg("text", { class: kind, x, y, "text-anchor": anchor });
    written.textContent = text;
    this.svg.append(written);
  }
}

function svg(tag, attributes) {
  const element = document.createElementNS(NS, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  return element;
}

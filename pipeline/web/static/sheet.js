// Readings of the machine beside the points that were measured, and what they show so far.
import { el, machine, select, t } from "./base.js";

const WAYS = ["up", "down"];
const MOST_REPEATS = 100;
const FORM = { repeats: 3, directions: false }; // of an empty one

/** Readings by state, series, operator, quantity, point, repeat and direction. */
export class Sheet {
  constructor(onChange) {
    this.onChange = onChange;
    this.place = el("div", { class: "sheet" });
    this.readings = new Map();
    this.units = {};
    this.sheets = [];
    this.at = { state: machine.states[0][0], series: "1", operator: "" };
    Object.assign(this, FORM);
  }

  get stored() {
    const { units, at, repeats, directions } = this;
    return { readings: [...this.readings], units, at, repeats, directions };
  }

  restore({ readings, ...others }) {
    Object.assign(this, others, { readings: new Map(readings) });
  }

  /** Take the rows of a table, no two of one repeat and each quantity in one unit, in the place of all readings. */
  load(rows) {
    this.readings.clear();
    this.built = null;
    Object.assign(this, FORM, { units: {} });
    for (const row of rows) {
      const one = Object.fromEntries(machine.columns.map((column, i) => [column, row[i]]));
      const [quantity, unit, state, direction] = ["quantity", "unit", "state", "direction"].map((key) => one[key].toLowerCase());
      Object.assign(one, { quantity, unit, direction, state: state.replace(/[-_]/g, " ") });
      this.readings.set(keyOf(one), one);
      this.units[one.quantity] ||= one.unit;
      this.directions ||= one.direction !== "";
      this.repeats = Math.min(MOST_REPEATS, Math.max(this.repeats, Number(one.repeat) || 0));
    }
    const [first] = this.readings.values();
    if (first) this.at = { state: first.state, series: first.series, operator: first.operator };
  }

  /** Rows in the order of the form: the same readings give the same table, however they were typed. */
  rows() {
    const kinds = this.sheets.map(({ kind }) => kind);
    const places = Object.fromEntries(this.sheets.map(({ kind, points }) => [kind, points.map(({ point }) => point)]));
    const last = (index) => (index < 0 ? Infinity : index);
    const rank = (one) => [last(machine.states.findIndex(([state]) => state === one.state)), one.series, one.operator,
      last(kinds.indexOf(one.quantity)), last((places[one.quantity] ?? []).indexOf(one.point)), Number(one.repeat), last(WAYS.indexOf(one.direction))];
    this.sent = [...this.readings.values()].map((one) => [rank(one), one]).sort(([a], [b]) => compare(a, b)).map(([, one]) => one);
    return this.sent.map((one) => machine.columns.map((column) => one[column] ?? ""));
  }

  /** Show the points of the item's quantities; anew only where they differ, so that the focus stays. */
  show({ sheets, points = [], faults = [] }) {
    this.sheets = sheets;
    if (this.#layout !== this.built) this.#build();
    this.#showPoints(points);
    return this.#showFaults(faults);
  }

  /** What the elements depend on, apart from the values in them. */
  get #layout() {
    return JSON.stringify([this.sheets, this.at, this.repeats, this.directions, this.units]);
  }

  #build() {
    this.built = this.#layout;
    this.lines = new Map();
    this.place.replaceChildren(this.#head(), ...this.sheets.map((sheet) => this.#quantity(sheet)));
  }

  #head() {
    const series = el("input", { name: "series", value: this.at.series, maxlength: "40", required: true, onchange: ({ target }) => this.#go({ series: target.value.trim() || "1" }, "series") });
    const operator = el("input", { name: "operator", value: this.at.operator, maxlength: "80", autocomplete: "off", onchange: ({ target }) => this.#go({ operator: target.value.trim() }, "operator") });
    const repeats = el("input", { name: "repeats", type: "number", min: "1", max: MOST_REPEATS, value: this.repeats, onchange: ({ target }) => this.#form({ repeats: Math.min(MOST_REPEATS, Math.max(1, Math.round(target.valueAsNumber) || 1)) }, "repeats") });
    const both = el("input", { name: "directions", type: "checkbox", checked: this.directions, onchange: ({ target }) => this.#form({ directions: target.checked }, "directions") });
    const own = [...new Map([...this.readings.values()].map((one) => [sheetOf(one), one])).values()];
    const others = own.filter((one) => sheetOf(one) !== sheetOf(this.at)).map((one) => el("button", { type: "button", onclick: () => this.#go(one, "series") }, nameOf(one)));
    return el("div", {},
      el("div", { class: "fields" },
        select("state", t("state"), machine.states, this.at.state, (state) => this.#go({ state }, "state")),
        el("label", {}, t("series"), series), el("label", {}, t("operator"), operator), el("label", {}, t("repeats"), repeats),
        el("label", { class: "tick" }, both, t("directions"))),
      others.length ? el("p", { class: "buttons left" }, `${t("also_read")} `, ...others) : null);
  }

  #go({ state, series, operator }, name) {
    this.at = { state: state ?? this.at.state, series: series ?? this.at.series, operator: operator ?? this.at.operator };
    this.#again(name);
  }

  #form(change, name) {
    Object.assign(this, change);
    this.#again(name);
  }

  #again(name) {
    this.onChange();
    this.#build();
    this.place.querySelector(`[name=${name}]`)?.focus();
  }

  #quantity({ kind, mpe, points }) {
    const { name, units } = machine.quantities.find((one) => one.kind === kind);
    const more = [...this.readings.values()].filter((one) => one.quantity === kind && !points.some(({ point }) => point === one.point));
    const all = [...points, ...[...new Set(more.map(({ point }) => point))].map((point) => ({ point, name: point, reference: "" }))];
    const choose = (unit) => {
      this.units[kind] = unit;
      for (const one of this.readings.values()) if (one.quantity === kind) one.unit = unit;
      this.#again(`unit_${kind}`);
    };
    return el("section", { "aria-label": name },
      el("div", { class: "quantity" }, el("h4", {}, name), mpe ? el("span", { class: "small" }, `${t("mpe")} ${mpe}`) : null,
        select(`unit_${kind}`, t("reading_unit"), [["", "…"], ...units.map((unit) => [unit, unit])], this.units[kind] ?? "", choose)),
      el("ul", { class: "readings" }, ...all.map((point) => this.#point(kind, name, point))));
  }

  #point(kind, quantity, { point, name, reference }) {
    const ways = this.directions ? WAYS : [""];
    const cells = [];
    const line = { cells: new Map(), found: el("div", { class: "found" }), fault: el("p", { class: "fault", id: `fault-${kind}-${this.lines.size}` }) };
    for (let repeat = 1; repeat <= this.repeats; repeat++) for (const direction of ways) {
      const one = { ...this.at, quantity: kind, point, repeat: String(repeat), direction };
      const input = el("input", { value: this.readings.get(keyOf(one))?.value, maxlength: "40", autocomplete: "off", disabled: !this.units[kind], oninput: ({ target }) => this.#enter(one, target.value.trim()), onkeydown: next });
      line.cells.set(keyOf(one), input);
      cells.push(el("label", { class: "cell" }, el("span", {}, el("span", { class: "unseen" }, `${quantity}, ${name}, `), `${repeat}${direction && ` ${t(direction)}`}`), input));
    }
    this.lines.set(`${kind} ${point}`, line);
    return el("li", {}, el("div", {}, el("b", {}, name), el("span", { class: "small" }, reference && `${t("reference")} ${reference}`)), el("div", { class: "cells" }, ...cells), line.found, line.fault);
  }

  #enter(one, value) {
    const key = keyOf(one);
    const before = this.readings.get(key);
    if (value) this.readings.set(key, { ...one, note: "", ...before, value, unit: this.units[one.quantity] });
    else this.readings.delete(key);
    this.onChange();
  }

  #showPoints(points) {
    const known = new Map(points.filter(({ state }) => state === this.at.state).map((one) => [`${one.quantity} ${one.point}`, one]));
    for (const [key, { found }] of this.lines) {
      const one = known.get(key);
      found.replaceChildren(...(one ? [
        el("span", {}, t("error_of", { error: one.error })), " ", el("span", {}, `U ${one.expanded}`), " ",
        one.decision ? el("span", { class: `verdict ${one.decision.kind}` }, one.decision.text) : ""] : []));
    }
  }

  /** Show each fault beside its row; return those of the table, and of rows that are not in sight. */
  #showFaults(faults) {
    const others = [];
    const of = new Map([...this.lines.values()].map((line) => [line, []]));
    for (const { cells } of this.lines.values()) for (const input of cells.values()) mark(input, null);
    for (const { row, text } of faults) {
      const one = row === null ? null : this.sent[row];
      const line = one && this.lines.get(`${one.quantity} ${one.point}`);
      const input = line?.cells.get(keyOf(one));
      if (input) {
        mark(input, line.fault.id);
        of.get(line).push(`${one.repeat}${one.direction && ` ${t(one.direction)}`}: ${text}`);
      } else others.push(one ? `${nameOf(one)}: ${one.quantity}, ${one.point}, ${one.repeat}: ${text}` : text);
    }
    for (const [line, texts] of of) line.fault.replaceChildren(...texts.flatMap((text, i) => (i ? [el("br"), text] : [text])));
    return others;
  }
}

const keyOf = ({ state, series, operator, quantity, point, repeat, direction }) => JSON.stringify([state, series, operator, quantity, point, repeat, direction]);
const sheetOf = ({ state, series, operator }) => JSON.stringify([state, series, operator]);

function nameOf({ state, series, operator }) {
  const [, text] = machine.states.find(([each]) => each === state) ?? [state, state];
  return [text, `${t("series")} ${series}`, operator].filter(Boolean).join(", ");
}

function compare(a, b) {
  for (const [i, one] of a.entries()) if (one !== b[i]) return one < b[i] ? -1 : 1;
  return 0;
}

function mark(input, fault) {
  if (fault) {
    input.setAttribute("aria-invalid", "true");
    input.setAttribute("aria-describedby", fault);
  } else {
    input.removeAttribute("aria-invalid");
    input.removeAttribute("aria-describedby");
  }
}

/** Enter goes to the next reading. */
function next(event) {
  if (event.key !== "Enter") return;
  const all = [...event.target.closest(".sheet").querySelectorAll(".cell input:enabled")];
  all[all.indexOf(event.target) + 1]?.focus();
}

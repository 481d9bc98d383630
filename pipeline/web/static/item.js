// The machine under test: what it declares of its readings, and the decision rule.
import { el, machine, select, t } from "./base.js";

const NAMEPLATE = ["maker", "model", "serial", "software", "rim"];
const SIZES = ["resolution", "mpe", "uncertainty"];
const RULES = [["guarded", "rule_guarded"], ["simple", "rule_simple"], ["shared", "rule_shared"]];
const HINTS = { rad: { resolution: "0.1'", mpe: "4'", uncertainty: "2'" }, m: { resolution: "1 mm", mpe: "2 mm", uncertainty: "1 mm" } };
const OF_RULE = { guarded: "confidence", shared: "ratio" };
const DEFAULTS = { confidence: 0.95, ratio: 3 };

/** Form of an item file; `tree` is its content, as the server reads it. */
export class ItemForm {
  constructor(onChange) {
    this.onChange = onChange;
    this.tree = { item: {} };
    this.place = el("div", { class: "item" });
    this.#build();
  }

  /** Show an item that was loaded. */
  show(tree) {
    this.tree = tree;
    this.#build();
  }

  #set(table, key, value) {
    if (value === "" || value === undefined) delete table[key];
    else table[key] = value;
    this.onChange();
  }

  #build() {
    const { item } = this.tree;
    const ticks = machine.quantities.map(({ kind, name }) => el("label", {},
      el("input", { type: "checkbox", checked: kind in item, onchange: ({ target }) => this.#tick(kind, target) }), name));
    this.place.replaceChildren(
      el("div", { class: "fields" }, ...NAMEPLATE.map((key) => this.#text(item, key))),
      el("fieldset", { class: "ticks" }, el("legend", {}, t("indicates")), ...ticks),
      ...machine.quantities.filter(({ kind }) => kind in item).map((quantity) => this.#quantity(quantity)),
      this.#rule());
  }

  #tick(kind, { checked }) {
    const own = this.tree.item;
    if (checked) own[kind] = {};
    else delete own[kind];
    this.#build();
    this.place.querySelectorAll(".ticks input")[machine.quantities.findIndex((one) => one.kind === kind)].focus();
    this.onChange();
  }

  #quantity({ kind, name, unit, axis, senses }) {
    const stated = this.tree.item[kind];
    const list = (key, text, options) => this.#list(stated, key, text, options);
    const needsAxis = axis || stated.definition === "iso";
    return el("fieldset", { class: "fields" }, el("legend", {}, name),
      ...SIZES.map((key) => this.#text(stated, key, HINTS[unit][key])),
      senses.length ? list("positive", t("positive"), senses) : null,
      kind === "camber" ? this.#definition(stated) : null,
      needsAxis ? list("axis", t("from_axis"), machine.axes) : null,
      kind === "toe_out_on_turns" ? this.#number(stated, "inner_deg") : null);
  }

  /** The definition of camber: only as projected (iso) does it depend on an axis. */
  #definition(stated) {
    const choose = (value) => {
      if (value !== "iso") delete stated.axis;
      this.#set(stated, "definition", value);
      this.#build();
      this.place.querySelector("select[name=definition]").focus();
    };
    return select("definition", t("definition"), [["", "…"], ...machine.definitions], stated.definition ?? "", choose);
  }

  #rule() {
    const { decision } = this.tree;
    const choose = (rule) => {
      if (rule) this.tree.decision = { rule, ...(OF_RULE[rule] && { [OF_RULE[rule]]: DEFAULTS[OF_RULE[rule]] }) };
      else delete this.tree.decision;
      this.#build();
      this.place.querySelector("select[name=rule]").focus();
      this.onChange();
    };
    const options = [["", t("none")], ...RULES.map(([rule, word]) => [rule, t(word)])];
    const key = decision && OF_RULE[decision.rule];
    return el("div", { class: "fields" }, select("rule", t("rule"), options, decision?.rule ?? "", choose),
      key ? this.#number(decision, key) : null);
  }

  #list(table, key, text, options) {
    return select(key, text, [["", "…"], ...options], table[key] ?? "", (value) => this.#set(table, key, value));
  }

  #text(table, key, hint = { rim: "16in" }[key]) {
    const change = ({ target }) => this.#set(table, key, target.value.trim());
    return el("label", {}, t(key), el("input", { name: key, value: table[key], placeholder: hint, maxlength: "100", autocomplete: "off", oninput: change }));
  }

  #number(table, key) {
    const change = ({ target }) => this.#set(table, key, Number.isNaN(target.valueAsNumber) ? "" : target.valueAsNumber);
    return el("label", {}, t(key), el("input", { name: key, type: "number", step: "any", value: table[key], oninput: change }));
  }
}

// Results of a batch: captures, failures, trends, calibrations of machines, runs at work.
import { ask, el, pathOf, select, t, tableOf } from "./base.js";
import { Browser } from "./browser.js";

const PARTS = ["captures", "failures", "trends", "calibrations", "runs"];

export class Archive {
  constructor(place) {
    this.place = place;
  }

  /** Browse the results at {root, path}; null: select a folder first. */
  async show(at) {
    if (!at && this.at) return;
    this.at = at;
    this.filter = {};
    this.part = "captures";
    if (!at) return this.#choose();
    try {
      this.overview = await this.#ask("overview");
      this.#build();
    } catch (error) {
      this.#fail(error);
    }
  }

  #choose() {
    const list = el("div");
    this.place.replaceChildren(el("div", { class: "card" }, el("p", { class: "hint" }, t("archive_hint")), list));
    const open = ({ root, path }) => { location.hash = `#archive=${root}/${encodeURIComponent(path)}`; };
    return new Browser(list, open, (kind) => kind === "results").start();
  }

  #address(question, asked = {}) {
    const given = new URLSearchParams({ ...this.filter, ...asked });
    return `/api/${question}/${this.at.root}/${pathOf(this.at.path)}?${given}`;
  }

  #ask(question, asked) {
    return ask(this.#address(`archive/${question}`, asked));
  }

  #build() {
    const { total, statuses, vehicles } = this.overview;
    this.list = el("div", { class: "card" });
    this.detail = el("div", { "aria-live": "polite" });
    const tile = (text, count) => el("div", { class: "tile" }, el("b", {}, String(count)), text);
    const filter = el("form", { class: "filters", onsubmit: (event) => this.#apply(event) },
      el("label", {}, t("search"), el("input", { name: "text", autocomplete: "off" })),
      select("status", t("status"), [["", t("all")], ...statuses.map(([status, text]) => [status, text])], ""),
      select("vehicle", t("vehicle"), [["", t("all")], ...vehicles.map((name) => [name, name])], ""),
      el("button", { class: "main" }, t("apply")));
    this.place.replaceChildren(
      el("p", {}, el("b", {}, this.at.path || "/"), " ", el("button", { type: "button", onclick: () => { this.at = null; location.hash = "#archive"; } }, t("choose_folder"))),
      el("div", { class: "tiles" }, tile(t("captures"), total), ...statuses.filter(([, , count]) => count).map(([, text, count]) => tile(text, count))),
      el("div", { class: "card" }, filter, el("div", { class: "tabs", role: "group" }, ...PARTS.map((part) =>
        el("button", { type: "button", "data-part": part, onclick: () => this.#show(part) }, t(part))))),
      this.list, this.detail);
    this.form = filter;
    this.#show(total ? "captures" : "runs");
  }

  #apply(event) {
    event.preventDefault();
    this.filter = Object.fromEntries(new FormData(event.target));
    this.#show(this.part);
  }

  async #show(part, asked = {}) {
    this.part = part;
    this.detail.replaceChildren();
    for (const button of this.place.querySelectorAll("[data-part]")) button.setAttribute("aria-pressed", String(button.dataset.part === part));
    try {
      const found = await this.#ask(part, asked);
      if (part !== this.part) return; // another was chosen meanwhile
      if (part === "runs") {
        this.#showRuns(found);
        return;
      }
      const { table } = found;
      this.list.replaceChildren(table.rows.length ? tableOf(table) : el("p", { class: "empty" }, t("no_rows")));
      if (part === "captures") this.#addPages(found);
      const open = {
        captures: (i) => this.#open("capture", found.keys[i]),
        trends: (i) => this.#plot(found.quantities[i]),
        calibrations: (i) => this.#open("calibration", found.keys[i]),
      }[part];
      if (open) link(this.list, open);
    } catch (error) {
      this.#fail(error);
    }
  }

  /** Show the state of each run, and ask again later, unless something else is shown by then. */
  #showRuns({ runs, renewed_s: seconds }) {
    const buttons = () => [...this.list.querySelectorAll("button")];
    const focused = buttons().indexOf(document.activeElement);
    this.list.replaceChildren(...runs.map((run) => this.#run(run)),
      el("p", { class: runs.length ? "hint" : "empty" }, runs.length ? t("run_hint", { seconds }) : t("run_none")));
    buttons()[focused]?.focus();
    this.#renewIn(seconds);
  }

  #renewIn(seconds) {
    clearTimeout(this.timer);
    const { list } = this;
    this.timer = setTimeout(() => {
      if (this.part !== "runs" || !list.isConnected) return;
      if (list.checkVisibility() && !document.hidden) this.#show("runs");
      else this.#renewIn(seconds);
    }, 1000 * seconds);
  }

  #run({ name, up, facts, work, failures, statuses }) {
    const failed = failures ? tableOf(failures) : null;
    if (failed) link(failed, (i) => this.#showFailed(statuses[i]));
    return el("section", { class: up ? "run up" : "run" }, el("h2", {}, name), factsOf(facts), work ? tableOf(work) : null, failed);
  }

  /** List the captures of a status, each of which opens its account. */
  #showFailed(status) {
    this.form.elements.status.value = status;
    this.filter = Object.fromEntries(new FormData(this.form));
    this.#show("captures");
  }

  #addPages({ offset, total, keys }) {
    const go = (text, to, usable) => el("button", { type: "button", disabled: !usable, onclick: () => this.#show("captures", { offset: to }) }, t(text));
    const size = Math.max(keys.length, 1);
    this.list.append(el("div", { class: "pages" }, go("previous", Math.max(0, offset - 50), offset > 0),
      el("span", {}, t("of_rows", { first: Math.min(offset + 1, total), last: offset + keys.length, total })),
      go("next", offset + size, offset + keys.length < total)));
  }

  async #open(question, key) {
    const { name, facts, tables, certificate, why } = await this.#ask(question, { key });
    const open = el("a", { href: this.#address("archive-certificate", { key }), target: "_blank", rel: "noopener" }, t("show_certificate"));
    this.#reveal(el("h2", { tabindex: "-1" }, name),
      factsOf(facts), ...tables.map((table) => tableOf(table)), certificate ? el("p", {}, open) : "",
      why ? el("details", { open: true }, el("summary", {}, t("account")), el("pre", { class: "account", tabindex: "0" }, why)) : "");
  }

  #plot(quantity) {
    const picture = el("img", { class: "trend", alt: `${t("drift")}: ${quantity}`, src: this.#address("archive-plot", { quantity }) });
    picture.addEventListener("error", () => picture.replaceWith(el("p", { class: "empty" }, t("no_trend"))));
    this.#reveal(el("h2", { tabindex: "-1" }, quantity), picture);
  }

  #reveal(title, ...content) {
    this.detail.replaceChildren(el("div", { class: "card" }, title, ...content));
    title.focus();
  }

  #fail(error) {
    this.place.replaceChildren(el("div", { class: "card trouble", role: "alert" }, el("p", {}, error.message)),
      el("button", { type: "button", onclick: () => { this.at = null; this.#choose(); } }, t("choose_folder")));
  }
}

function factsOf(facts) {
  return el("dl", { class: "facts" }, ...facts.flatMap(([label, value]) => [el("dt", {}, label), el("dd", {}, value)]));
}

/** Make the first cell of every row a button. */
function link(place, open) {
  for (const [i, cell] of [...place.querySelectorAll("tbody th")].entries()) {
    cell.replaceChildren(el("button", { type: "button", class: "link", onclick: () => open(i) }, cell.textContent));
  }
}

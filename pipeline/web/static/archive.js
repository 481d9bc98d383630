// Results of a batch: captures, failures, trends, calibrations of machines, runs at work.
import { addressOf, archiveAddress, go } from "./address.js";
import { ask, el, pathOf, select, t, tableOf, whileShown } from "./base.js";
import { Browser } from "./browser.js";
import { ControlChart } from "./chart.js";

const PARTS = ["captures", "failures", "trends", "charts", "calibrations", "runs"];

export class Archive {
  /** onAddress is called with the address of what is browsed. */
  constructor(place, onAddress) {
    this.place = place;
    this.onAddress = onAddress;
  }

  /** Browse the results at {root, path}, as the query of the address says; null: select a folder first. */
  async show(at, query = {}) {
    this.view = {};
    if (!at) {
      this.at = null;
      return this.#choose();
    }
    this.onAddress(location.hash);
    const { part, key, quantity, offset, ...filter } = query;
    const isSame = this.built?.root === at.root && this.built.path === at.path && this.form.isConnected;
    Object.assign(this, { at, filter });
    try {
      if (!isSame) {
        this.overview = await this.#ask("overview");
        this.#build();
      }
      for (const field of ["text", "status", "vehicle", "vertical"].filter((name) => name in this.form.elements)) this.form.elements[field].value = filter[field] ?? "";
      const shown = PARTS.includes(part) ? part : this.overview.total ? "captures" : "runs";
      const list = JSON.stringify([shown, filter, offset]);
      if (!isSame || list !== this.listed) {
        this.listed = null;
        await this.#show(shown, { offset: offset ?? 0 });
        this.listed = list;
      }
      if (shown === "charts") await this.#chart(quantity);
      else if (key) await this.#open(shown === "calibrations" ? "calibration" : "capture", key);
      else if (quantity) this.#plot(quantity);
      else this.detail.replaceChildren();
    } catch (error) {
      this.#fail(error);
    }
    return null;
  }

  /** Go to another part, filter, page or item of these results. */
  #go(change) {
    go(archiveAddress(this.at, { ...this.filter, part: this.part, ...change }));
  }

  #choose() {
    const list = el("div");
    this.place.replaceChildren(el("div", { class: "card" }, el("p", { class: "hint" }, t("archive_hint")), list));
    return new Browser(list, (place) => go(archiveAddress(place)), (kind) => kind === "results").start();
  }

  #address(question, asked = {}) {
    const given = new URLSearchParams({ ...this.filter, ...asked });
    return `/api/${question}/${this.at.root}/${pathOf(this.at.path)}?${given}`;
  }

  /** Ask about these results, for the view that is shown now. */
  #ask(question, asked) {
    const { view } = this;
    return whileShown(ask(this.#address(`archive/${question}`, asked)), () => view === this.view);
  }

  #build() {
    const { total, statuses, vehicles, verticals } = this.overview;
    this.list = el("div", { class: "card" });
    this.detail = el("div", { "aria-live": "polite" });
    const tile = (text, count) => el("div", { class: "tile" }, el("b", {}, String(count)), text);
    const filter = el("form", { class: "filters", onsubmit: (event) => this.#apply(event) },
      el("label", {}, t("search"), el("input", { name: "text", autocomplete: "off" })),
      select("status", t("status"), [["", t("all")], ...statuses.map(([status, text]) => [status, text])], ""),
      select("vehicle", t("vehicle"), [["", t("all")], ...vehicles.map((name) => [name, name])], ""),
      verticals.length > 1 ? select("vertical", t("option_vertical"), [["", t("all")], ...verticals], "") : null,
      el("button", { class: "main" }, t("apply")));
    this.place.replaceChildren(
      el("p", {}, el("b", {}, this.at.path || "/"), " ", el("button", { type: "button", onclick: () => this.#leave() }, t("choose_folder"))),
      el("div", { class: "tiles" }, tile(t("captures"), total), ...statuses.filter(([, , count]) => count).map(([, text, count]) => tile(text, count))),
      el("div", { class: "card" }, filter, el("div", { class: "tabs", role: "group" }, ...PARTS.map((part) =>
        el("button", { type: "button", "data-part": part, onclick: () => this.#go({ part }) }, t(part))))),
      this.list, this.detail);
    this.form = filter;
    this.built = this.at;
  }

  #leave() {
    this.onAddress("#archive");
    go("#archive");
  }

  #apply(event) {
    event.preventDefault();
    this.filter = Object.fromEntries(new FormData(event.target));
    this.listed = null;
    this.#go({});
  }

  async #show(part, asked = {}) {
    this.part = part;
    this.detail.replaceChildren();
    for (const button of this.place.querySelectorAll("[data-part]")) button.setAttribute("aria-pressed", String(button.dataset.part === part));
    if (part === "charts") return;
    try {
      const found = await this.#ask(part, asked);
      if (part === "runs") {
        this.#showRuns(found);
        return;
      }
      const { table } = found;
      this.list.replaceChildren(noteOf(found), table.rows.length ? tableOf(table, { kind: part }) : el("p", { class: "empty" }, t("no_rows")));
      if (part === "captures") {
        this.list.append(...found.doubts.map((text) => el("p", { class: "note" }, text)));
        this.#addPages(found);
      }
      const open = {
        captures: (i) => this.#go({ key: found.keys[i], offset: asked.offset || "" }),
        trends: (i) => this.#go({ quantity: found.quantities[i] }),
        calibrations: (i) => this.#go({ key: found.keys[i] }),
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
    this.#go({ part: "captures" });
  }

  #addPages({ offset, total, keys }) {
    const go = (text, to, usable) => el("button", { type: "button", disabled: !usable, onclick: () => this.#go({ offset: to }) }, t(text));
    const size = Math.max(keys.length, 1);
    this.list.append(el("div", { class: "pages" }, go("previous", Math.max(0, offset - 50), offset > 0),
      el("span", {}, t("of_rows", { first: Math.min(offset + 1, total), last: offset + keys.length, total })),
      go("next", offset + size, offset + keys.length < total)));
  }

  /** The control chart of a quantity, with the choice of another one. */
  async #chart(quantity) {
    const { quantities } = this.overview;
    const chosen = quantities.some(([name]) => name === quantity) ? quantity : quantities[0]?.[0];
    this.list.replaceChildren(quantities.length ? select("quantity", t("quantity"), quantities, chosen, (name) => this.#go({ quantity: name })) : el("p", { class: "empty" }, t("no_rows")));
    if (!chosen) return;
    const answer = await this.#ask("chart", { quantity: chosen }).catch((error) => error);
    if (answer instanceof Error) {
      this.detail.replaceChildren(el("div", { class: "card" }, el("p", {}, answer.message)));
      return;
    }
    const chart = new ControlChart(answer, (key) => this.#go({ part: "captures", key }));
    this.detail.replaceChildren(el("div", { class: "card" }, noteOf(answer), chart.element));
  }

  /** Before and after: what changed since an earlier capture of the same vehicle. */
  #changes(key, before) {
    if (!before.length) return [];
    const table = el("div");
    const show = async (earlier) => {
      this.earlier = earlier;
      const found = await whileShown(this.#ask("changes", { key, before: earlier }), () => earlier === this.earlier);
      table.replaceChildren(tableOf(found.table));
    };
    const refused = (error) => table.replaceChildren(el("p", { role: "alert" }, error.message));
    show(before[0][0]).catch(refused);
    return [select("earlier", t("before_of"), before, before[0][0], (earlier) => show(earlier).catch(refused)), table];
  }

  async #open(question, key) {
    const { name, facts, tables, certificate, why, record, before = [] } = await this.#ask(question, { key });
    const [root, path] = [this.at.root, this.at.path ? `${this.at.path}/${record}` : record];
    const view = record ? el("p", { class: "buttons left" }, el("a", { class: "button", href: addressOf({ at: `${root}/${path}` }) }, t("open_record"))) : "";
    const open = el("a", { href: this.#address("archive-certificate", { key }), target: "_blank", rel: "noopener" }, t("show_certificate"));
    this.#reveal(el("h2", { tabindex: "-1" }, name),
      factsOf(facts), view, ...tables.map((table) => tableOf(table)), certificate ? el("p", {}, open) : "", ...this.#changes(key, before),
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
      el("button", { type: "button", onclick: () => this.#leave() }, t("choose_folder")));
  }
}

/** Why numbers of these captures are not to be compared, if so. */
function noteOf({ notice }) {
  return notice ? el("p", { class: "note" }, notice) : "";
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

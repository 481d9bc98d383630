// Calibration of a machine against the measurement: item, readings, what they show, files.
import { ask, called, el, pathOf, post, select, send, session, t, tableOf } from "./base.js";
import { ItemForm } from "./item.js";
import { Sheet } from "./sheet.js";

const PAUSE_MS = 250; // after the last key
const MOST_LISTED = 8;

export class Machine {
  constructor(job) {
    this.job = job;
    this.item = new ItemForm(() => this.#later());
    this.sheet = new Sheet(() => this.#later());
    this.certificate = "";
    this.references = []; // names of the measurements of series 2, 3, ...
    this.series = el("div", { class: "filters" });
    this.fault = el("p", { class: "status bad", role: "status" });
    this.state = el("div", { class: "status", role: "status" });
    this.others = el("ul", { class: "faults" });
    this.tables = el("div");
    this.saved = el("p", { class: "status", role: "status" });
    this.folder = el("select", { name: "root" });
    this.name = el("input", { name: "name", value: t("calibration_name"), maxlength: "100", autocomplete: "off", required: true });
    ask("/api/folders").then(({ folders }) => this.folder.append(...folders.map((folder, i) => el("option", { value: i }, folder))));
    this.card = el("details", { class: "card", id: "machine", open: this.#restore() }, el("summary", {}, t("machine")),
      el("p", { class: "hint" }, t("machine_hint")),
      el("h3", {}, t("item")), this.#picker(t("load_item"), ".toml", (file) => this.#loadItem(file)), this.item.place, this.fault,
      this.series, el("h3", {}, t("readings")), this.#picker(t("load_readings"), ".csv,.xlsx", (file) => this.#loadReadings(file)), this.sheet.place, this.others,
      this.state, this.tables,
      el("h3", {}, t("save_calibration")), this.#picker(t("load_certificate"), ".toml", (file) => this.#loadCertificate(file)),
      el("p", { class: "hint" }, t("certificate_hint")),
      el("form", { class: "save", onsubmit: (event) => this.#save(event) },
        el("label", {}, t("new_folder"), this.name), el("label", {}, t("save_folder"), this.folder),
        el("button", { class: "main" }, t("save_in"))), el("div", {}, this.saved));
    session.listeners.push(() => this.#offer());
    this.#offer();
    if (this.card.open) this.#later();
  }

  /** Offer another measurement for each further series; none: the first is the reference of all. */
  #offer() {
    const known = session.jobs.filter(({ id }) => id !== this.job.id);
    this.references = this.references.filter((id) => known.some((one) => one.id === id));
    const options = [["", t("same_reference")], ...known.map((job) => [job.id, called(job)])];
    const shown = known.length ? [...this.references, ""] : [];
    this.series.replaceChildren(...shown.map((id, i) => {
      const row = select(`reference-${i + 2}`, t("series_reference", { series: i + 2 }), options, id);
      row.addEventListener("change", ({ target }) => this.#refer(i, target.value));
      return row;
    }));
  }

  #refer(i, id) {
    this.references = id ? [...this.references.slice(0, i), id, ...this.references.slice(i + 1)] : this.references.slice(0, i);
    this.#offer();
    this.#later();
  }

  get #key() {
    return `machine-${this.job.id}`;
  }

  /** Take what was entered before the page was loaded anew; return whether there was any. */
  #restore() {
    const before = JSON.parse(sessionStorage.getItem(this.#key) ?? "null");
    if (!before) return false;
    this.item.show(before.item);
    this.sheet.restore(before.sheet);
    this.certificate = before.certificate;
    this.references = before.references ?? [];
    return true;
  }

  get #entered() {
    return { item: this.item.tree, readings: this.sheet.rows(), certificate: this.certificate, references: this.references };
  }

  /** Ask the server once no key was pressed for a moment. */
  #later() {
    sessionStorage.setItem(this.#key, JSON.stringify({ item: this.item.tree, sheet: this.sheet.stored, certificate: this.certificate, references: this.references }));
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.#evaluate(this.#entered), PAUSE_MS);
  }

  /** Show what the readings show so far; the answer to an earlier state is dropped. */
  async #evaluate(entered) {
    const turn = (this.turn = (this.turn ?? 0) + 1);
    try {
      const found = await post(`/api/jobs/${this.job.id}/calibration`, entered);
      if (turn === this.turn) this.#show(found);
      return found;
    } catch (error) {
      this.fault.textContent = error.message;
      return null;
    }
  }

  #show(found) {
    this.fault.textContent = found.item_faults.join(" ");
    if (!found.item) return;
    const others = this.sheet.show(found);
    const more = others.length > MOST_LISTED ? [t("more_faults", { count: others.length - MOST_LISTED })] : [];
    this.others.replaceChildren(...[...others.slice(0, MOST_LISTED), ...more].map((text) => el("li", {}, text)));
    this.state.replaceChildren(...[
      found.decision && el("span", { class: `verdict ${found.decision.kind}` }, found.decision.text),
      ...(found.warnings ?? []).map((text) => el("p", { class: "note" }, text))].filter(Boolean));
    this.tables.replaceChildren(...found.results.map(({ table, lines }) =>
      el("div", {}, tableOf(table), ...(lines.length ? [el("p", { class: "small" }, lines.join(". "))] : []))),
    found.rule ? el("p", { class: "small" }, found.rule) : "");
  }

  #picker(text, accept, onFile) {
    const input = el("input", { type: "file", accept, hidden: true, "aria-label": text, onchange: async ({ target }) => {
      const [file] = target.files;
      target.value = "";
      if (file) await onFile(file);
    } });
    return el("p", { class: "buttons left" }, el("button", { type: "button", onclick: () => input.click() }, text), input);
  }

  async #loadItem(file) {
    const found = await this.#evaluate({ ...this.#entered, item: await file.text() });
    if (!found?.item) return;
    this.item.show(found.item);
    this.#later();
  }

  async #loadReadings(file) {
    this.fault.textContent = "";
    try {
      const { rows } = await send(`/api/jobs/${this.job.id}/readings/${pathOf(file.name)}`, file, () => {});
      this.sheet.load(rows);
      this.#later();
    } catch (error) {
      this.others.replaceChildren(...error.message.split("; ").map((text) => el("li", {}, text)));
    }
  }

  async #loadCertificate(file) {
    this.certificate = await file.text();
    this.saved.className = "status good";
    this.saved.textContent = t("loaded", { name: file.name });
    this.#later();
  }

  async #save(event) {
    event.preventDefault();
    this.saved.className = "status";
    this.saved.textContent = t("making");
    try {
      const { saved } = await post(`/api/jobs/${this.job.id}/calibration/save`, { ...this.#entered, root: Number(this.folder.value), name: this.name.value });
      const open = el("a", { href: `/api/jobs/${this.job.id}/certificate.html`, target: "_blank", rel: "noopener" }, t("show_certificate"));
      this.saved.replaceChildren(`${t("saved", { path: saved })} `, open);
      this.saved.classList.add("good");
    } catch (error) {
      this.saved.textContent = error.message;
      this.saved.classList.add("bad");
    }
  }
}

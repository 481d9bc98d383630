// Step 3: save the report in a chosen format and under a chosen name.
import { ask, byId, el, post, t } from "./base.js";

const FORMATS = ["html", "pdf", "txt", "json"];

export class Saver {
  /** view: of the report; onSaved is called once it is saved. A comparison has another name than its job. */
  constructor(job, view, onSaved, name = job.name) {
    Object.assign(this, { job, view, onSaved });
    this.name = el("input", { name: "name", value: stem(name), maxlength: "110", autocomplete: "off", required: true });
    this.format = el("select", { name: "format" }, ...FORMATS.map((each) => el("option", { value: each }, t(each === "html" && job.task === "compare" ? "format_page" : `format_${each}`))));
    this.folder = el("select", { name: "root" });
    this.status = el("p", { class: "status", role: "status" });
    ask("/api/folders").then(({ folders }) => this.folder.append(...folders.map((folder, i) => el("option", { value: i }, folder))));
    const form = el("form", { class: "save", onsubmit: (event) => this.#keep(event) },
      el("label", {}, t("save_name"), this.name), el("label", {}, t("save_format"), this.format),
      el("label", {}, t("save_folder"), this.folder),
      el("button", { class: "main" }, t("save_in")),
      el("button", { type: "button", onclick: () => this.#download() }, t("save_download")),
      el("button", { type: "button", onclick: () => this.#open() }, t("show_report")));
    this.card = el("section", { class: "card", "aria-labelledby": `save-${job.id}` }, el("h2", { id: `save-${job.id}` }, t(job.task === "compare" ? "save_comparison" : "save")), form, this.status);
  }

  get file() {
    const { value } = this.format;
    return this.name.value.toLowerCase().endsWith(`.${value}`) ? this.name.value : `${this.name.value}.${value}`;
  }

  async #keep(event) {
    event.preventDefault();
    await this.#report(async () => {
      const { saved } = await post(`/api/jobs/${this.job.id}/save`, { ...this.view(), format: this.format.value, root: Number(this.folder.value), name: this.file });
      return t("saved", { path: saved });
    });
  }

  async #download() {
    await this.#report(async () => {
      const answer = await this.#fetch();
      const link = el("a", { href: URL.createObjectURL(await answer.blob()), download: this.file });
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
      return t("saved", { path: this.file });
    });
  }

  #open() {
    window.open(this.#address(), "_blank", "noopener");
    this.onSaved();
  }

  #address() {
    return `/api/jobs/${this.job.id}/report.${this.format.value}?${new URLSearchParams(this.view())}`;
  }

  async #fetch() {
    const answer = await fetch(this.#address());
    if (!answer.ok) throw new Error((await answer.json()).error);
    return answer;
  }

  async #report(work) {
    this.status.className = "status";
    this.status.textContent = t("making");
    try {
      this.status.textContent = await work();
      this.status.classList.add("good");
      this.onSaved();
    } catch (error) {
      this.status.textContent = error.message;
      this.status.classList.add("bad");
    }
  }
}

export function stem(name) {
  const last = name.split("/").at(-1).replace(/\.\w{1,4}$/, "");
  return last.replace(/[^\p{L}\p{N} _-]/gu, "-").slice(0, 60) || "report";
}

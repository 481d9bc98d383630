// Comparison of two results of this session.
import { ask, byId, called, el, follow, post, select, session, t, tableOf } from "./base.js";

export class Comparer {
  constructor() {
    this.place = byId("compare");
    session.listeners.push(() => this.#build());
    this.#build();
  }

  #build() {
    const measured = session.jobs;
    const hint = el("p", { class: "hint" }, t("compare_hint"));
    if (measured.length < 2) return this.place.replaceChildren(hint, el("p", {}, el("a", { href: "#measure" }, t("measure"))));
    const options = measured.map((job) => [job.id, called(job)]);
    this.found ??= el("div");
    const form = el("form", { class: "filters", onsubmit: (event) => this.#compare(event) },
      select("first", t("first"), options, options[1][0]), select("second", t("second"), options, options[0][0]),
      el("button", { class: "main" }, t("do_compare")));
    return this.place.replaceChildren(hint, form, this.found);
  }

  async #compare(event) {
    event.preventDefault();
    const chosen = Object.fromEntries(new FormData(event.target));
    this.found.replaceChildren(el("p", { role: "status" }, t("starting")));
    try {
      const job = await follow(await post("/api/compare", chosen), () => {});
      if (job.state !== "done") throw new Error(job.failure?.text ?? t("cancelled"));
      this.#show(await ask(`/api/jobs/${job.id}/comparison.json`));
    } catch (error) {
      this.found.replaceChildren(el("div", { class: "trouble card", role: "alert" }, el("p", {}, error.message)));
    }
  }

  #show({ verdict, table, lengths, text, missing }) {
    const kind = { agree: "conform", disagree: "not-conform" }[verdict] ?? "undecided";
    this.found.replaceChildren(
      el("p", {}, el("span", { class: `verdict ${kind}` }, t(verdict.replace(" ", "_")))),
      tableOf(table, { kind: "compared" }),
      el("p", { class: "hint" }, t("signs")),
      tableOf(lengths),
      ...(missing.length ? [el("h3", {}, t("only_in_one")), ...missing.map(({ name, reason }) => el("p", {}, `${name}: ${reason}`))] : []),
      el("details", {}, el("summary", {}, t("details")), el("pre", { class: "text", tabindex: "0" }, text)));
  }
}

// Comparison of two measurements.
import { go } from "./address.js";
import { ask, byId, called, el, follow, language, post, select, session, t, tableOf, whileShown } from "./base.js";
import { Saver, stem } from "./save.js";

export class Comparer {
  constructor() {
    this.place = byId("compare");
    this.pair = "";
    session.listeners.push(() => this.#build());
    this.#build();
  }

  /** Compare the pair `id,id`; '' leaves the choice to the user. */
  show(pair) {
    if (!pair || pair === this.pair) return null;
    this.pair = pair;
    this.#build();
    return this.#compare(pair);
  }

  #build() {
    const measured = session.jobs;
    const hint = el("p", { class: "hint" }, t("compare_hint"));
    if (measured.length < 2) return this.place.replaceChildren(hint, el("p", {}, el("a", { href: "#measure" }, t("measure"))));
    const options = measured.map((job) => [job.id, called(job)]);
    const [first = options[1][0], second = options[0][0]] = this.pair ? this.pair.split(",") : [];
    this.found ??= el("div");
    const form = el("form", { class: "filters", onsubmit: (event) => this.#submit(event) },
      select("first", t("first"), options, first), select("second", t("second"), options, second),
      el("button", { class: "main" }, t("do_compare")));
    return this.place.replaceChildren(hint, form, this.found);
  }

  #submit(event) {
    event.preventDefault();
    const chosen = new FormData(event.target);
    this.pair = "";
    go(`#compare=${chosen.get("first")},${chosen.get("second")}`);
  }

  async #compare(pair) {
    this.found ??= el("div");
    this.found.replaceChildren(el("p", { role: "status" }, t("starting")));
    try {
      this.#show(...await whileShown(this.#compared(pair.split(",")), () => pair === this.pair));
    } catch (error) {
      this.found.replaceChildren(el("div", { class: "trouble card", role: "alert" }, el("p", {}, error.message)));
    }
  }

  async #compared([first, second]) {
    const job = await follow(await post("/api/compare", { first, second }), () => {});
    if (job.state !== "done") throw new Error(job.failure?.text ?? t("cancelled"));
    return [await ask(`/api/jobs/${job.id}/comparison.json`), job];
  }

  #show({ verdict, table, lengths, text, doubts, missing, names }, job) {
    const kind = { agree: "conform", disagree: "not-conform" }[verdict] ?? "undecided";
    this.found.replaceChildren(
      el("p", {}, el("span", { class: `verdict ${kind}` }, t(verdict.replace(" ", "_")))),
      ...doubts.map((doubt) => el("p", { class: "note" }, doubt)),
      tableOf(table, { kind: "compared" }),
      el("p", { class: "hint" }, t("signs")),
      tableOf(lengths),
      ...(missing.length ? [el("h3", {}, t("only_in_one")), ...missing.map(({ name, reason }) => el("p", {}, `${name}: ${reason}`))] : []),
      new Saver(job, () => ({ language }), () => {}, names.map(stem).join(" - ")).card,
      el("details", {}, el("summary", {}, t("details")), el("pre", { class: "text", tabindex: "0" }, text)));
  }
}

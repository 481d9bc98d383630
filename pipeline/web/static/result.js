// Steps 2 and 3: table of angles, 3D view, details of a wheel, report.
import { ServerError, ask, byId, called, dayOf, el, follow, language, post, select, session, t, tableOf, viewerWords, whileShown } from "./base.js";
import { Machine } from "./machine.js";
import { Saver } from "./save.js";
import { streamPoints } from "./stream.js";

const STYLES = [["dms", "unit_dms"], ["deg", "unit_deg"], ["mm/m", "unit_mmm"]];
const STATUS = 3; // column of the table of wheels

export class Result {
  /** onOpen is called with another measurement to show; without one, to measure another. */
  constructor(onOpen, onStep) {
    this.place = byId("result");
    this.onOpen = onOpen;
    this.onStep = onStep;
    this.style = "dms";
    this.axis = "rear-axle";
    this.convention = "default";
  }

  async show(job) {
    if (job.id === this.job?.id) return;
    this.viewer?.dispose();
    this.job = job;
    this.chosen = null;
    this.stop?.abort();
    this.stop = new AbortController();
    const parts = ["panel", "scene"].map((kind) => ask(`/api/jobs/${job.id}/${kind}-${language}.json`));
    const [panel, scene] = await whileShown(Promise.all(parts), () => job === this.job);
    this.panel = panel;
    this.viewer = null;
    this.#build();
    this.place.hidden = false;
    this.onStep(2);
    this.viewer = Wheelplane3D.mount(this.stage, scene, { words: viewerWords, onWheel: (name) => this.choose(name) });
    this.#label();
    if (scene.cloud) this.#stream();
    byId("result-title").focus();
  }

  /** Show the details of a wheel, and mark it everywhere. */
  choose(name) {
    this.chosen = name;
    this.viewer.mark(name);
    for (const row of this.place.querySelectorAll("tr[data-wheel]")) row.classList.toggle("chosen", row.dataset.wheel === name);
    const wheel = this.panel.wheels.find((each) => each.name === name);
    if (!wheel) return;
    this.evidence.replaceChildren(
      el("div", { class: "result-head" }, el("h2", { tabindex: "-1" }, t("evidence", { name })),
        el("button", { type: "button", onclick: () => this.viewer.focus(name) }, t("view_3d"))),
      ...this.panel.troubles.filter((trouble) => trouble.name === name).map(troubleOf),
      factsOf(wheel.facts),
      ...wheel.drawings.map(({ file, title }) => el("img", { src: `/api/jobs/${this.job.id}/${file}`, alt: title })));
    this.evidence.scrollTop = 0;
  }

  #build() {
    const { headline, joint, notes, troubles, head } = this.panel;
    this.stage = el("div", { class: "stage" });
    this.evidence = el("aside", { class: "card evidence", "aria-live": "polite" }, el("p", { class: "hint" }, t("wheel_hint")));
    this.angles = el("div");
    this.meaning = el("p", { class: "small", role: "status" });
    this.axles = el("div", { class: "pair" });
    this.others = el("div");
    this.count = el("span", { role: "status" });
    this.coming = el("p", { class: "small" }, this.count);
    this.saver = new Saver(this.job, () => ({ axis: this.axis, style: this.style, convention: this.convention, language, before: this.earlier ?? "" }), () => this.onStep(3));
    const assessed = headline.kind !== "none";
    this.place.replaceChildren(
      el("div", { class: "card" },
        el("div", { class: "result-head" },
          el("h2", { id: "result-title", tabindex: "-1" }, called(this.job)),
assessed ? el("span", { class: `verdict ${headline.kind}` }, `${headline.sign} ${headline.title}`) : null,
          el("span", { class: "tools" }, this.#before(), el("button", { type: "button", onclick: () => this.onOpen() }, t("another")))),
...(assessed ? [el("p", { class: "says" }, [...headline.says, joint].join(" "))] : []),
        el("div", { class: "tools" },
          select("style", t("unit"), STYLES.map(([value, word]) => [value, t(word)]), this.style, (value) => this.#setView({ style: value })),
          select("axis", t("axis"), Object.entries(this.panel.axes), this.axis, (value) => this.#setView({ axis: (this.ownAxis = value) })),
          select("convention", t("convention"), Object.keys(this.panel.conventions).map((name) => [name, t(`convention_${name.replace("-", "_")}`)]), this.convention, (value) => this.#follow(value))),
        this.meaning,
        this.angles,
        ...troubles.map(troubleOf)),
      el("div", { class: "look" }, el("div", {}, this.stage, this.coming), this.evidence),
      notes.length ? el("div", { class: "card" }, ...notes.map((note) => el("p", { class: "note" }, note))) : "",
      this.#change() ?? "",
      this.saver.card,
      new Machine(this.job).card,
      this.axles,
      this.others,
      el("details", { class: "card" }, el("summary", {}, t("more")), factsOf(head)));
    this.#setView({});
  }

  /** Before and after: what changed since an earlier measurement of the vehicle, which reports then show, too. */
  #change() {
    this.earlier = "";
    const others = session.jobs.filter(({ id, vehicle }) => vehicle && vehicle === this.job.vehicle && id !== this.job.id);
    if (!others.length) return null;
    const table = el("div", { "aria-live": "polite" });
    const show = async (id) => {
      this.earlier = id;
      if (!id) return table.replaceChildren();
      const asked = ask(`/api/jobs/${this.job.id}/changes?before=${id}`).catch((error) => error);
      const answer = await whileShown(asked, () => id === this.earlier);
      if (answer instanceof Error) return table.replaceChildren(el("p", { role: "alert" }, answer.message));
      const { caption } = answer.table;
      return table.replaceChildren(tableOf({ ...answer.table, caption: caption === t("before_after") ? "" : caption }));
    };
    return el("section", { class: "card", "aria-labelledby": "change-title" }, el("h2", { id: "change-title" }, t("before_after")),
      select("earlier", t("before_of"), [["", "…"], ...others.map((job) => [job.id, `${called(job)}, ${dayOf(job)}`])], "", show), table);
  }

  /** Follow a convention, from its own axis where the user has chosen none. */
  #follow(convention) {
    const axis = this.ownAxis ?? (convention === "default" ? "rear-axle" : "centreline");
    this.place.querySelector("select[name=axis]").value = axis;
    this.#setView({ convention, axis });
  }

  /** Show the tables in another unit, relative to another axis, or with the signs of another convention. */
  #setView(change) {
    Object.assign(this, change);
    const [wheels, ...others] = this.#inView("tables");
    const whole = wheels.classes.every((kind) => kind !== "bad");
    const table = tableOf(wheels, { kind: "angles", hidden: whole ? [STATUS] : [] });
    for (const [i, row] of [...table.querySelectorAll("tbody tr")].entries()) {
      const { name } = this.panel.wheels[i];
      row.dataset.wheel = name;
      row.classList.toggle("chosen", name === this.chosen);
      row.querySelector("th").replaceChildren(el("button", { type: "button", onclick: () => this.choose(name) }, wheels.rows[i][0]));
    }
    this.meaning.textContent = this.panel.conventions[this.convention];
    this.angles.replaceChildren(table);
    this.axles.replaceChildren(...others.map(cardOf));
    this.others.replaceChildren(...[this.#inView("limits"), ...this.#inView("extra")].filter(Boolean).map(cardOf));
    this.#label();
  }

  /** Part of the panel in the unit, axis and convention that are chosen; one kept by an earlier version has but one. */
  #inView(part) {
    return this.panel[part]?.[this.convention]?.[this.axis][this.style] ?? this.panel[part];
  }

  /** Write the angles in the 3D view as in the table. */
  #label() {
    this.viewer?.rewrite(this.#inView("labels") ?? {});
  }

  #before() {
    const others = session.jobs.filter(({ id }) => id !== this.job.id);
    if (!others.length) return null;
    const open = (id) => this.onOpen(session.jobs.find((job) => job.id === id));
    return select("before", t("session"), [["", "…"], ...others.map((job) => [job.id, called(job)])], "", open);
  }

  /** Give way to step 1; whether a result was shown. */
  leave() {
    if (!this.job) return false;
    this.stop.abort();
    this.viewer?.dispose();
    this.viewer = this.job = null;
    this.place.hidden = true;
    return true;
  }

  /** Show all points in place of the sample once the measuring process has sorted them. */
  async #stream() {
    const { viewer, stop, job, coming, count } = this;
    const cancel = el("button", { type: "button", onclick: () => { cancel.remove(); post(`/api/jobs/${job.id}/cancel`); } }, t("cancel"));
    const say = (text) => { if (count.textContent !== text) count.textContent = text; };
    const lose = (reason) => say(t("points_missing", { reason }));
    if (job.state === "ready") coming.append(" ", cancel);
    const ended = await follow(job, ({ state, progress: { done } }) => { if (state === "ready") say(t("points_coming", { share: done })); }, (state) => state !== "ready");
    cancel.remove();
    if (stop.signal.aborted) return;
    if (ended.note) return lose(ended.note);
    say("");
    try {
      await streamPoints(`/api/jobs/${job.id}`, viewer, stop.signal, (error) => lose(error.message));
    } catch (error) {
      if (!(error instanceof ServerError)) throw error;
      lose(error.message);
    }
  }
}

function cardOf(table) {
  return el("div", { class: "card" }, tableOf(table));
}

function factsOf(pairs) {
  return el("dl", { class: "facts" }, ...pairs.flatMap(([name, value]) => [el("dt", {}, name), el("dd", {}, value)]));
}

function troubleOf({ name, status, means, said, todo }) {
  return el("div", { class: "note" }, el("b", {}, `${name}: ${status}. `), `${means} ${todo}`, said ? el("p", { class: "small" }, said) : null);
}

// Step 1: upload files that are dropped or chosen, or browse for them, and measure.
import { ServerError, byId, called, dayOf, el, follow, language, limits, pathOf, pause, post, send, session, t } from "./base.js";
import { Browser } from "./browser.js";
import { Found } from "./found.js";
import { inWordsOfThePage } from "./fields.js";

const BUSY = 503; // the queue is full
const AGAIN_MS = 2000;
const LONG_BYTES = 50e6; // an upload before which the options are asked
const KNOWN = new RegExp(`\\.(${limits.suffixes.join("|")})$`, "i");

export class Loader {
  constructor(onResult, onBatch) {
    this.onResult = onResult;
    this.onBatch = onBatch;
    this.browser = new Browser(byId("browser"), (item) => this.open(item));
    this.browser.start().catch((error) => this.fail({ text: error.message }));
    for (const [button, input] of [["choose-files", "files"], ["choose-folder", "folder"]]) {
      byId(button).addEventListener("click", () => byId(input).click());
      byId(input).addEventListener("change", ({ target }) => {
        this.#upload([...target.files].map((file) => ({ file, path: file.webkitRelativePath || file.name })));
        target.value = "";
      });
    }
    this.found = new Found((job, options) => this.#again(job, options));
    session.listeners.push(() => this.#showBefore());
    byId("cancel").addEventListener("click", () => this.#cancel());
    this.#takeDrops();
  }

  /** Measure an item of an allowed folder; results of a batch are browsed instead. */
  open({ kind, root, path, name }) {
    if (kind === "results") this.onBatch({ root, path });
    else this.#measure({ root, path }, name ?? path);
  }

  /** Give way to a result. */
  hide() {
    byId("load").hidden = byId("trouble").hidden = byId("busy").hidden = true;
  }

  /** Return to step 1. */
  reset() {
    byId("load").hidden = false;
    byId("trouble").hidden = true;
    byId("choose-files").focus();
  }

  /** List the earlier measurements. */
  #showBefore() {
    if (!session.jobs.length) return byId("before").replaceChildren();
    const open = (job) => el("button", { type: "button", class: "open", onclick: () => this.onResult(job) },
      el("span", { class: "name" }, called(job)), el("span", { class: "kind" }, [job.vehicle, dayOf(job)].filter(Boolean).join(", ")));
    const item = (job) => el("li", { class: job.kept ? "kept" : null }, open(job), job.kept ? this.#removal(job) : null);
    return byId("before").replaceChildren(el("h2", { tabindex: "-1" }, t("session")), el("p", { class: "hint" }, t(limits.kept ? "session_kept" : "session_ends")),
      el("ul", { class: "items" }, ...session.jobs.map(item)));
  }

  /** Button that removes a kept measurement, once that is confirmed. */
  #removal(job) {
    const first = el("button", { type: "button", class: "remove", "aria-label": t("remove_of", { name: called(job) }), onclick: () => ask(true) }, t("remove"));
    const sure = el("button", { type: "button", class: "remove sure", onclick: () => remove() }, t("remove_sure"));
    const question = el("p", { class: "note", hidden: true }, t("remove_ask", { name: called(job) }), " ", sure, " ", el("button", { type: "button", onclick: () => ask(false) }, t("remove_not")));
    const ask = (asked) => {
      question.hidden = !asked;
      (asked ? sure : first).focus();
    };
    const remove = async () => {
      try {
        await post(`/api/jobs/${job.id}/remove`);
        session.remove(job.id);
        (byId("before").querySelector("h2") ?? byId("choose-files")).focus();
      } catch (error) {
        question.replaceChildren(el("span", { role: "alert" }, error.message));
      }
    };
    const both = document.createDocumentFragment();
    both.append(first, question);
    return both;
  }

  #takeDrops() {
    const veil = byId("veil");
    const files = (event) => event.dataTransfer?.types.includes("Files");
    addEventListener("dragover", (event) => {
      if (!files(event)) return;
      event.preventDefault();
      veil.hidden = false;
    });
    addEventListener("dragleave", (event) => { if (!event.relatedTarget) veil.hidden = true; });
    addEventListener("drop", async (event) => {
      if (!files(event)) return;
      event.preventDefault();
      veil.hidden = true;
      location.hash = "#measure";
      const entries = [...event.dataTransfer.items].map((item) => item.webkitGetAsEntry?.()).filter(Boolean);
      const loose = [...event.dataTransfer.files].map((file) => ({ file, path: file.name }));
      this.#upload(entries.length ? (await Promise.all(entries.map((entry) => filesOf(entry)))).flat() : loose);
    });
  }

  async #upload(files) {
    const known = files.filter(({ path }) => KNOWN.test(path) && !/(^|\/)\./.test(path));
    const large = known.find(({ file }) => file.size > limits.bytes);
    if (!known.length) return this.fail({ text: t("nothing_known") });
    if (large) return this.fail({ text: t("too_large", { name: large.path, most: (limits.bytes / 1e9).toPrecision(2) }) });
    const total = known.reduce((sum, { file }) => sum + file.size, 0);
    if (total > LONG_BYTES) this.#askFirst(known, total);
    else await this.#send(known, total);
  }

  /** Ask for the options of an upload that takes long, and begin it then. */
  #askFirst(known, total) {
    this.reset();
    byId("ask")?.remove();
    const words = { name: known[0].path.split("/")[0], size: Math.round(total / 1e6).toLocaleString(language) };
    const close = () => byId("ask").remove();
    byId("options").append(el("div", { class: "note", id: "ask" }, el("p", { role: "status" }, t("ask_first", words)), el("p", { class: "buttons left" },
      el("button", { type: "button", class: "main", onclick: () => { close(); this.#send(known, total); } }, t("begin_upload")),
      el("button", { type: "button", onclick: () => { close(); byId("choose-files").focus(); } }, t("cancel")))));
    byId("options").open = true;
    byId("fields").elements.target.focus();
  }

  async #send(known, total) {
    this.#busy(known[0].path.split("/")[0]);
    try {
      const { upload } = await post("/api/uploads");
      let sent = 0;
      for (const { file, path } of known) {
        if (this.cancelled) return this.#stopped();
        await send(`/api/uploads/${upload}/${pathOf(path)}`, file, (share) => this.#progress((sent + share * file.size) / Math.max(1, total), t("sending", { name: path })), this.sending.signal);
        sent += file.size;
      }
      if (this.cancelled) return this.#stopped();
      await this.#measure({ upload }, known.length === 1 ? known[0].path : known[0].path.split("/")[0]);
    } catch (error) {
      this.#failOrStop(error);
    }
  }

  #measure(source, name) {
    const options = Object.fromEntries(new FormData(byId("fields")));
    return this.#run(name, options, null, "/api/measure", { ...source, options });
  }

  /** Measure the capture of a failed job again, with other options. */
  #again(job, options) {
    return this.#run(job.name, options, null, `/api/jobs/${job.id}/again`, { options });
  }

  /** Go on with a measurement that was at work when the page was opened. */
  resume(job) {
    return this.#run(job.name, {}, job);
  }

  async #run(name, options, job, address, given) {
    this.#busy(name);
    try {
      this.job = job ?? await this.#begin(address, given);
      byId("busy-name").textContent = this.job.name;
      if (this.cancelled) await this.#cancel();
      const ended = await follow(this.job, (job) => this.#showState(job), (state) => state !== "waiting" && state !== "running");
      if (ended.state === "failed") this.fail(ended.failure, this.#nextSteps(ended, options));
      else if (ended.state === "cancelled") this.#stopped();
      else this.#done(ended);
    } catch (error) {
      if (!(error instanceof ServerError)) throw error;
      this.#failOrStop(error);
    }
  }

  /** Show every candidate in the scans of a failed job. */
  async #explain(failed, options) {
    this.#busy(failed.name);
    try {
      this.job = await this.#begin(`/api/jobs/${failed.id}/explain`, {});
      const ended = await follow(this.job, (job) => this.#showState(job, "found_explaining"));
      if (ended.state === "done") {
        this.fail(failed.failure, await this.found.show(failed, options, ended));
      } else if (ended.failure) this.fail(ended.failure);
      else this.#stopped();
    } catch (error) {
      if (!(error instanceof ServerError)) throw error;
      this.#failOrStop(error);
    }
  }

  /** Start a job as soon as the queue has room. */
  async #begin(address, given) {
    for (;;) {
      try {
        return await post(address, given);
      } catch (error) {
        if (error.status !== BUSY) throw error;
        this.#progress(null, t("waiting"));
        await pause(AGAIN_MS);
        if (this.cancelled) throw new ServerError(t("cancelled"));
      }
    }
  }

  #showState({ state, progress: { done, total, text } }, doing = "measuring") {
    if (state === "waiting") this.#progress(null, t("waiting"));
    else if (!total) this.#progress(null, t("starting"));
    else this.#progress(done / total, t(doing, { name: text, done: done + 1, total }));
  }

  /** Cancel the job, or, before the server has returned it, as soon as it does. */
  async #cancel() {
    this.cancelled = true;
    this.sending.abort();
    if (this.job) await post(`/api/jobs/${this.job.id}/cancel`);
  }

  #busy(name) {
    this.job = null;
    this.cancelled = false;
    this.sending = new AbortController();
    byId("busy-name").textContent = name;
    byId("busy").hidden = false;
    byId("load").hidden = byId("trouble").hidden = true;
    byId("result").hidden = true;
    this.#progress(null, t("starting"));
    byId("cancel").focus();
  }

  #progress(share, text) {
    const bar = byId("progress");
    if (share === null) bar.removeAttribute("value");
    else bar.value = share;
    if (byId("busy-text").textContent !== text) byId("busy-text").textContent = text;
  }

  #failOrStop(error) {
    if (this.cancelled) this.#stopped();
    else this.fail({ text: error.message });
  }

  /** Return to step 1 after the user cancelled: that is no failure. */
  #stopped() {
    byId("busy").hidden = true;
    byId("load").hidden = false;
    byId("trouble").hidden = false;
    byId("trouble").classList.remove("trouble");
    byId("trouble").replaceChildren(el("p", {}, t("cancelled")));
    byId("trouble").focus();
  }

  /** Show a failure, and below it what can be done; the field that it names is opened. */
  fail(failure, more = null) {
    byId("busy").hidden = true;
    byId("load").hidden = false;
    byId("trouble").hidden = false;
    byId("trouble").classList.add("trouble");
    const { text, field } = inWordsOfThePage(failure.text);
    byId("trouble").replaceChildren(el("h2", {}, t("could_not")), el("p", {}, text), ...(failure.lines ? excerpt(failure) : []), more ?? "");
    const input = field && byId("fields").elements[field];
    if (input) input.closest("details").open = true;
    (input ?? byId("trouble")).focus();
  }

  /** Buttons after a failure: what was found in the scans, and another try with the options as they are then. */
  #nextSteps(failed, options) {
    if (failed.failure.lines) return null;
    const again = () => this.#again(failed, { ...options, ...Object.fromEntries(new FormData(byId("fields"))) });
    return el("p", { class: "buttons" },
      el("button", { type: "button", id: "why", onclick: () => this.#explain(failed, options) }, t("found_why")),
      el("button", { type: "button", id: "retry", onclick: again }, t("retry")));
  }

  #done(job) {
    byId("busy").hidden = true;
    session.add(job);
    this.onResult(job);
  }
}

/** Lines of the file around the error. */
function excerpt({ file, first, last, lines }) {
  const title = first === last ? t("wrong_line", { file, line: first }) : t("wrong_lines", { file, first, last });
  const rows = lines.map(([number, text]) => el("tr", { class: number >= first && number <= last ? "wrong" : null }, el("th", { scope: "row" }, String(number)), el("td", {}, text || " ")));
  return [el("h3", {}, title), el("table", { class: "lines", "aria-label": title }, el("tbody", {}, ...rows))];
}

/** All files of a dropped file or folder, recursively. */
async function filesOf(entry, path = entry.name) {
  if (entry.isFile) return [{ file: await new Promise((resolve, reject) => entry.file(resolve, reject)), path }];
  const reader = entry.createReader();
  const entries = [];
  for (;;) {
    const more = await new Promise((resolve, reject) => reader.readEntries(resolve, reject));
    if (!more.length) break;
    entries.push(...more);
  }
  return (await Promise.all(entries.map((each) => filesOf(each, `${path}/${each.name}`)))).flat();
}

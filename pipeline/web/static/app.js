// Views of the page, and the selection of the one shown.
import { byId, language, post, session } from "./base.js";
import { Archive } from "./archive.js";
import { Comparer } from "./compare.js";
import { Loader } from "./load.js";
import { Result } from "./result.js";

const VIEWS = ["measure", "compare", "archive"];

const result = new Result(() => { history.replaceState(null, "", "#measure"); loader.reset(); step(1); }, step);
const loader = new Loader((job) => show(job), (place) => { location.hash = `#archive=${place.root}/${place.path}`; });
const archive = new Archive(byId("archive"));
new Comparer();

function step(number) {
  for (const [i, item] of [...byId("steps").children].entries()) {
    item.classList.toggle("done", i + 1 < number);
    if (i + 1 === number) item.setAttribute("aria-current", "step");
    else item.removeAttribute("aria-current");
  }
}

/** Show a result at its address, which a reload and the language keep. */
function show(job) {
  history.replaceState(null, "", `#result=${job.id}`);
  return result.show(job);
}

/** `#open=0/path` measures at once, `#archive=0/path` browses results, `#result=id` shows an earlier
 *  measurement; otherwise the view of that name is shown. */
function route() {
  const [name, place] = decodeURIComponent(location.hash.slice(1)).split(/=(.*)/s);
  const [, root, path] = /^(\d+)\/(.*)$/s.exec(place ?? "") ?? [];
  const view = VIEWS.includes(name) ? name : "measure";
  for (const each of VIEWS) byId(`view-${each}`).hidden = each !== view;
  for (const link of document.querySelectorAll("nav a")) {
    if (link.hash === `#${view}`) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
  if (name === "open" && root !== undefined) {
    history.replaceState(null, "", "#measure");
    loader.open({ root: Number(root), path, name: path });
  }
  const before = name === "result" && session.jobs.find(({ id }) => id === place);
  if (before && before.id !== result.job?.id) result.show(before);
  if (view === "archive") archive.show(root === undefined ? null : { root: Number(root), path });
}

byId("language").addEventListener("change", async ({ target }) => {
  await post(`/api/language/${target.value}`);
  if (!byId("result").hidden && !byId("view-measure").hidden) location.hash = `#result=${result.job.id}`;
  location.reload();
});
addEventListener("hashchange", route);
document.documentElement.lang = language;
session.start().catch(() => {}).finally(() => { route(); if (session.running) loader.resume(session.running); }); // if the server does not respond, the list of folders reports it

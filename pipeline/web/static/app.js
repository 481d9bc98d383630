// Views of the page, and the selection of the one shown.
import { addressOf, archiveAddress, folderOf, go, here } from "./address.js";
import { byId, language, post, session, t } from "./base.js";
import { Archive } from "./archive.js";
import { Comparer } from "./compare.js";
import { Loader } from "./load.js";
import { Result } from "./result.js";

const VIEWS = ["measure", "compare", "archive"];

const result = new Result((job) => go(job ? addressOf(job) : "#measure"), step);
const loader = new Loader(arrive, (place) => go(archiveAddress(place)));
const archive = new Archive(byId("archive"), (address) => { document.querySelector("nav a[href^='#archive']").href = address; });
const comparer = new Comparer();

function step(number) {
  for (const [i, item] of [...byId("steps").children].entries()) {
    item.classList.toggle("done", i + 1 < number);
    if (i + 1 === number) item.setAttribute("aria-current", "step");
    else item.removeAttribute("aria-current");
  }
}

/** `#open=0/path` measures or opens a file at once, `#result=id` shows an earlier measurement,
 *  `#compare=id,id` compares two, `#archive=0/path` browses results; otherwise the view of that name. */
function route() {
  const { view: name, place, query } = here();
  const view = VIEWS.includes(name) ? name : "measure";
  for (const each of VIEWS) byId(`view-${each}`).hidden = each !== view;
  for (const link of document.querySelectorAll("nav a")) {
    if (link.hash.split("=")[0] === `#${view}`) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
  if (view === "archive") archive.show(folderOf(place), query);
  else if (view === "compare") comparer.show(place);
  else measure(name, place);
}

function measure(name, place) {
  const known = session.jobs.find((job) => (name === "open" ? job.at === place : name === "result" && job.id === place));
  if (known) {
    loader.hide();
    result.show(known);
    return;
  }
  if (result.leave()) {
    loader.reset();
    step(1);
  }
  if (name === "result") loader.fail({ text: t("gone") });
  const at = name === "open" && folderOf(place);
  if (at && !session.running) loader.open({ ...at, name: at.path });
}

/** Show a result at its address, which takes the place of the one that was to be opened. */
function arrive(job) {
  if (here().view !== "open") return go(addressOf(job));
  history.replaceState(null, "", addressOf(job));
  return route();
}

/** Go on with the measurement that was at work when the page was opened. */
function resume() {
  const { running } = session;
  session.running = null;
  if (running) loader.resume(running);
}

byId("language").addEventListener("change", async ({ target }) => {
  await post(`/api/language/${target.value}`);
  location.reload();
});
addEventListener("hashchange", route);
document.documentElement.lang = language;
session.start().catch(() => {}).finally(() => { route(); resume(); }); // if the server does not respond, the list of folders reports it

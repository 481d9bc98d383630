// What was found in the scans of a failed measurement, and the choice of the targets among it.
import { ask, el, t } from "./base.js";
import { inWordsOfThePage } from "./fields.js";
import { Region } from "./region.js";

const WHEELS = ["RR", "RL", "FR", "FL"];

export class Found {
  /** onAgain is called with the failed job and the options that hold the choice. */
  constructor(onAgain) {
    this.onAgain = onAgain;
  }

  /** Element with the explanation of a failed job: scans that failed first, then the others. */
  async show(failed, options, explained) {
    this.address = `/api/jobs/${explained.id}`;
    this.chosen = {}; // points on targets, and below regions, by the name of their scan or wheel
    this.drawn = {};
    this.regions = {};
    const { scans, length_unit: unit } = await ask(`${this.address}/explanation.json`);
    const lost = scans.filter(({ status }) => status !== "ok");
    const others = scans.filter(({ status }) => status === "ok");
    this.cloud = scans.some(({ role }) => role === "vehicle");
    this.unit = unit;
    this.options = options;
    this.trouble = el("p", { role: "status" });
    this.repeat = el("details", { hidden: true }, el("summary", {}, t("found_repeat")), el("pre", { class: "text", tabindex: "0" }));
    const again = () => this.#again(failed, options);
    this.onFront = (front) => this.onAgain(failed, { ...options, front });
    return el("section", { class: "looked" }, el("h3", {}, t("found_title")), el("p", { class: "hint" }, t("found_hint")),
      ...lost.map((scan) => this.#scan(scan)),
      el("p", { class: "buttons" }, el("button", { type: "button", class: "main", id: "again", onclick: again }, t("found_again"))), this.trouble, this.repeat,
      others.length ? el("details", {}, el("summary", {}, t("found_others")), ...others.map((scan) => this.#scan(scan))) : null);
  }

  #again(failed, options) {
    const named = Object.keys(this.chosen).length;
    const isWhole = named ? !this.cloud || named === WHEELS.length : Object.keys(this.drawn).length > 0;
    if (!isWhole) {
      this.trouble.textContent = t(this.cloud ? "found_name_all" : "found_choose_one");
      return;
    }
    this.onAgain(failed, { ...options, ...this.#choices() });
  }

  /** All choices, those of earlier tries as well; the latest of a scan is the one that counts. */
  #choices() {
    const kept = (earlier, later) => Object.fromEntries(Object.entries(earlier ?? {}).filter(([name]) => !(name in later)));
    const isNamed = this.cloud && Object.keys(this.chosen).length > 0; // named wheels need no region
    return {
      hints: { ...kept(this.options.hints, this.drawn), ...this.chosen },
      regions: isNamed ? {} : { ...kept(this.options.regions, this.chosen), ...this.drawn },
    };
  }

  /** Something was chosen, or no longer: what was asked for is, and the lines for capture.toml are those of all choices. */
  #changed() {
    this.trouble.textContent = "";
    const { hints, regions } = this.#choices();
    const lines = [...new Set([...Object.keys(hints), ...Object.keys(regions)])].map((name) => [
      `[hints.${/^[\w-]+$/.test(name) ? name : JSON.stringify(name)}]`,
      ...(hints[name] ? [`near = [${hints[name].replaceAll(",", ", ")}]`] : []),
      ...(regions[name] ? [`region = [\n${regions[name].map((corner) => `  [${corner.join(", ")}],\n`).join("")}]`] : [])].join("\n"));
    this.repeat.hidden = !lines.length;
    this.repeat.querySelector("pre").textContent = lines.join("\n\n");
  }

  /** A region was drawn in a scan, or none any longer; it takes the place of a chosen candidate. */
  #draw(scan, corners) {
    if (corners) {
      this.drawn[scan.name] = corners;
      delete this.chosen[scan.name];
      for (const field of document.getElementsByName(`found-${scan.name}`)) field.checked = false;
    } else delete this.drawn[scan.name];
    this.#changed();
  }

  #scan(scan) {
    const [seen, best] = scan.pictures;
    const picture = seen ? this.#picture(scan, seen) : null;
    if (picture && scan.picture_corners.length) this.regions[scan.name] = new Region(scan.name, picture, scan.picture_corners, this.unit, (corners) => this.#draw(scan, corners));
    const state = scan.status === "ok" ? t("found_measured") : inWordsOfThePage(`${scan.status}: ${scan.reason}`).text;
    return el("article", { class: "scan" }, el("h4", {}, `${scan.name} (${scan.file})`), el("p", {}, state),
      el("div", { class: "pictures" }, picture,
        best ? el("img", { src: `${this.address}/${best}`, alt: t("found_candidates_of", { name: scan.name }) }) : null),
      this.regions[scan.name]?.element,
      this.cloud && scan.picture_axes.length ? this.#front(scan.picture_axes) : null,
      scan.candidates.length ? this.#table(scan) : null);
  }

  /** The choice of the front alone, for a cloud whose wheels follow from it. */
  #front([right, up]) {
    const choose = (side, axis, sense) => el("button", { type: "button", onclick: () => this.onFront(axis.map((x) => sense * x).join(",")) }, t(`found_front_${side}`));
    return el("p", { class: "buttons left", role: "group", "aria-label": t("found_front") }, t("found_front"),
      choose("left", right, -1), choose("right", right, 1), choose("top", up, 1), choose("bottom", up, -1));
  }

  /** The picture, with a button on each candidate. */
  #picture(scan, file) {
    const name = t("found_candidates_of", { name: scan.name });
    return el("div", { class: "picture" }, el("img", { src: `${this.address}/${file}`, alt: name, draggable: "false" }),
      ...scan.candidates.map((one) => this.#spot(scan, one)));
  }

  #spot(scan, { number, match, in_picture: [x, y] }) {
    const label = t("found_candidate", { number, match: match.toFixed(2) });
    const spot = el("button", { type: "button", class: "spot", "aria-label": label, onclick: () => this.#point(scan, number) });
    Object.assign(spot.style, { left: `${100 * x}%`, top: `${100 * y}%` }); // a style attribute is against the page's policy
    return spot;
  }

  /** A candidate was clicked in the picture: choose it, or go to the list of its wheel. */
  #point(scan, number) {
    const field = document.getElementById(`found-${scan.name}-${number}`);
    if (!this.cloud) {
      field.checked = true;
      field.dispatchEvent(new Event("change"));
    }
    field.focus();
  }

  #table(scan) {
    const head = [["found_choose", "words"], ["verdict", "words"], ["found_match", null], ["found_noise", "minor"], ["found_its_points", "minor"]];
    const rows = scan.candidates.map((one) => el("tr", { class: one.standing },
      el("th", { scope: "row", class: "words" }, this.cloud ? this.#wheel(scan, one) : this.#radio(scan, one)),
      el("td", { class: "words" }, one.verdict), el("td", {}, one.match.toFixed(2)),
      el("td", { class: "minor" }, (one.noise_m * 1000).toFixed(2)), el("td", { class: "minor" }, String(one.points))));
    const name = t("found_candidates_of", { name: scan.name });
    return el("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": name },
      el("table", { class: "figures" }, el("thead", {}, el("tr", {}, ...head.map(([text, kind]) => el("th", { scope: "col", class: kind }, t(text))))),
        el("tbody", {}, ...rows)));
  }

  #radio(scan, { number, point }) {
    const choose = () => {
      this.regions[scan.name]?.clear();
      this.chosen[scan.name] = point;
      this.#changed();
    };
    return el("label", {}, el("input", { type: "radio", name: `found-${scan.name}`, id: `found-${scan.name}-${number}`, onchange: choose }), String(number));
  }

  #wheel(scan, { number, point, wheel }) {
    const id = `found-${scan.name}-${number}`;
    const choose = ({ target }) => {
      for (const name of WHEELS) if (this.chosen[name] === point) delete this.chosen[name];
      if (target.value) this.chosen[target.value] = point;
      this.#changed();
    };
    return el("label", { for: id }, `${number} `, el("select", { id, "aria-label": `${t("found_is_wheel")} ${number}`, onchange: choose },
      el("option", { value: "" }, t("found_no_wheel")), ...WHEELS.map((name) => el("option", { value: name, selected: name === wheel }, name))));
  }
}

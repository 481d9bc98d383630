// What was found in the scans of a failed measurement, and the choice of the targets among it.
import { ask, el, t } from "./base.js";

const WHEELS = ["RR", "RL", "FR", "FL"];

export class Found {
  /** onAgain is called with the failed job and the options that hold the choice. */
  constructor(onAgain) {
    this.onAgain = onAgain;
  }

  /** Element with the explanation of a failed job: scans that failed first, then the others. */
  async show(failed, options, explained) {
    this.address = `/api/jobs/${explained.id}`;
    this.chosen = {};
    const { scans } = await ask(`${this.address}/explanation.json`);
    const lost = scans.filter(({ status }) => status !== "ok");
    const others = scans.filter(({ status }) => status === "ok");
    this.cloud = scans.some(({ role }) => role === "vehicle");
    this.trouble = el("p", { role: "status" });
    const again = () => this.#again(failed, options);
    this.onFront = (front) => this.onAgain(failed, { ...options, front });
    return el("section", { class: "looked" }, el("h3", {}, t("found_title")), el("p", { class: "hint" }, t("found_hint")),
      ...lost.map((scan) => this.#scan(scan)),
      el("p", { class: "buttons" }, el("button", { type: "button", class: "main", id: "again", onclick: again }, t("found_again"))), this.trouble,
      others.length ? el("details", {}, el("summary", {}, t("found_others")), ...others.map((scan) => this.#scan(scan))) : null);
  }

  #again(failed, options) {
    const named = Object.keys(this.chosen).length;
    if (!named || (this.cloud && named < WHEELS.length)) {
      this.trouble.textContent = t(this.cloud ? "found_name_all" : "found_choose_one");
      return;
    }
    this.onAgain(failed, { ...options, hints: { ...options.hints, ...this.chosen } });
  }

  #scan(scan) {
    const [seen, best] = scan.pictures;
    const state = scan.status === "ok" ? t("found_measured") : `${scan.status}: ${scan.reason}`;
    return el("article", { class: "scan" }, el("h4", {}, `${scan.name} (${scan.file})`), el("p", {}, state),
      el("div", { class: "pictures" }, seen ? this.#picture(scan, seen) : null,
        best ? el("img", { src: `${this.address}/${best}`, alt: t("found_candidates_of", { name: scan.name }) }) : null),
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
    return el("div", { class: "picture" }, el("img", { src: `${this.address}/${file}`, alt: name }),
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
    const head = [t("found_choose"), t("verdict"), t("found_match"), t("found_noise"), t("found_its_points")];
    const rows = scan.candidates.map((one) => el("tr", { class: one.standing },
      el("th", { scope: "row" }, this.cloud ? this.#wheel(scan, one) : this.#radio(scan, one)),
      el("td", { class: "words" }, one.verdict), el("td", {}, one.match.toFixed(2)),
      el("td", {}, (one.noise_m * 1000).toFixed(2)), el("td", {}, String(one.points))));
    const name = t("found_candidates_of", { name: scan.name });
    return el("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": name },
      el("table", { class: "figures" }, el("thead", {}, el("tr", {}, ...head.map((text, i) => el("th", { scope: "col", class: i < 2 ? "words" : null }, text)))),
        el("tbody", {}, ...rows)));
  }

  #radio(scan, { number, point }) {
    const choose = () => { this.chosen[scan.name] = point; this.trouble.textContent = ""; };
    return el("label", {}, el("input", { type: "radio", name: `found-${scan.name}`, id: `found-${scan.name}-${number}`, onchange: choose }), String(number));
  }

  #wheel(scan, { number, point, wheel }) {
    const id = `found-${scan.name}-${number}`;
    const choose = ({ target }) => {
      for (const name of WHEELS) if (this.chosen[name] === point) delete this.chosen[name];
      if (target.value) this.chosen[target.value] = point;
      this.trouble.textContent = "";
    };
    return el("label", { for: id }, `${number} `, el("select", { id, "aria-label": `${t("found_is_wheel")} ${number}`, onchange: choose },
      el("option", { value: "" }, t("found_no_wheel")), ...WHEELS.map((name) => el("option", { value: name, selected: name === wheel }, name))));
  }
}

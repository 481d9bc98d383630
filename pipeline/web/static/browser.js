// List of the files in the allowed folders.
import { ask, el, pathOf, t, whileShown } from "./base.js";

/** Show the folders in `place`; onOpen is called with the kind, root and path of the chosen item. */
export class Browser {
  constructor(place, onOpen, wanted = () => true) {
    Object.assign(this, { place, onOpen, wanted, root: 0, path: [] });
  }

  async start() {
    this.roots = (await ask("/api/folders")).folders;
    await this.#show();
  }

  get at() {
    return this.path.join("/");
  }

  async #show() {
    const { root, path } = this;
    const { items, is_cut: isCut } = await whileShown(ask(`/api/files/${root}/${pathOf(this.at)}`), () => root === this.root && path === this.path);
    const list = items.filter((item) => item.kind === "folder" || this.wanted(item.kind));
    const cut = isCut ? el("p", { class: "note" }, t("listing_cut")) : "";
    this.place.replaceChildren(this.#crumbs(), cut, list.length
      ? el("ul", { class: "items" }, ...list.map((item) => el("li", {}, this.#button(item))))
      : el("p", { class: "empty" }, t("nothing_here")));
  }

  #button({ name, kind }) {
    const act = () => {
      if (kind === "folder") this.#go([...this.path, name]);
      else this.onOpen({ kind, root: this.root, path: [...this.path, name].join("/"), name });
    };
    return el("button", { type: "button", class: kind === "folder" ? null : "open", onclick: act },
      el("span", { class: "name" }, name), el("span", { class: "kind" }, t(`kind_${kind.replace("-", "_")}`)));
  }

  #crumbs() {
    const step = (text, path) => el("button", { type: "button", onclick: () => this.#go(path) }, text);
    const roots = this.roots.length > 1
      ? el("select", { "aria-label": t("folder"), onchange: (event) => this.#go([], Number(event.target.value)) },
        ...this.roots.map((root, i) => el("option", { value: i, selected: i === this.root }, root)))
      : step(this.roots[0], []);
    return el("div", { class: "path" }, roots, ...this.path.flatMap((name, i) => ["/", step(name, this.path.slice(0, i + 1))]));
  }

  async #go(path, root = this.root) {
    Object.assign(this, { path, root });
    await this.#show();
    this.place.querySelector("button")?.focus();
  }
}

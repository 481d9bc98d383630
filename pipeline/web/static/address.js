// Addresses of the page's views: what stands behind # opens the same again, also after a restart.
import { pathOf } from "./base.js";

/** Parts of the address: `#view=place?key=value`. */
export function here() {
  const [head, query = ""] = location.hash.slice(1).split("?");
  const [view, place = ""] = head.split(/=(.*)/s);
  return { view, place: decoded(place), query: Object.fromEntries(new URLSearchParams(query)) };
}

/** Root and path of a place `0/some/path`; null for any other. */
export function folderOf(place) {
  const [, root, path] = /^(\d+)\/(.*)$/s.exec(place) ?? [];
  return root === undefined ? null : { root: Number(root), path };
}

export const addressOf = (job) => (job.at ? `#open=${pathOf(job.at)}` : `#result=${job.id}`);

/** Address of a folder of results; what is '' is left out of the query. */
export function archiveAddress({ root, path }, query = {}) {
  const given = Object.entries(query).filter(([, value]) => value !== "" && value != null);
  return `#archive=${root}/${pathOf(path)}${given.length ? `?${new URLSearchParams(given)}` : ""}`;
}

/** Go to an address, or show it anew where it is the present one. */
export function go(address) {
  if (location.hash !== address) history.pushState(null, "", address);
  dispatchEvent(new HashChangeEvent("hashchange"));
}

function decoded(text) {
  try {
    return decodeURIComponent(text);
  } catch {
    return text;
  }
}

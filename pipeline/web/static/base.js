// Shared by all parts of the page: texts, elements, tables, requests to the server.
const data = JSON.parse(document.getElementById("page-data").textContent);
const key = document.querySelector("meta[name=wheelplane-key]").content;

export const { language, viewer: viewerWords, limits, machine } = data;
export const byId = (id) => document.getElementById(id);

/** Text of the page in the user's language, with its {parts} filled in. */
export function t(name, parts = {}) {
  return (data.words[name] ?? name).replace(/\{(\w+)\}/g, (_, part) => parts[part] ?? "");
}

/** Element with its properties and children; strings become text nodes. */
export function el(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (value === true) element.setAttribute(name, "");
    else if (value !== false && value != null) element.setAttribute(name, value);
  }
  element.append(...children.filter((child) => child != null));
  return element;
}

/** Table element of {caption, head, rows, left, classes}: the first cell of a row is its head. */
export function tableOf({ caption, head, rows, left = 1, classes = [], minor = [] }, { kind = "", hidden = [] } = {}) {
  const shown = (_, column) => !hidden.includes(column);
  const kindsOf = (column) => [column < left && "words", /^U?u?$/.test(head[column]) && "spread", minor.includes(column) && "minor"].filter(Boolean).join(" ") || null;
  const cell = (text, column, tag) => el(tag, { class: kindsOf(column) }, String(text));
  const headRow = el("tr", {}, ...head.map((text, i) => el("th", { scope: "col", class: kindsOf(i) }, text)).filter(shown));
  const body = rows.map((row, i) => el("tr", { class: classes[i] || null }, ...row.map((text, column) => {
    const element = cell(text, column, column ? "td" : "th");
    if (String(text).length > 18) element.classList.add("long");
    if (!column) element.scope = "row";
    return element;
  }).filter(shown)));
  return el("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": caption || t("angles") },
    el("table", { class: `figures ${kind}` }, caption ? el("caption", {}, caption) : null, el("thead", {}, headRow), el("tbody", {}, ...body)));
}

export function select(name, label, options, value, onchange) {
const element = el("select", { name, onchange: (event) => onchange?.(event.target.value) },
    ...options.map(([option, text]) => el("option", { value: option, selected: option === value }, text)));
  return el("label", {}, label, element);
}

/** Error reported by the server, with its HTTP status; 0: the server does not respond. */
export class ServerError extends Error {
  constructor(text, status = 0) {
    super(text);
    this.status = status;
  }
}

export async function ask(path, { method = "GET", body } = {}) {
  let answer;
  try {
    const headers = method === "GET" ? {} : { "X-Wheelplane-Key": key, "Content-Type": "application/json" };
    answer = await fetch(path, { method, headers, body: body === undefined ? undefined : JSON.stringify(body) });
  } catch {
    throw new ServerError(t("lost"));
  }
  if (answer.ok) return answer.headers.get("Content-Type").includes("json") ? answer.json() : answer.text();
  throw new ServerError(await reason(answer.text(), answer.status), answer.status);
}

export const post = (path, body = {}) => ask(path, { method: "POST", body });

/** Send one file, and resolve with the answer; onShare is called with the fraction sent, from 0 to 1. */
export function send(path, file, onShare, signal = null) {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    signal?.addEventListener("abort", () => { request.abort(); reject(new ServerError(t("cancelled"))); });
    request.open("PUT", path);
    request.setRequestHeader("X-Wheelplane-Key", key);
    request.setRequestHeader("Content-Type", "application/octet-stream");
    request.upload.onprogress = (event) => onShare(event.loaded / Math.max(1, event.total));
    request.onerror = () => reject(new ServerError(t("lost")));
    request.onload = async () => {
      if (request.status < 300) resolve(JSON.parse(request.responseText));
      else reject(new ServerError(await reason(request.responseText, request.status)));
    };
    request.send(file);
  });
}

async function reason(text, status) {
  try {
    return JSON.parse(await text).error;
  } catch {
    return `${status}`;
  }
}

export const pathOf = (...parts) => parts.map((part) => String(part).split("/").map(encodeURIComponent).join("/")).join("/");
/** Wait for an answer while isShown() holds; after that, nothing that waits for it goes on. */
export const whileShown = (answer, isShown) => new Promise((resolve, reject) => {
  answer.then((found) => isShown() && resolve(found), (error) => isShown() && reject(error));
});

export const pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

/** Wait for a job, calling onState with every state; resolves with the first that `until` accepts. */
export async function follow(job, onState, until = (state) => ["done", "failed", "cancelled"].includes(state)) {
  for (let current = job, wait = 80; ; wait = Math.min(400, wait * 1.3)) {
    onState(current);
    if (until(current.state)) return current;
    await pause(wait);
    current = await ask(`/api/jobs/${job.id}`);
  }
}

/** Measurements that the program keeps, the latest first. */
export const session = {
  jobs: [],
  running: null, // the measurement that this page found at work when it was opened
  listeners: [],
  async start() {
    const { jobs, running } = await ask("/api/jobs");
    Object.assign(this, { jobs, running });
    for (const listener of this.listeners) listener();
  },
  remove(id) {
    this.jobs = this.jobs.filter((job) => job.id !== id);
    for (const listener of this.listeners) listener();
  },
  add(job) {
    this.jobs = [job, ...this.jobs.filter((other) => other.id !== job.id)];
    for (const listener of this.listeners) listener();
  },
};

/** Date of a measurement: when its capture was taken, or else when it was measured. */
export const dayOf = ({ date, began }) => date || dayIn(new Date(1000 * began));

/** Date of a time here, in ISO 8601 as captures state theirs: 11/12 is read in two ways. */
const dayIn = (time) => [time.getFullYear(), time.getMonth() + 1, time.getDate()].map((part) => String(part).padStart(2, "0")).join("-");

/** Name of a measurement, with its time where another one has the same name. */
export function called({ id, name, began }) {
  if (!session.jobs.some((other) => other.id !== id && other.name === name)) return name;
  const time = new Date(1000 * began);
  const isToday = time.toDateString() === new Date().toDateString();
  return `${name}, ${isToday ? "" : `${dayIn(time)} `}${time.toLocaleTimeString(language, { hourCycle: "h23" })}`;
}

/* What all pages share: the state, the elements, and what says how far an answer is. */

import { pointed } from "./fields.js";

export const $ = (id) => document.getElementById(id);

export function element(tag, properties = {}, ...children) {
  const node = Object.assign(document.createElement(tag), properties);
  node.append(...children);
  return node;
}

/* The whole state: one document, the content of a rig file; the page that is open; what was drawn last of each kind. */
export const state = {
  doc: null, began: null, presets: [], waiting: false, // not computed before a click: it came with a link
  page: "simulate", cursor: 0.75, before: null,
  shown: { run: null, friction: null, chart: null, advice: null, trace: null, fronts: null },
};

/* The parts of the page, by name. What they have of these is called as things happen: `greeted` (the server said hello),
   `open` and `close` (a page), `changed` (the rig is another), `drawn` (its run has come; whether it is the last of it),
   `refused`, `chosen` (a preset), `measured` (a trace was read), `recolour`. */
export const parts = {};
export function tellParts(what, ...content) {
  for (const part of Object.values(parts)) part[what]?.(...content);
}

/* Arrays as the server packs them. */
const KINDS = { f4: Float32Array, i2: Int16Array, u1: Uint8Array };
export const unpacked = ({ dtype, bdata }) => new KINDS[dtype](Uint8Array.from(atob(bdata), (c) => c.charCodeAt(0)).buffer);

export function notice(text) {
  $("notice").textContent = text;
  $("notice").hidden = !text;
}

/* Never stale: what is not about the rig in the fields is dimmed, and words say so. It stands on the page from the first
   answer ("") on, until there is none any more. */
const WORDS = { computing: "Computing …", refused: "Refused.", stopped: "Stopped.", waiting: "Not computed yet: this rig came with a link." };
for (const place of document.querySelectorAll("[data-about]")) {
  const [words, complaint] = ["words", "complaint"].map((what) => `${place.dataset.about}-${what}`);
  if ($(words)) continue;
  place.prepend(element("p", { className: "state", id: words, role: "status" }));
  if (!$(complaint)) place.prepend(element("p", { className: "complaint", id: complaint, role: "alert", hidden: true }));
}
export function mark(name, how, words) {
  const places = document.querySelectorAll(`[data-about="${name}"]`);
  for (const place of places) {
    place.dataset.state = how;
    place.setAttribute("aria-busy", String(how === "computing"));
    if (how === "" || how === "none") place.toggleAttribute("data-stands", how === "");
  }
  const before = places[0].hasAttribute("data-stands") ? " What stands here is from before." : "";
  $(`${name}-words`).textContent = words ?? (how in WORDS ? WORDS[how] + before : "");
  if (how !== "refused") complainAt(`${name}-complaint`, "");
  document.body.dataset[`${name}State`] = how;
}

/* How far an answer is; null: nothing is computed. A button that stops it is there as long as the bar. */
export function progress(where, share) {
  const bar = $(`${where}-progress`), stop = $(`${where}-stop`);
  bar.hidden = share === null;
  if (stop) stop.hidden = bar.hidden;
  if (share > 0) bar.value = share;
  else bar.removeAttribute("value"); // not known: it moves to and fro
}

// ---------------------------------------------------------------------------------------------------------- words

export const micro = (text) => text.replace(/\bu(m|s|N|g)\b/g, "µ$1");
export const word = (text) => text.replace(/\b([xf])_s\b/g, "$1ₛ").replace(/\^2/g, "²").replace(/\btime\b/g, "time unit");
export const pretty = (text) => micro(text).replace(/\b([xf])_s\b/g, "$1ₛ").replace(/\bF_s\b/g, "Fₛ").replace(/\bF_k\b/g, "Fₖ");

export function list(id, lines) {
  $(id).replaceChildren(...lines.map((textContent) => element("li", { textContent: pretty(textContent) })));
}
/* Cells are texts, or elements. */
export function table(id, lines, head) {
  const cells = (tag, line) => element("tr", {}, ...line.map((cell) => element(tag, {}, typeof cell === "string" ? pretty(cell) : cell)));
  const made = [element("tbody", {}, ...lines.map((line) => cells("td", line)))];
  if (head) made.unshift(element("thead", {}, cells("th", head)));
  $(id).replaceChildren(...made);
}
export function complainAt(id, text) {
  if (!$(id)) return;
  $(id).textContent = pretty(text);
  $(id).hidden = text === "";
}
/* A field for a number or a text: its name, its input and its unit; `entered` is told what was typed, a comma as a point. */
export function field(id, words, entered, more = {}) {
  const input = element("input", { id, type: "text", inputMode: "decimal", autocomplete: "off", ...more });
  input.onchange = () => entered((input.value = pointed(input.value.trim())), input);
  return labelled(id, words, input, element("span", { className: "unit", textContent: words.unit }));
}
/* What is filled in, behind its name. */
export function labelled(id, { symbol, title, help = "" }, ...content) {
  const label = element("label", { htmlFor: id, title: help }, ...(symbol ? [element("i", { textContent: symbol }), " "] : []), title);
  return element("div", { className: "field" }, label, ...content);
}
export function showRegime(prefix, regime) {
  $(prefix).textContent = regime.kind;
  const beside = $(`${prefix.replace(/regime$/, "")}often`);
  if (beside) beside.textContent = regime.frequency;
  $(prefix).parentElement.className = `verdict ${regime.kind.replaceAll(" ", "-")}`;
}

// ---------------------------------------------------------------------------------------------------------- files

/* Save a text, or bytes, as a file that is named after a rig. */
export function save(content, title, form) {
  const url = URL.createObjectURL(new Blob([content])), name = `${fileName(title)}.${form}`;
  element("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}
const fileName = (title) => String(title ?? "rig").toLowerCase().replace(/[^a-z0-9]+/g, "-").replace(/^-|-$/g, "") || "rig";

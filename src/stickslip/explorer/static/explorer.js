/* The page begins here. Its whole state is one document, the content of a rig file: shown in the fields, sent whole with
   every question, kept in the address. */

import { $, element, parts, save, state, tellParts, unpacked } from "./page.js";
import { address, complain, keepHere, remember } from "./rig.js";
import { lasted } from "./simulate.js";
import { ask, connect, on } from "./talk.js";
import "./map.js";
import "./stop.js";
import "./trace.js";
import "./fit.js";
import "./fronts.js";
import "./tour.js";

const TITLES = { simulate: "Simulate", map: "Map", stop: "What would stop it?", trace: "Measured trace", fit: "Fit", fronts: "Fronts" };
const PAGES = Object.keys(TITLES), nav = document.querySelector("nav");

function open(next) {
  parts[state.page].close?.();
  state.page = next;
  document.body.dataset.page = next;
  for (const name of PAGES) {
    $(`page-${name}`).hidden = name !== next;
    $(`tab-${name}`).setAttribute("aria-selected", String(name === next));
    $(`tab-${name}`).tabIndex = name === next ? 0 : -1;
  }
  if (!state.doc) return; // the server has not said hello yet
  remember();
  parts[next].open?.();
}
for (const [name, textContent] of Object.entries(TITLES)) {
  nav.append(element("button", { role: "tab", id: `tab-${name}`, textContent, onclick: () => open(name) }));
  nav.lastChild.setAttribute("aria-controls", `page-${name}`);
}
nav.addEventListener("keydown", (event) => {
  const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
  if (!step) return;
  open(PAGES[(PAGES.indexOf(state.page) + step + PAGES.length) % PAGES.length]);
  $(`tab-${state.page}`).focus();
});

parts.glossary = { greeted: ({ glossary }) => $("glossary-list").replaceChildren(...glossary.flatMap(({ term, unit, text }) =>
  [element("dt", {}, term, unit ? element("span", { className: "quiet", textContent: ` ${unit}` }) : ""), element("dd", { textContent: text })])) };
$("glossary-open").onclick = () => $("glossary").showModal();
$("glossary-close").onclick = () => $("glossary").close();

for (const button of document.querySelectorAll("[data-download]")) {
  const form = button.dataset.download;
  button.onclick = () => ask(form, { duration: form !== "toml" && state.shown.run ? lasted() : null });
  on(form, ({ name, file }) => save(unpacked(file), name, form), { refused: complain });
}
$("link").onclick = async () => {
  const link = location.origin + location.pathname + address();
  history.replaceState(null, "", link);
  keepHere();
  let done = "Copied";
  try { await navigator.clipboard.writeText(link); } catch { done = "It is in the address bar"; }
  $("link").textContent = done;
  setTimeout(() => { $("link").textContent = "Copy link"; }, 2000);
};
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { tellParts("recolour"); open(state.page); });

open(state.page);
connect();

/* The page Fit: the rig behind a measured trace, at once by closed forms, and with intervals by simulations. */

import { axis, colour, draw, label } from "./figures.js";
import { split } from "./fields.js";
import { $, complainAt, element, field, list, mark, parts, pretty, save, state, table } from "./page.js";
import { begin, wait } from "./rig.js";
import { ask, drop, on } from "./talk.js";
import { source } from "./trace.js";

const inputs = {};
let known = {}, pending, fitted = null, quick = null, found = null, running = "", sizes = [];

function input(key, { read, missing, ...words }) {
  const made = field(`fit-${key}`, words, (text, input) => {
    if (text === "") delete input.dataset.own;
    input.nextSibling.hidden = Boolean(split(text)[1]); // typed beside the number
    compute();
  }, { placeholder: missing ?? (read ? "by the trace" : "") });
  inputs[key] = made.querySelector("input");
  inputs[key].oninput = () => { inputs[key].dataset.own = "yes"; };
  return made;
}

/* The trace, and what is known: readings of the trace itself are left to the server. */
function request() {
  const { options, ...trace } = source(), given = {};
  for (const [key, { unit, read }] of Object.entries(known)) {
    const value = inputs[key].value.trim();
    if (value && (!read || "own" in inputs[key].dataset)) {
      given[key] = unit && !split(value)[1] ? `${value} ${unit}` : value;
    }
  }
  return { ...trace, options: { ...options, ...given } };
}
const values = () => JSON.stringify(request().options);

// ------------------------------------------------------------------------------------------------ by closed forms

function compute() {
  if (found && found.of !== values()) mark("posterior", "computing", "These intervals are of the values before: fit again.");
  ask("fit", request());
}
on("fit", (reply) => {
  if (reply.readings) read(reply);
  if (reply.missing) { quick = null; mark("fit", "none", reply.missing); }
  if (reply.quick) showQuick(reply.quick);
  if (reply.table) offer(reply.table);
}, { about: "fit", whole: (reply) => reply.quick });
function read({ slips, readings }) {
  list("fit-slips", slips);
  for (const [key, value] of Object.entries(readings)) if (!("own" in inputs[key].dataset)) inputs[key].value = value;
}
function showQuick(reply) {
  quick = reply;
  $("quick-words").textContent = pretty(reply.words);
  for (const [id, is] of [["quick-next", reply.fits], ["fit-coarse", !reply.fits]]) $(id).classList.toggle("next", is);
  table("quick-numbers", reply.numbers);
  list("quick-assumed", reply.assumed.map((text) => `assumed: ${text}`));
  drawOverlay("plot-quick", reply.overlay);
}
function drawOverlay(id, { trace, series, time, force, span }) {
  if (state.page !== "fit") return;
  draw(id, [
    ...series.map(({ x, y }, i) => ({ x, y, mode: "lines", name: "simulated", showlegend: i === 0, opacity: series.length > 1 ? 0.55 : 0.9,
      line: { color: colour("vermillion"), width: 1.4, dash: ["solid", "dash", "dot"][i] } })),
    { x: trace.x, y: trace.y, mode: "lines", name: "measured", line: { color: colour("blue"), width: 1.6 } },
  ], { xaxis: axis(label(time), { range: span }), yaxis: axis(label(force)), showlegend: true,
    legend: { orientation: "h", x: 1, xanchor: "right", y: 1, yanchor: "bottom" } });
}

// --------------------------------------------------------------------------------------------------- with intervals

function took(seconds) {
  if (seconds < 1) return "some seconds";
  return seconds < 90 ? `about ${Math.max(5, Math.round(seconds / 5) * 5)} s` : `about ${Math.round(seconds / 60)} min`;
}
function offer(plan) {
  sizes = plan.sizes ?? [];
  if (plan.refused) complainAt("posterior-complaint", `No intervals: ${plan.refused}`);
  for (const button of [$("fit-coarse"), $("fit-full")]) {
    const size = sizes[button.dataset.size], name = button.dataset.size === "0" ? "Coarse" : "Full";
    button.disabled = !size || running;
    if (size) button.textContent = `${name}: ${size.draws.toLocaleString("en")} simulations, ${took(size.seconds)}${size.seconds < 1 ? "" : " once"}`;
  }
}
function fit(size) {
  running = values();
  for (const id of ["fit-coarse", "fit-full"]) $(id).disabled = true;
  ask("posterior", { ...request(), draws: size.draws });
}
on("posterior", (reply) => {
  showPosterior({ ...reply, of: running });
  ended();
}, { about: "posterior", refused: ended });
function ended() {
  running = "";
  if (fitted) compute(); // how long it takes from now on
}
function showPosterior(reply) {
  found = reply;
  const rows = reply.parameters.map(({ title, text, says, prior, part }) => {
    const [low, median, high] = part.map((value) => 100 * value), bar = element("span", { className: "range" });
    bar.append(element("i", { style: `left:${low}%;width:${high - low}%` }), element("b", { style: `left:${median}%` }));
    bar.setAttribute("role", "img");
    bar.setAttribute("aria-label", `90 % interval within ${prior}`);
    bar.title = `considered possible: ${prior}`;
    const [word, ...rest] = says.split(": ");
    return [title, text, bar, element("span", {}, element("span", { className: "tells", textContent: word }), rest.length ? `: ${rest.join(": ")}` : "")];
  });
  table("fit-parameters", rows, ["parameter", "median (90 %)", "within the range considered possible", "what the trace determines"]);
  table("fit-quantities", reply.quantities);
  list("fit-notes", reply.notes);
  $("fit-no-rig").textContent = reply.no_rig ? pretty(reply.no_rig) : "";
  for (const id of ["fit-next", "fit-open", "fit-save"]) $(id).disabled = !reply.document;
  drawPosterior();
}
function drawPosterior() {
  if (state.page !== "fit") return;
  drawOverlay("plot-predicted", found.overlay);
  const { drop, trace, low, high } = found.drops, band = { mode: "lines", line: { width: 0 }, name: "draws" };
  draw("plot-drops", [{ x: drop.values, y: low, ...band }, { x: drop.values, y: high, ...band, fill: "tonexty", fillcolor: `${colour("vermillion")}44` },
    { x: drop.values, y: trace, mode: "lines", name: "trace", line: { color: colour("blue"), width: 1.8, shape: "hv" } }],
  { xaxis: axis(label(drop), { rangemode: "tozero" }), yaxis: axis("fraction of slips", { range: [0, 1.02] }) });
  const at = found.test.map((_, i) => -i), far = found.test.map(({ p }) => p < 0.02);
  draw("plot-test", [
    { x: found.test.flatMap(({ low, high }) => [low, high, null]), y: at.flatMap((y) => [y, y, null]), mode: "lines", name: "draws",
      line: { color: `${colour("vermillion")}77`, width: 5 } },
    { x: found.test.map(({ here }) => here), y: at, mode: "markers", name: "trace",
      marker: { size: 7, color: far.map((out) => colour(out ? "bad" : "blue")), symbol: far.map((out) => (out ? "x" : "circle")) } },
  ], { margin: { l: 150, r: 12, t: 4, b: 40 }, xaxis: axis("(value - median) / (range of 95 % / 4)", { range: [-4.3, 4.3] }),
    yaxis: axis("", { tickvals: at, ticktext: found.test.map(({ name }) => name), tickfont: { size: 10 }, range: [at.at(-1) - 0.7, 0.7] }) });
}
$("fit-coarse").onclick = () => fit(sizes[0]);
$("fit-full").onclick = () => fit(sizes[1]);

// ----------------------------------------------------------------------------------------------------- what to do

function openRig(rig, page) {
  wait(false);
  state.cursor = 0.75;
  begin(structuredClone(rig.document));
  $(`tab-${page}`).click();
  window.scrollTo(0, 0);
}
for (const [id, rig] of [["quick", () => quick], ["fit", () => found]]) {
  const button = (what, textContent, onclick) => element("button", { type: "button", id: `${id}-${what}`, className: what, textContent, onclick });
  $(`${id}-rig`).prepend(
    button("next", "What would stop it?", () => openRig(rig(), "stop")), button("open", "Open in Simulate", () => openRig(rig(), "simulate")),
    button("save", "Download the rig file", () => save(rig().toml, rig().document.name, "toml")));
}

/* Another trace: its readings are its own; of the sample, the bench is known. */
function begun(file) {
  fitted = null;
  drop("posterior");
  running = "";
  quick = found = null;
  for (const about of ["fit", "posterior"]) mark(about, "none");
  $("fit-none").hidden = file !== null;
  $("fit-found").hidden = file === null;
  fitted = file;
  for (const [key, { read, sample }] of Object.entries(known)) {
    if (read) { inputs[key].value = ""; delete inputs[key].dataset.own; }
    else if (file?.name === "sample.csv" && sample) inputs[key].value = sample;
  }
  if (file) compute();
}
parts.fit = {
  greeted({ fit: given }) {
    known = given;
    $("fit-fields").replaceChildren(...Object.entries(known).map(([key, words]) => input(key, words)));
  },
  open() {
    if (pending !== undefined) begun(pending);
    pending = undefined;
    if (quick) drawOverlay("plot-quick", quick.overlay);
    if (found) drawPosterior();
  },
  measured(file) {
    if (state.page === "fit") begun(file);
    else pending = file; // nothing is computed for a page that nobody looks at
  },
};

/* The page Fronts: a bar of blocks, the force at its driving spring, and what happens along it in time. */

import { axis, colour, cursorOver, draw, label, pointAt } from "./figures.js";
import { at, numeric, put, short } from "./fields.js";
import { $, element, field, parts, pretty, save, state, table, unpacked } from "./page.js";
import { on, onceFor } from "./talk.js";

const { shown } = state;
const points = ["plot-side", "spacetime"].map(cursorOver);
const MANY = 1.6; // times sound: slip began in several places at once
const FAST = 170; // of 255: blocks that slip move at a tenth of the fastest, a third of three decades below
let fields = {}, bars = [], chain = null, event = -1, time = null;

on("fronts", (reply) => {
  shown.fronts = reply;
  event = -1;
  time = null;
  listEvents();
  show();
}, { about: "fronts" });
const compute = onceFor("fronts", () => JSON.stringify(chain), () => state.page === "fronts", () => ({ chain }), 0);

// ------------------------------------------------------------------------------------------------------- the bar

function offer(found, mine) {
  bars = mine ? [{ title: mine.name ?? "(your own)", document: mine }, ...found] : found;
  $("bar").replaceChildren(...bars.map(({ title }, i) => new Option(title, i)));
  choose(0);
}
function choose(index) {
  chain = structuredClone(bars[index].document);
  rebuild();
  compute();
}
function rebuild() {
  const there = Object.entries(fields).filter(([key]) => ["number", "string"].includes(typeof at(chain, key)));
  $("bar-fields").replaceChildren(...there.map(([key, { title, unit, whole }]) => field(`bar-${key.replaceAll(".", "-")}`,
    { title, unit: chain.units === "natural" ? unit : "" }, (text, input) => {
      const number = numeric(text);
      if (text === "") { input.value = String(at(chain, key)); return; }
      put(chain, key, isNaN(number) ? text : whole ? Math.round(number) : number);
      compute();
    }, { value: String(at(chain, key)) })));
}
$("bar").onchange = () => choose(Number($("bar").value));
$("bar-save").onclick = () => {
  if (shown.fronts) save(shown.fronts.toml, shown.fronts.name, "toml");
};

// ------------------------------------------------------------------------------------------------------ the events

function listEvents() {
  const { events, blocks, time: times, force, left_out: left } = shown.fronts;
  const head = ["", label({ ...times, title: "at" }), "slipped", "began at block", "speed / sound", label({ ...force, title: "change of force" })];
  const rows = events.map((one, i) => {
    const button = element("button", { type: "button", textContent: "Closer", ariaLabel: `Closer: event at ${short(one.start)}` });
    button.onclick = () => look(i);
    const cells = [String(short(one.start)), one.blocks >= blocks ? "the whole bar" : `${one.blocks} of ${blocks} blocks`, String(one.from),
      one.speed === null ? "no front" : one.speed > MANY ? "several at once" : one.speed.toPrecision(2), (-one.drop).toPrecision(3)];
    return [button, ...cells];
  });
  table("fronts-events", rows, head);
  if (left || !rows.length) $("fronts-events").tBodies[0].append(element("tr", {}, element("td", { colSpan: 6,
    textContent: left ? `${left} shorter events are left out` : "No event runs along a tenth of the bar." })));
}
function look(index) {
  event = event === index ? -1 : index;
  time = null;
  show();
}
$("fronts-whole").onclick = () => look(-1);
$("fronts-what").onchange = () => show();

// ----------------------------------------------------------------------------------------------------- the pictures

const view = () => (event < 0 ? shown.fronts.whole : shown.fronts.events[event].view);

async function show() {
  if (!shown.fronts || state.page !== "fronts") return;
  const { time: times, force, speed, events, blocks } = shown.fronts, now = view();
  $("fronts-whole").setAttribute("aria-pressed", String(event < 0));
  [...$("fronts-events").querySelectorAll("tbody tr")].forEach((row, i) => row.classList.toggle("chosen", i === event));
  for (const point of points) point(NaN);
  $("fronts-at").textContent = "";
  const marked = event < 0 ? events.map(({ start }) => start) : [];
  await draw("plot-side", [{ x: now.t, y: now.F, mode: "lines", line: { color: colour("blue"), width: 1.3 }, name: "force" }], {
    xaxis: axis("", { range: now.span, showticklabels: false, automargin: false }), yaxis: axis(label(force), { automargin: false }), margin: { l: 62, r: 14, t: 18, b: 10 },
    shapes: marked.map((x) => ({ type: "line", x0: x, x1: x, yref: "paper", y0: 0, y1: 1, line: { color: colour("vermillion"), width: 1, dash: "dot" } })),
    annotations: [{ xref: "paper", yref: "paper", x: 1, y: 1, xanchor: "right", yanchor: "bottom", showarrow: false, font: { color: colour("quiet") },
      text: event < 0 ? `${events.length} ${events.length === 1 ? "event" : "events"}, marked` : `event at ${short(events[event].start)}` }] });
  const what = $("fronts-what").value, steps = colours(what), scale = steps.map((step, i) => [i / (steps.length - 1), step]);
  $("fronts-scale-words").textContent = what === "attached" ? "no contact attached … all of them"
    : `velocity ${short(speed.fastest / 10 ** speed.decades, 2)} … ${short(speed.fastest, 2)} ${pretty(speed.unit)}, in decades`;
  $("fronts-scale").firstChild.style.background = `linear-gradient(to right, ${steps.join(", ")})`;
  $("spacetime").setAttribute("aria-label", `${what === "attached" ? "Attached contacts" : "Velocity"} of ${blocks} blocks in time; the arrow keys move the cursor`);
  $("spacetime").dataset.event = event;
  const [begin, end] = now.span, pixel = (end - begin) / now.rows;
  await draw("spacetime", [{ type: "heatmap", z: now[what], x0: begin + pixel / 2, dx: pixel, y0: 1, dy: 1, zmin: 0, zmax: 255,
    colorscale: scale, showscale: false }], { dragmode: false, margin: { l: 62, r: 14, t: 6, b: 44 },
    xaxis: axis(label(times), { range: now.span, automargin: false, exponentformat: "none" }),
    yaxis: axis("block", { range: [0.5, blocks + 0.5], automargin: false }) });
}
/* Dark to bright, or bright to dark, as the page is: rest is its own colour. */
const colours = (what) => (what === "attached" ? ["orange", "panel", "blue"] : ["panel", "blue", "orange", "vermillion"]).map(colour);

// --------------------------------------------------------------------- one cursor for the force and for the picture

function moveTo(next) {
  const now = view(), [begin, end] = now.span, t = unpacked(now.t), F = unpacked(now.F);
  time = Math.min(Math.max(next, begin), end);
  let i = t.findIndex((value) => value >= time);
  if (i < 0) i = t.length - 1;
  points[0](time, F[i]);
  points[1](time);
  const row = Math.min(Math.floor(((time - begin) / (end - begin || 1)) * now.rows), now.rows - 1);
  const moving = unpacked(now.velocity).filter((value, k) => k % now.rows === row && value > FAST).length;
  $("fronts-at").textContent = `t = ${short(time, 5)}: force ${short(F[i], 3)}, ${moving === 0 ? "nothing slips" : `${moving} blocks slip`}`;
}
for (const id of ["plot-side", "spacetime"]) {
  $(id).addEventListener("pointermove", (move) => {
    const found = shown.fronts && pointAt(move, id);
    if (found?.inside) moveTo(found.x);
  });
}
$("spacetime").addEventListener("click", () => { // on the whole run: the event that is nearest, closer
  if (!shown.fronts || time === null) return;
  if (event >= 0 || !shown.fronts.events.length) return look(-1);
  const away = shown.fronts.events.map(({ start }) => Math.abs(start - time));
  look(away.indexOf(Math.min(...away)));
}, true);
$("spacetime").addEventListener("keydown", (key) => {
  const step = { ArrowLeft: -1, ArrowRight: 1 }[key.key];
  if (!step || !shown.fronts) return;
  key.preventDefault();
  const [begin, end] = view().span;
  moveTo((time ?? begin) + (step * (end - begin)) / 100);
});
parts.fronts = {
  greeted({ fronts, bars: found, chain: mine }) { fields = fronts; offer(found, mine); },
  open() { if (chain) { show(); compute(); } },
};

/* The page Fronts: a bar of blocks, the force at its driving spring, and what happens along it in time. */

import { axis, colour, cursorOver, draw, label, timeAt, upright } from "./figures.js";
import { at, numeric, put, short } from "./fields.js";
import { $, complainAt, element, field, fileName, mark, parts, pretty, progress, save, state, table, unpacked } from "./page.js";
import { ask, drop, on, saying } from "./talk.js";

const { shown } = state;
const point = cursorOver("plot-side");
const MANY = 1.6; // times sound: slip began in several places at once
const FAST = 170; // of 255: blocks that slip move at a tenth of the fastest, a third of three decades below
let fields = {}, bars = [], chain = null, asked = "", event = -1, time = null, painted = null;

on("fronts", (reply) => {
  if (reply.progress !== undefined) return progress("fronts", reply.progress);
  if (reply.done) return finish();
  finish();
  shown.fronts = reply;
  event = -1;
  time = null;
  complainAt("fronts-complaint", "");
  mark("fronts", "");
  $("fronts-found").hidden = false;
  listEvents();
  show();
}, (errors) => {
  finish();
  complainAt("fronts-complaint", saying(errors));
  mark("fronts", "refused", shown.fronts ? "Refused: what stands here is the bar before." : "");
});
function finish() {
  progress("fronts", null);
  $("fronts-stop").hidden = true;
}

// ------------------------------------------------------------------------------------------------------- the bar

function offer(found, mine) {
  bars = mine ? [{ title: mine.name ?? "(your own)", document: mine }, ...found] : found;
  $("bar").replaceChildren(...bars.map(({ title }, i) => new Option(title, i)));
  choose(0);
}
function choose(index) {
  chain = structuredClone(bars[index].document);
  rebuild();
  if (state.page === "fronts") compute();
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
function compute() {
  const text = JSON.stringify(chain);
  if (asked === text || state.waiting) return;
  asked = text;
  mark("fronts", "computing", shown.fronts ? "Computing … what stands here is the bar before." : "Computing …");
  progress("fronts", 0);
  $("fronts-stop").hidden = false;
  ask("fronts", { chain });
}
$("bar").onchange = () => choose(Number($("bar").value));
$("fronts-stop").onclick = () => {
  drop("fronts");
  finish();
  asked = "";
  mark("fronts", "refused", "Stopped; change a number, or choose a bar, to go on.");
};
$("bar-save").onclick = () => {
  if (shown.fronts) save(new Blob([shown.fronts.toml], { type: "application/toml" }), `${fileName(shown.fronts.name)}.toml`);
};

// ------------------------------------------------------------------------------------------------------ the events

function listEvents() {
  const { events, blocks, time: times, force, left_out: left } = shown.fronts;
  const head = ["", label({ ...times, title: "at" }), "slipped", "began at block", "speed / sound", label({ ...force, title: "force drop" })];
  const rows = events.map((one, i) => {
    const button = element("button", { type: "button", textContent: "Closer", ariaLabel: `Closer: event at ${short(one.start)}` });
    button.onclick = () => look(i);
    const cells = [String(short(one.start)), one.blocks >= blocks ? "the whole bar" : `${one.blocks} of ${blocks} blocks`, String(one.from),
      one.speed === null ? "no front" : one.speed > MANY ? "several at once" : one.speed.toPrecision(2), one.drop.toPrecision(3)];
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
  painted = null;
  point(NaN);
  $("fronts-at").textContent = "";
  const marked = event < 0 ? events.map(({ start }) => start) : [];
  await draw("plot-side", [{ x: now.t, y: now.F, mode: "lines", line: { color: colour("blue"), width: 1.3 }, name: "force" }], {
    xaxis: axis("", { range: now.span, showticklabels: false, automargin: false }), yaxis: axis(upright(force), { automargin: false }), margin: { l: 62, r: 14, t: 18, b: 10 },
    shapes: marked.map((x) => ({ type: "line", x0: x, x1: x, yref: "paper", y0: 0, y1: 1, line: { color: colour("vermillion"), width: 1, dash: "dot" } })),
    annotations: [{ xref: "paper", yref: "paper", x: 1, y: 1, xanchor: "right", yanchor: "bottom", showarrow: false, font: { color: colour("quiet") },
      text: event < 0 ? `${events.length} ${events.length === 1 ? "event" : "events"}, marked` : `event at ${short(events[event].start)}` }] });
  const what = $("fronts-what").value;
  $("fronts-scale-words").textContent = what === "attached" ? "no contact attached … all of them"
    : `velocity ${short(speed.fastest / 10 ** speed.decades, 2)} … ${short(speed.fastest, 2)} ${pretty(speed.unit)}, in decades`;
  $("fronts-scale").firstChild.style.background = `linear-gradient(to right, ${colours(what).map((c) => `rgb(${c.join(",")})`).join(", ")})`;
  $("spacetime").setAttribute("aria-label", `${what === "attached" ? "Attached contacts" : "Velocity"} of ${blocks} blocks in time; the arrow keys move the cursor`);
  paint();
}
/* Dark to bright, or bright to dark, as the page is: rest is its own colour. */
function colours(what) {
  const parse = (name) => [1, 3, 5].map((i) => parseInt(colour(name).slice(i, i + 2), 16));
  return what === "attached" ? [parse("orange"), parse("panel"), parse("blue")] : [parse("panel"), parse("blue"), parse("orange"), parse("vermillion")];
}
function image() {
  const now = view(), what = $("fronts-what").value, values = unpacked(now[what]), rows = now.rows, places = values.length / rows;
  const steps = colours(what), picture = new ImageData(rows, places);
  for (let i = 0; i < rows; i++) {
    for (let j = 0; j < places; j++) {
      const part = (values[i * places + j] / 255) * (steps.length - 1), low = Math.min(Math.floor(part), steps.length - 2), more = part - low;
      const to = 4 * ((places - 1 - j) * rows + i); // the first block below
      for (let c = 0; c < 3; c++) picture.data[to + c] = steps[low][c] + (steps[low + 1][c] - steps[low][c]) * more;
      picture.data[to + 3] = 255;
    }
  }
  const canvas = element("canvas", { width: rows, height: places });
  canvas.getContext("2d").putImageData(picture, 0, 0);
  return canvas;
}
/* Where the axes of the force lie: those of the picture below lie under them. */
function frame() {
  const { xaxis } = $("plot-side")._fullLayout, canvas = $("spacetime");
  return { left: xaxis._offset, width: xaxis._length, top: 6, height: canvas.clientHeight - 50, xaxis };
}
function paint() {
  const canvas = $("spacetime");
  if (!shown.fronts || !canvas.clientWidth || !$("plot-side")._fullLayout?.xaxis?._length) return;
  const ratio = Math.min(window.devicePixelRatio || 1, 2), { left, width, top, height, xaxis } = frame(), { blocks, time: times } = shown.fronts;
  canvas.width = Math.round(canvas.clientWidth * ratio);
  canvas.height = Math.round(canvas.clientHeight * ratio);
  const ink = canvas.getContext("2d");
  ink.scale(ratio, ratio);
  ink.imageSmoothingEnabled = false;
  painted ??= image();
  ink.drawImage(painted, left, top, width, height);
  ink.strokeStyle = colour("quiet");
  ink.fillStyle = colour("ink");
  ink.font = "12px system-ui, 'DejaVu Sans', sans-serif";
  ink.strokeRect(left, top, width, height);
  ink.textAlign = "center";
  const [begin, end] = view().span, step = nice((end - begin) / Math.max(3, width / 110));
  for (let t = Math.ceil(begin / step) * step; t <= end; t += step) {
    const x = left + xaxis.l2p(t);
    ink.beginPath();
    ink.moveTo(x, top + height);
    ink.lineTo(x, top + height + 4);
    ink.stroke();
    ink.fillText(String(short(t, 6)), x, top + height + 17);
  }
  ink.fillText(label(times), left + width / 2, top + height + 37);
  ink.textAlign = "right";
  const y = (block) => top + height * (1 - (block - 0.5) / blocks), every = nice(blocks / 5);
  for (const block of [1, ...Array.from({ length: Math.floor(blocks / every) }, (_, i) => (i + 1) * every)]) ink.fillText(String(block), left - 6, y(block) + 4);
  ink.save();
  ink.translate(16, top + height / 2);
  ink.rotate(-Math.PI / 2);
  ink.textAlign = "center";
  ink.fillText("block", 0, 0);
  ink.restore();
  canvas.dataset.event = event;
  if (time === null) return;
  const x = left + xaxis.l2p(time);
  ink.fillStyle = colour("purple");
  ink.fillRect(x - 1, top, 2, height);
}
const nice = (rough) => {
  const size = 10 ** Math.floor(Math.log10(rough));
  return [1, 2, 5, 10].find((step) => step * size >= rough) * size;
};

// --------------------------------------------------------------------- one cursor for the force and for the picture

function moveTo(next) {
  const now = view(), [begin, end] = now.span, t = unpacked(now.t), F = unpacked(now.F);
  time = Math.min(Math.max(next, begin), end);
  let i = t.findIndex((value) => value >= time);
  if (i < 0) i = t.length - 1;
  point(time, F[i]);
  paint();
  const velocity = unpacked(now.velocity), places = velocity.length / now.rows;
  const row = Math.min(Math.floor(((time - begin) / (end - begin || 1)) * now.rows), now.rows - 1);
  const moving = velocity.subarray(row * places, (row + 1) * places).reduce((count, value) => count + (value > FAST), 0);
  $("fronts-at").textContent = `t = ${short(time, 5)}: force ${short(F[i], 3)}, ${moving === 0 ? "nothing slips" : `${Math.round((moving / places) * shown.fronts.blocks)} blocks slip`}`;
}
$("plot-side").addEventListener("pointermove", (move) => { const t = shown.fronts && timeAt(move, "plot-side"); if (t !== null && t !== undefined) moveTo(t); });
$("spacetime").addEventListener("pointermove", (move) => {
  if (!shown.fronts) return;
  const { left, width, xaxis } = frame(), x = move.clientX - $("spacetime").getBoundingClientRect().left - left;
  if (x >= 0 && x <= width) moveTo(xaxis.p2l(x));
});
$("spacetime").addEventListener("click", () => { // on the whole run: the event that is nearest, closer
  if (!shown.fronts || time === null) return;
  if (event >= 0 || !shown.fronts.events.length) return look(-1);
  const away = shown.fronts.events.map(({ start }) => Math.abs(start - time));
  look(away.indexOf(Math.min(...away)));
});
$("spacetime").addEventListener("keydown", (key) => {
  const step = { ArrowLeft: -1, ArrowRight: 1 }[key.key];
  if (!step || !shown.fronts) return;
  key.preventDefault();
  const [begin, end] = view().span;
  moveTo((time ?? begin) + (step * (end - begin)) / 100);
});
new ResizeObserver(() => { if (state.page === "fronts") { point(NaN); paint(); } }).observe($("plot-side"));

parts.fronts = {
  greeted({ fronts, bars: found, chain: mine }) { fields = fronts; offer(found, mine); },
  open() { if (chain) { show(); compute(); } },
  recolour() { painted = null; },
};

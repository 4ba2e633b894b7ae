/* The page Map: where smooth sliding is stable, over two parameters; the rig is a circle that can be dragged. */

import { colour, draw, logarithmic, pointAt, restyle } from "./figures.js";
import { put, short } from "./fields.js";
import { $, parts, showRegime, state, word } from "./page.js";
import { ask, isAbout, isNewest, isPending, on, onceFor } from "./talk.js";

const PARAMETERS = { // by name: key and words
  stiffness: ["slider.stiffness", "K, driving spring"], velocity: ["drive.velocity", "v, speed"], mass: ["slider.mass", "M, mass"],
  damping: ["slider.damping", "η, damping"], delay: ["interface.delay", "τ, delay"],
  std: ["interface.thresholds.std", "Δf, threshold std. dev."], ageing: ["interface.ageing.time", "time of ageing"] };
const { shown } = state;
let about = "", outgrown = 0, dragging = false;

on("chart", (reply) => {
  shown.chart = { ...reply, about };
  summarise();
  drawMap();
}, { about: "map" });

/* The sentence under the map is about one point: it stands only while the rig is there. */
function summarise() {
  $("summary").textContent = shown.chart?.about === JSON.stringify(state.doc) ? shown.chart.summary : "";
}
/* The map stays as it is while only its own two parameters are varied, within its ends. */
function signature(over) {
  const rest = structuredClone(state.doc);
  for (const key of ["simulation", "name", "assumed", "source", "drive.distance", "drive.duration"]) put(rest, key, undefined);
  for (const parameter of over) put(rest, PARAMETERS[parameter][0], undefined);
  if (over.includes("damping")) put(rest, "slider.damping_ratio", undefined);
  return JSON.stringify([over, rest, outgrown]);
}
const over = () => [$("across").value, $("up").value];
const refresh = onceFor("chart", () => signature(over()), () => state.page === "map" && !dragging, () => {
  about = JSON.stringify(state.doc);
  return { over: over() };
});
/* Page 1 was turned: the dot follows, and a dot that has left its map asks for another. */
function followDot(parameters) {
  const { chart } = shown;
  if (!chart || dragging || !isAbout("chart", signature(chart.over))) return;
  const now = chart.over.map((parameter) => parameters[parameter]);
  if (now.some((value) => value === undefined)) return;
  const out = (value, [low, high]) => value < low * 0.999 || value > high * 1.001;
  if (out(now[0], chart.x.ends) || out(now[1], chart.y.ends)) {
    outgrown += 1;
    return refresh();
  }
  chart.here = now;
  if (state.page === "map") moveDot(now);
}
function moveDot([x, y]) {
  restyle("plot-map", { x: [[x]], y: [[y]] }, [$("plot-map").data.length - 1]);
}
function drawMap() {
  const { chart } = shown;
  if (!chart || state.page !== "map") return;
  // As in `stickslip map`: purple is stable, orange unstable.
  const traces = [
    { type: "heatmap", x: chart.x.values, y: chart.y.values, z: chart.shade, customdata: chart.rate, zmin: -1, zmax: 1,
      colorscale: [[0, colour("stable")], [0.5, colour("neither")], [1, colour("unstable")]], zsmooth: "best",
      hovertemplate: `growth rate %{customdata} ${word(chart.rate_unit)}<extra></extra>`,
      colorbar: { title: { text: `growth rate (${word(chart.rate_unit)})`, side: "right" }, tickvals: chart.levels.at,
        ticktext: chart.levels.text, thickness: 12, outlinewidth: 0 } },
    ...chart.curves.map(({ x, y }) => ({ x, y, mode: "lines", line: { color: colour("edge"), width: 2.2 }, hoverinfo: "skip", name: "limit" })),
    { x: [chart.here[0]], y: [chart.here[1]], mode: "markers", hoverinfo: "skip", name: "this rig",
      marker: { size: 15, color: colour("paper"), line: { color: colour("vermillion"), width: 4 } } },
  ];
  const numbersOn = chart.curves.flatMap(({ x, y, frequency }) => [0.25, 0.5, 0.75].map((part) => Math.round(part * (x.length - 1))).map((i) => [x[i], y[i], frequency[i]]))
    .filter(([x, y, f]) => f > 0 && x > chart.x.ends[0] * 1.2 && x < chart.x.ends[1] / 1.2 && y > chart.y.ends[0] * 1.2 && y < chart.y.ends[1] / 1.2);
  const apart = numbersOn.filter(([x, y], i) => numbersOn.slice(0, i).every(([a, b]) => Math.hypot(Math.log(x / a), Math.log(y / b)) > 0.7));
  $("map-frequency").textContent = apart.length ? `; numbers: frequency of the oscillation there, in ${chart.frequency_unit}` : "";
  const written = apart.map(([x, y, f]) => ({ x: Math.log10(x), y: Math.log10(y), text: f >= 100 ? f.toFixed(0) : String(short(f, 3)), showarrow: false,
    bgcolor: colour("paper"), borderpad: 1, font: { size: 11, color: colour("ink") } }));
  return draw("plot-map", traces, { hovermode: "closest", dragmode: false, annotations: written, margin: { l: 62, r: 8, t: 10, b: 48 },
    xaxis: logarithmic(chart.x), yaxis: logarithmic(chart.y) });
}
function turn(event) {
  const found = shown.chart && pointAt(event, "plot-map");
  if (!found || !(dragging || found.inside)) return false;
  moveTo(Math.pow(10, found.x), Math.pow(10, found.y));
  return true;
}
function moveTo(...there) {
  const { chart } = shown;
  chart.here = [chart.x, chart.y].map(({ ends: [low, high] }, i) => Math.min(Math.max(there[i], low), high));
  moveDot(chart.here);
  ask("edit", { turn: Object.fromEntries(chart.over.map((name, i) => [name, chart.here[i]])) });
}
$("plot-map").addEventListener("pointerdown", (event) => {
  if (event.button !== 0 || !turn(event)) return;
  dragging = true;
  $("plot-map").setPointerCapture(event.pointerId);
  event.stopPropagation();
}, true);
$("plot-map").addEventListener("pointermove", (event) => { if (dragging) turn(event); }, true);
for (const end of ["pointerup", "pointercancel"]) $("plot-map").addEventListener(end, () => { dragging = false; }, true);
$("plot-map").addEventListener("keydown", (event) => {
  const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
  if (!step || !shown.chart) return;
  event.preventDefault();
  moveTo(...shown.chart.here.map((value, i) => value * Math.pow(1.05, step[i])));
});
/* Only what the rig has can be an axis. */
function offerParameters(names) {
  if (!names.length) return;
  for (const id of ["across", "up"]) for (const option of $(id).options) option.disabled = !names.includes(option.value);
  for (const [id, other] of [["across", "up"], ["up", "across"]]) {
    if (names.includes($(id).value)) continue;
    $(id).value = names.find((name) => name !== $(other).value);
    refresh();
  }
}
for (const [id, chosen] of [["across", "stiffness"], ["up", "velocity"]]) {
  $(id).replaceChildren(...Object.entries(PARAMETERS).map(([value, [, text]]) => new Option(text, value)));
  $(id).value = chosen;
  $(id).onchange = () => {
    const other = $(id === "across" ? "up" : "across");
    if (other.value === $(id).value) other.value = [...other.options].find((option) => !option.disabled && option.value !== $(id).value).value;
    refresh();
  };
}
parts.map = {
  open() { drawMap(); refresh(); },
  changed() { summarise(); refresh(); },
  drawn(reply) {
    showRegime("map-regime", reply.regime);
    offerParameters(Object.keys(reply.parameters));
    // The dot has been moved on since, where a newer run is asked for, or the edit that asks for one.
    if (isNewest(reply) && !isPending("edit")) followDot(reply.parameters);
  },
};

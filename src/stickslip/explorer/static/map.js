/* The page Map: where smooth sliding is stable, over two parameters; the rig is a circle that can be dragged. */

import { colour, draw, logarithmic, purge, restyle } from "./figures.js";
import { put, short } from "./fields.js";
import { $, mark, parts, pretty, progress, showRegime, state, word } from "./page.js";
import { ask, drop, on, saying } from "./talk.js";

const PARAMETERS = { // by name: key and words
  stiffness: ["slider.stiffness", "K, driving spring"], velocity: ["drive.velocity", "v, speed"], mass: ["slider.mass", "M, mass"],
  damping: ["slider.damping", "η, damping"], delay: ["interface.delay", "τ, delay"],
  std: ["interface.thresholds.std", "Δf, threshold std. dev."], ageing: ["interface.ageing.time", "time of ageing"] };
const { shown } = state;
const asked = { chart: "", about: "", band: "" };
let resting = 0, dragging = false;

on("chart", (reply) => {
  shown.chart = reply;
  shown.bands = [];
  asked.band = "";
  mark("map", "");
  $("map-state").textContent = "";
  reply.about = asked.about;
  summarise();
  drawMap();
  if ($("band").checked) askBand();
}, (errors) => {
  refuse(errors);
  shown.chart = null;
  $("summary").textContent = "";
  purge("plot-map");
  mark("map", "refused", "");
}, "map");
on("band", (reply) => {
  shown.bands.push(reply);
  const none = shown.bands.some(({ bands }) => bands.length) ? "" : "no bistable band found";
  $("map-state").textContent = reply.columns < reply.of ? `bistable band: ${reply.columns} of ${reply.of} columns` : none;
  drawMap();
}, refuse, "map");
function refuse(errors) { $("map-state").textContent = pretty(saying(errors)); }

/* The sentence under the map is about one point: it stands only while the rig is there. */
function summarise() {
  $("summary").textContent = shown.chart && shown.chart.about === JSON.stringify(state.doc) ? shown.chart.summary : "";
}
/* The map stays as it is while only its own two parameters are varied. */
function signature(over) {
  const rest = structuredClone(state.doc);
  delete rest.simulation; delete rest.name; delete rest.assumed; delete rest.source;
  if (rest.drive) { delete rest.drive.distance; delete rest.drive.duration; }
  for (const parameter of over) put(rest, PARAMETERS[parameter][0], undefined);
  if (over.includes("damping")) put(rest, "slider.damping_ratio", undefined);
  return JSON.stringify([over, rest]);
}
const over = () => [$("across").value, $("up").value];
function askMap() {
  if (dragging) return;
  clearTimeout(resting);
  if (state.waiting) return;
  if (shown.chart && asked.chart === signature(over())) return mark("map", "");
  resting = setTimeout(() => {
    asked.chart = signature(over());
    asked.about = JSON.stringify(state.doc);
    drop("band");
    shown.bands = [];
    if (shown.chart) mark("map", "computing", "Computing … this is the map of the rig before.");
    $("map-state").textContent = "computing the map …";
    progress("map", 0);
    ask("chart", { over: over() });
  }, shown.chart ? 250 : 0);
}
/* Page 1 was turned: the dot follows, and a dot that has left its map asks for another. */
function followDot(parameters) {
  const { chart } = shown;
  if (!chart || dragging || asked.chart !== signature(chart.over)) return;
  const now = chart.over.map((parameter) => parameters[parameter]);
  if (now.some((value) => value === undefined)) return;
  const out = (value, [low, high]) => value < low * 0.999 || value > high * 1.001;
  if (out(now[0], chart.x.ends) || out(now[1], chart.y.ends)) { asked.chart = ""; if (state.page === "map") askMap(); return; }
  chart.here = now;
  if (state.page === "map") restyle("plot-map", { x: [[now[0]]], y: [[now[1]]] }, [$("plot-map").data.length - 1]);
}
function askBand() {
  const { chart } = shown;
  if (!chart || asked.band === asked.chart) return;
  asked.band = asked.chart;
  shown.bands = [];
  const ends = (id, all) => $("plot-map")._fullLayout?.[id].range.map((value) => Math.pow(10, value)) ?? all; // all: not drawn yet
  progress("map", 0);
  $("map-state").textContent = "bistable band …";
  ask("band", { over: chart.over, x: ends("xaxis", chart.x.ends), y: ends("yaxis", chart.y.ends) });
}
/* Columns computed so far, joined to their neighbours where these have as many bands. */
function bandOutline() {
  const columns = [...shown.bands].sort((a, b) => a.column - b.column), x = [], y = [];
  const width = Math.pow(shown.chart.x.ends[1] / shown.chart.x.ends[0], 1 / 8.5); // nine columns span the map
  columns.forEach(({ column, bands }, i) => {
    const next = columns[i + 1], before = columns[i - 1];
    const joined = (one, two) => one && two && one.bands.length === two.bands.length && two.column / one.column < width;
    bands.forEach(([low, high], j) => {
      if (joined(columns[i], next)) {
        x.push(column, next.column, next.column, column, column, null);
        y.push(low, next.bands[j][0], next.bands[j][1], high, low, null);
      } else if (!joined(before, columns[i])) {
        const [left, right] = [column / 1.04, column * 1.04];
        x.push(left, right, right, left, left, null);
        y.push(low, low, high, high, low, null);
      }
    });
  });
  return { x, y };
}
function drawMap() {
  const { chart } = shown;
  if (!chart || state.page !== "map") return;
  const bands = bandOutline();
  // As in `stickslip map`: purple is stable, orange unstable.
  const traces = [
    { type: "heatmap", x: chart.x.values, y: chart.y.values, z: chart.shade, customdata: chart.rate, zmin: -1, zmax: 1,
      colorscale: [[0, colour("stable")], [0.5, colour("neither")], [1, colour("unstable")]], zsmooth: "best",
      hovertemplate: `growth rate %{customdata} ${word(chart.rate_unit)}<extra></extra>`,
      colorbar: { title: { text: `growth rate (${word(chart.rate_unit)})`, side: "right" }, tickvals: chart.levels.at,
        ticktext: chart.levels.text, thickness: 12, outlinewidth: 0 } },
    { ...bands, mode: "lines", fill: "toself", fillpattern: { shape: "/", size: 7, fgcolor: colour("edge"), bgcolor: "rgba(0,0,0,0)" },
      line: { width: 0 }, hoverinfo: "skip", name: "bistable" },
    ...chart.curves.map(({ x, y }) => ({ x, y, mode: "lines", line: { color: colour("edge"), width: 2.2 }, hoverinfo: "skip", name: "limit" })),
    { x: [chart.here[0]], y: [chart.here[1]], mode: "markers", hoverinfo: "skip", name: "this rig",
      marker: { size: 15, color: colour("paper"), line: { color: colour("vermillion"), width: 4 } } },
  ];
  $("map-bistable").hidden = !bands.x.length;
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
  const plot = $("plot-map"), frame = plot._fullLayout, box = plot.getBoundingClientRect();
  if (!frame?.xaxis || !shown.chart) return false;
  const x = event.clientX - box.left - frame.xaxis._offset, y = event.clientY - box.top - frame.yaxis._offset;
  if (!dragging && (x < 0 || y < 0 || x > frame.xaxis._length || y > frame.yaxis._length)) return false;
  const clamp = (value, most) => Math.min(Math.max(value, 0), most);
  moveTo(Math.pow(10, frame.xaxis.p2l(clamp(x, frame.xaxis._length))), Math.pow(10, frame.yaxis.p2l(clamp(y, frame.yaxis._length))));
  return true;
}
function moveTo(x, y) {
  const { chart } = shown, dot = $("plot-map").data.length - 1;
  chart.here = [x, y];
  restyle("plot-map", { x: [[x]], y: [[y]] }, [dot]);
  ask("edit", { turn: { [chart.over[0]]: x, [chart.over[1]]: y } });
}
$("plot-map").addEventListener("pointerdown", (event) => {
  if (event.button === 0 && turn(event)) { dragging = true; $("plot-map").setPointerCapture(event.pointerId); event.stopPropagation(); }
}, true);
$("plot-map").addEventListener("pointermove", (event) => { if (dragging) turn(event); }, true);
for (const end of ["pointerup", "pointercancel"]) $("plot-map").addEventListener(end, () => { dragging = false; }, true);
$("plot-map").addEventListener("keydown", (event) => {
  const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
  if (!step || !shown.chart) return;
  event.preventDefault();
  const clamp = (value, [low, high]) => Math.min(Math.max(value, low), high);
  moveTo(clamp(shown.chart.here[0] * Math.pow(1.05, step[0]), shown.chart.x.ends),
    clamp(shown.chart.here[1] * Math.pow(1.05, step[1]), shown.chart.y.ends));
});
/* Only what the rig has can be an axis. */
function offerParameters(names) {
  if (!names.length) return;
  for (const id of ["across", "up"]) for (const option of $(id).options) option.disabled = !names.includes(option.value);
  for (const [id, other] of [["across", "up"], ["up", "across"]]) {
    if (names.includes($(id).value)) continue;
    $(id).value = names.find((name) => name !== $(other).value);
    if (state.page === "map") askMap();
  }
}
for (const [id, chosen] of [["across", "stiffness"], ["up", "velocity"]]) {
  $(id).replaceChildren(...Object.entries(PARAMETERS).map(([value, [, text]]) => new Option(text, value)));
  $(id).value = chosen;
  $(id).onchange = () => {
    const other = $(id === "across" ? "up" : "across");
    if (other.value === $(id).value) other.value = [...other.options].find((option) => !option.disabled && option.value !== $(id).value).value;
    askMap();
  };
}
$("band").onchange = () => {
  if ($("band").checked) return askBand();
  drop("band");
  asked.band = "";
  shown.bands = [];
  progress("map", null);
  $("map-state").textContent = "";
  drawMap();
};

parts.map = {
  open() { if (!state.waiting) { drawMap(); askMap(); } },
  changed() {
    if (shown.chart && asked.chart !== signature(over())) mark("map", "computing", "This is the map of the rig before.");
    summarise();
    if (state.page === "map") askMap();
  },
  drawn(reply) {
    showRegime("map-regime", reply.regime);
    offerParameters(Object.keys(reply.parameters));
    followDot(reply.parameters);
  },
};

/* Plots in the colours of the page. */

import { short } from "./fields.js";
import { $, element, state, word, unpacked } from "./page.js";

const Plotly = window.Plotly;
const CONFIG = { displayModeBar: false, displaylogo: false, responsive: true, showSendToCloud: false, plotlyServerURL: "",
  doubleClick: "reset" };

export const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

export function label({ title, unit }) {
  const shownUnit = unit === "time" ? "time units" : unit === "1" ? "" : word(unit);
  return shownUnit ? `${title} (${shownUnit})` : title;
}
export function axis(title, more = {}) {
  return { title: { text: title, standoff: 6 }, gridcolor: colour("grid"), zeroline: false, linecolor: colour("quiet"),
    ticks: "outside", ticklen: 3, tickcolor: colour("quiet"), exponentformat: "power", automargin: true, ...more };
}
/* A logarithmic axis: 1, 2, 5, 10 ... in the prefix that suits its middle. */
export function logarithmic({ title, unit, ends: [low, high] }) {
  const middle = Math.sqrt(low * high), prefixes = { "N/m": "mkMG", "m/s": "nµmk", s: "nµm" }[unit] ?? "";
  const sizes = { n: 1e-9, "µ": 1e-6, m: 1e-3, "": 1, k: 1e3, M: 1e6, G: 1e9 };
  const prefix = ["", ...prefixes].filter((p) => sizes[p] <= middle * 2).sort((p, q) => sizes[q] - sizes[p])[0] ?? "";
  const tickvals = [], wide = high / low > 200;
  for (let decade = Math.floor(Math.log10(low)); decade <= Math.log10(high); decade++) {
    for (const step of wide ? [1, 3] : [1, 2, 5]) {
      const value = step * Math.pow(10, decade);
      if (value >= low * 0.999 && value <= high * 1.001) tickvals.push(value);
    }
  }
  return axis(label({ title, unit: prefix + unit }), { type: "log", range: [Math.log10(low), Math.log10(high)], tickvals,
    ticktext: tickvals.map((value) => String(short(value / sizes[prefix], 2))) });
}
function layout(more) {
  return { paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", margin: { l: 56, r: 12, t: 22, b: 44 },
    font: { color: colour("ink"), size: 12, family: "system-ui, 'DejaVu Sans', sans-serif" }, showlegend: false,
    hovermode: false, dragmode: "zoom", ...more };
}
export function draw(id, traces, more) {
  return Plotly.react($(id), traces, layout(more), CONFIG);
}
/* Show a part of an axis; all, where it is shown already. */
export function zoom(id, range) {
  const now = $(id).layout.xaxis.range, same = now && Math.abs(now[0] - range[0]) + Math.abs(now[1] - range[1]) < 1e-6 * (range[1] - range[0]);
  return Plotly.relayout($(id), same ? { "xaxis.autorange": true } : { "xaxis.range": range });
}
export const restyle = (id, change, traces) => Plotly.restyle($(id), change, traces);

// ---------------------------------------------------------------------------------------------------- force traces

export function forceTraces(run, friction) {
  const { slips } = run, size = slips.count > 60 ? 3 : 6, kept = keptBeside(run);
  const traces = kept ? [{ ...scaled(kept, run), mode: "lines", line: { color: colour("quiet"), width: 1 }, opacity: 0.6, name: "before" }] : [];
  traces.push(
    { x: run.time.values, y: run.force.values, mode: "lines", line: { color: colour("blue"), width: 1.3 }, name: "force" },
    { x: slips.start, y: slips.before, mode: "markers", marker: { color: colour("vermillion"), size }, name: "slips" },
  );
  const ends = run.span, factor = run.force.factor;
  for (const [value, name, dash] of [[friction?.kinetic, "Fₖ", "dash"], [friction?.static, "Fₛ", "dot"]]) {
    if (value === null || value === undefined) continue;
    traces.push({ x: ends, y: [value / factor, value / factor], mode: "lines", line: { color: colour("green"), dash, width: 1.3 }, name });
  }
  return [...traces, shading(run)];
}
const keptBeside = (run) => (run === state.shown.run ? state.before : null);
/* A kept trace in the units of the one that is shown; "time" and "force" may have another prefix. */
function scaled(kept, run) {
  const turn = (packed, factor) => unpacked(packed).map((value) => value * factor);
  if (kept.time.unit.slice(-1) !== run.time.unit.slice(-1)) return { x: [], y: [] };
  return { x: turn(kept.time.values, kept.time.factor / run.time.factor), y: turn(kept.force.values, kept.force.factor / run.force.factor) };
}
/* One trace for all slips, on an axis of its own from 0 to 1: much quicker than a shape for each. */
function shading({ slips: { start, end, count } }) {
  const x = [], y = [];
  if (count <= 200) start.forEach((begin, i) => { x.push(begin, begin, end[i], end[i], null); y.push(0, 1, 1, 0, null); });
  return { x, y, yaxis: "y2", mode: "lines", line: { width: 0 }, fill: "toself", fillcolor: `${colour("orange")}50`, name: "slip" };
}
export function forceLayout(run, friction) {
  const count = run.slips.count, factor = run.force.factor, dots = count > 0 ? `${run.slips.counted}, marked` : "";
  const names = [[friction?.kinetic, "Fₖ"], [friction?.static, "Fₛ"]].filter(([value]) => value !== null && value !== undefined);
  const words = [dots, keptBeside(run) ? "grey: the trace kept" : ""].filter(Boolean).join("; ");
  return { shapes: [], yaxis2: { overlaying: "y", range: [0, 1], visible: false, fixedrange: true }, xaxis: axis(label(run.time), { range: run.span }), yaxis: axis(label(run.force)),
    margin: { l: 56, r: 28, t: 22, b: 44 },
    annotations: [...names.map(([value, text]) => ({ xref: "paper", x: 1.004, xanchor: "left", y: value / factor, text,
      showarrow: false, font: { color: colour("green") } })), { xref: "paper", yref: "paper", x: 1, y: 1, xanchor: "right", yanchor: "bottom", showarrow: false,
      text: words, font: { color: colour(count > 0 ? "vermillion" : "quiet") } }] };
}

// --------------------------------------------------------------------------------------------- a cursor over a plot

/* What is under the pointer, and whether that is between the axes; null before there are any. */
export function pointAt(event, id) {
  const { xaxis, yaxis } = $(id)._fullLayout ?? {}, box = $(id).getBoundingClientRect();
  if (!xaxis) return null;
  const x = event.clientX - box.left - xaxis._offset, y = event.clientY - box.top - yaxis._offset;
  const inside = x >= 0 && y >= 0 && x <= xaxis._length && y <= yaxis._length;
  return { x: xaxis.p2l(x), y: yaxis.p2l(y), inside };
}
/* A line, and a dot on it, over a plot: the plot need not be drawn again as they move. */
export function cursorOver(id) {
  const line = element("div", { className: "cursor", hidden: true }), dot = element("div", { className: "cursor-dot", hidden: true });
  $(id).parentElement.append(line, dot);
  return (time, value) => {
    const frame = $(id)._fullLayout;
    if (!frame?.xaxis?._length) return;
    const { xaxis, yaxis } = frame, x = xaxis.l2p(time), y = value === undefined ? -1 : yaxis.l2p(value);
    line.hidden = !(x >= 0 && x <= xaxis._length);
    line.style.transform = `translate(${xaxis._offset + x}px, ${yaxis._offset}px)`;
    line.style.height = `${yaxis._length}px`;
    dot.hidden = line.hidden || !(y >= 0 && y <= yaxis._length);
    dot.style.transform = `translate(${xaxis._offset + x}px, ${yaxis._offset + y}px)`;
  };
}

/* The page Simulate: the run, its pictures, and the drawing of the slider on its contacts. */

import { colour, cursorOver, draw, axis, forceLayout, forceTraces, label, logarithmic, pointAt } from "./figures.js";
import { short } from "./fields.js";
import { $, list, mark, parts, pretty, showRegime, state, tellParts, unpacked } from "./page.js";
import { accept, anyTyped, complain, showPreset } from "./rig.js";
import { makeStage } from "./stage.js";
import { ask, drop, isNewest, on, onceFor, saying } from "./talk.js";

const { shown } = state;
const point = cursorOver("plot-force");
let held = false; // the cursor stays where it was clicked

on("run", async (reply) => {
  if (reply.friction) {
    shown.friction = reply.friction;
    $("friction").textContent = pretty(reply.friction.words.join("; "));
    if (state.page === "simulate" && shown.run) drawForce();
    return;
  }
  const newest = isNewest(reply);
  if (newest) {
    accept();
    if (reply.going_on) mark("run", "computing", "Undecided so far: the run goes on by itself …");
    else if (!anyTyped()) mark("run", "");
  }
  reply.asked = structuredClone(newest ? state.doc : {});
  shown.run = reply;
  shown.stretchings = reply.stretchings;
  showRegime("regime", reply.regime);
  $("reason").textContent = reply.regime.reason;
  list("notes", reply.notes);
  list("evidence", reply.regime.evidence);
  showPreset();
  tellParts("drawn", reply, newest && !reply.going_on);
  if (newest && !reply.going_on) { askFrames(); refreshLaw(); }
  if (state.page === "simulate") {
    await drawForce();
    later(drawRest); // the trace first
  }
  document.dispatchEvent(new CustomEvent("drawn", { detail: { id: reply.id, kind: reply.regime.kind, extended: reply.going_on } }));
}, { refused: complain, bar: "run" });
on("stretchings", (reply) => {
  shown.stretchings = reply.stretchings;
  if (state.page === "simulate") drawStretchings();
}, { refused: complain });

const later = window.requestIdleCallback ? (work) => requestIdleCallback(work, { timeout: 120 }) : (work) => setTimeout(work, 40);
export async function drawForce() {
  const run = shown.run, slips = run.slips.count;
  const replayed = frames && !frames.exact ? [{ x: frames.clock.map((t) => t / run.time.factor), y: frames.pull.map((f) => f / run.force.factor), mode: "lines",
    line: { color: colour("purple"), width: 1 }, name: "replayed" }] : [];
  await draw("plot-force", [...forceTraces(run, shown.friction), ...replayed], forceLayout(run, shown.friction));
  $("plot-force").setAttribute("aria-label", `Spring force against time: ${run.regime.kind}${slips ? `, ${run.slips.counted} marked` : ""}`);
  pointHere();
}
function drawRest() {
  if (state.page !== "simulate") return;
  drawPhase();
  drawStretchings();
  drawLaw();
}
function drawPhase() {
  const { velocity, force, drive } = shown.run.phase;
  return draw("plot-phase", [{ x: velocity.values, y: force.values, mode: "lines", line: { color: colour("blue"), width: 1.2 } }], {
    xaxis: axis(label(velocity), { range: velocity.range }), yaxis: axis(label(force), { range: force.range }),
    shapes: [{ type: "line", x0: drive, x1: drive, yref: "paper", y0: 0, y1: 1, line: { color: colour("quiet"), dash: "dash", width: 1 } }],
    annotations: [{ x: drive, yref: "paper", y: 1, yanchor: "bottom", showarrow: false, text: "drive", font: { color: colour("quiet") } }] });
}
function drawStretchings() {
  const { x, stretching_density: Q, at: time } = shown.stretchings, unit = shown.run.time.unit;
  $("at").textContent = `t = ${short(time)}${unit === "time" ? "" : ` ${unit}`}`;
  return draw("plot-stretchings", [{ x: x.values, y: Q.values, mode: "lines", line: { shape: "hvh", color: colour("purple"), width: 1.3 },
    fill: "tozeroy", fillcolor: `${colour("purple")}44` }], { xaxis: axis(label(x)), yaxis: axis(label(Q), { rangemode: "tozero" }) });
}

// ------------------------------------------------------------------------------------------- the law of friction

/* It depends on the contacts and the speed alone: a rig that differs otherwise keeps it. */
const lawful = () => JSON.stringify([state.doc.interface, state.doc.drive, state.doc.units]);
on("law", (reply) => {
  shown.law = reply;
  $("law-turning").textContent = reply.turning.map(({ words }) => pretty(words)).join("; ");
  drawLaw();
}, { about: "law" });
const refreshLaw = onceFor("law", lawful, () => state.page === "simulate" && document.body.dataset.runState === "");
function drawLaw() {
  if (!shown.law || state.page !== "simulate") return;
  const { speed, force, values, here, turning } = shown.law, dots = (points, name, marker) => ({ x: points.map(([v]) => v), y: points.map(([, F]) => F), mode: "markers", name, marker });
  return draw("plot-law", [
    { x: speed.values, y: values, mode: "lines", name: "law", line: { color: colour("green"), width: 1.5 } },
    dots([here], "this rig", { size: 11, color: colour("paper"), line: { color: colour("vermillion"), width: 3 } }),
    dots(turning.map(({ at }) => at), "turning", { size: 9, symbol: "diamond", color: colour("purple") }),
  ], { xaxis: logarithmic(speed), yaxis: axis(label(force), { rangemode: "tozero" }) });
}

// ----------------------------------------------------------------------- the cursor: a look at another time of the run

const timeShown = () => shown.run.span[0] + state.cursor * (shown.run.span[1] - shown.run.span[0]);
const timeNow = () => timeShown() * shown.run.time.factor;
export const lasted = () => shown.run.span[1] * shown.run.time.factor; // of the run on the page, which may be cut short
const pointHere = (force) => { if (shown.run) point(timeShown(), force === undefined ? undefined : force / shown.run.force.factor); };

function look(event) {
  const found = shown.run && pointAt(event, "plot-force");
  if (!found?.inside) return;
  const [begin, end] = shown.run.span;
  state.cursor = Math.min(Math.max((found.x - begin) / (end - begin), 0), 1);
  ask("stretchings", { cursor: state.cursor, duration: lasted() });
  const there = frames && stage.span(), now = timeNow();
  if (there && now >= there[0] && now <= there[1]) stage.seek(now);
  else { pointHere(); askFrames(); }
}
$("plot-force").addEventListener("pointermove", (event) => { if (!held && !playing && event.pointerType === "mouse" && !event.buttons) look(event); });
$("plot-force").addEventListener("click", (event) => { held = !held || playing; look(event); }, true);

// --------------------------------------------------------------------------------------------------- the drawing

let frames = null, playing = !matchMedia("(prefers-reduced-motion: reduce)").matches, framing = 0;
const stage = makeStage($("drawing"), colour, (time, force) => {
  if (!shown.run) return;
  state.cursor = (time / shown.run.time.factor - shown.run.span[0]) / (shown.run.span[1] - shown.run.span[0]);
  if (state.page === "simulate") pointHere(force);
});
on("contacts", (reply) => {
  if (framing || !isNewest(reply)) return; // the cursor has moved on: another look is on its way
  const time = timeNow(); // showing begins with the first frame
  frames = reply.frames;
  mark("drawing", "");
  stage.show(frames);
  frames.clock = Array.from(unpacked(frames.times));
  frames.pull = Array.from(unpacked(frames.force));
  const shownOf = frames.shown < frames.of ? `${frames.shown} of the ${frames.of} contacts` : `all ${frames.of} contacts`;
  $("stage-words").textContent = frames.exact ? shownOf : frames.own ? `${shownOf}, of another run of the same rig (purple line)`
    : `${shownOf}, of a run with contacts of the same rig (purple line)`;
  for (const id of ["play", "pace", "slow"]) $(id).disabled = false;
  if (!frames.exact && state.page === "simulate") drawForce();
  const [begin, end] = stage.span();
  stage.seek(time >= begin && time <= end ? time : begin);
  if (playing) stage.play();
}, { refused(errors) { mark("drawing", "refused", ""); noDrawing(`No drawing: ${pretty(saying(errors))}`); } });

function askFrames() {
  clearTimeout(framing);
  framing = setTimeout(() => {
    framing = 0;
    if (state.page === "simulate" && shown.run && !state.waiting && document.body.dataset.runState === "") ask("contacts", { cursor: state.cursor, duration: lasted() });
  }, 250);
}
function noDrawing(words) {
  clearTimeout(framing);
  framing = 0;
  frames = null;
  stage.clear();
  for (const id of ["play", "pace", "slow"]) $(id).disabled = true;
  $("stage-words").textContent = words;
}
function setPlaying(now) {
  playing = now;
  $("play").textContent = playing ? "Pause" : "Play";
  $("play").setAttribute("aria-pressed", String(playing));
  if (playing && frames) stage.play();
  else if (!playing) { stage.pause(); if (shown.run) ask("stretchings", { cursor: state.cursor, duration: lasted() }); }
}
$("play").onclick = () => setPlaying(!playing);
$("pace").onchange = () => stage.pace(Number($("pace").value));
$("slow").onchange = () => stage.slow($("slow").checked);
window.addEventListener("resize", () => { if (state.page === "simulate") { stage.paint(); pointHere(); } });
setPlaying(playing);

// --------------------------------------------------------------------------------------------- before and after

export function keep(run) {
  state.before = run;
  $("keep").textContent = run ? "Remove comparison" : "Keep trace to compare";
  if (shown.run && state.page === "simulate") drawForce();
}
$("keep").onclick = () => keep(state.before ? null : shown.run);

parts.simulate = {
  async open() {
    if (shown.run) {
      await drawForce();
      drawRest();
      if (!frames) askFrames();
      refreshLaw();
    }
    if (playing && frames) stage.play();
  },
  close: () => stage.pause(),
  changed() {
    drop("contacts"); // of the rig before
    frames = null;
    stage.pause();
    mark("drawing", "computing", "");
    refreshLaw();
  },
  refused() { noDrawing(""); mark("drawing", "refused", ""); },
  chosen() { held = false; },
  recolour: () => stage.recolour(),
};

/* The tour: questions, each with a rig to begin with. The server sends them, and says of each run what it is; the trace of the
   beginning stays in grey, to compare with. */

import { at, put } from "./fields.js";
import { $, parts, state } from "./page.js";
import { begin, wait } from "./rig.js";
import { keep } from "./simulate.js";

const VARIED = ["slider.stiffness", "drive.velocity", "slider.mass", "interface.delay", "interface.thresholds.std", "simulation.contacts"];
let questions = [], asked = null;

function solved({ turn, factor, regime }, run) {
  const varied = VARIED.filter((key) => at(run.asked, key) !== at(state.began, key));
  const by = Math.abs(Math.log(at(run.asked, turn) / at(state.began, turn)));
  return run.regime.kind === regime && varied.join() === turn && (!factor || by >= Math.log(factor) * 0.999);
}
function judge() {
  if (!asked) return;
  if (state.before === null) keep(state.shown.run); // of the beginning, to compare with
  if (!solved(asked, state.shown.run)) return;
  $("tour-answer").textContent = `Yes. ${asked.answer}`;
  $("tour-answer").className = "solved";
}
function tour(question) {
  asked = question ?? null;
  $("tour").hidden = !asked;
  keep(null);
  if (!asked) return;
  $("tour-title").textContent = asked.title;
  $("tour-question").textContent = asked.question;
  $("tour-answer").textContent = "";
  $("tour-answer").className = "";
  $("tour-next").textContent = asked === questions.at(-1) ? "Done" : "Next question";
  wait(false);
  if (state.page !== "simulate") $("tab-simulate").click();
  const document = structuredClone(state.presets[0].document);
  for (const [key, value] of Object.entries(asked.rig)) put(document, key, value);
  begin(document);
}
$("tour-begin").onclick = () => tour(questions[0]);
$("tour-reset").onclick = () => tour(asked);
$("tour-next").onclick = () => tour(questions[questions.indexOf(asked) + 1]);
$("tour-end").onclick = () => tour(null);

parts.tour = { greeted(reply) { questions = reply.tour; }, drawn: (_, last) => { if (last) judge(); } };

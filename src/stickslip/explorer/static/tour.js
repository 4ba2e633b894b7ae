/* Five questions, each with a rig to begin with. `rig` changes the teaching bench; `solved` judges a run by what the
   server said of it; the trace of the beginning stays in grey, to compare with. */

import { at, put } from "./fields.js";
import { $, parts, state } from "./page.js";
import { begin, wait } from "./rig.js";
import { keep } from "./simulate.js";

const kind = (run, ...kinds) => kinds.includes(run.regime.kind);
const only = (run, begin, key) => {
  const differs = (name) => at(run.asked, name) !== at(begin, name);
  return ["slider.stiffness", "drive.velocity", "slider.mass", "interface.delay", "interface.thresholds.std"]
    .every((name) => name === key || !differs(name)) && differs(key);
};
const count = (document) => at(document, "simulation.contacts");

const QUESTIONS = [
  { title: "1 of 5: make it stick",
    question: "This block slides smoothly on its stiff spring. Make it stick and slip by one parameter: the driving spring, K.",
    rig: { "slider.stiffness": "10 kN/m" },
    solved: (run, begin) => kind(run, "stick-slip") && only(run, begin, "slider.stiffness"),
    answer: "A soft spring cannot let go as fast as the contacts do: once many break together, the block jumps." },
  { title: "2 of 5: stop it with the spring",
    question: "Now it sticks and slips. How stiff must the spring be until the slips are gone? Find the softest one.",
    rig: {},
    solved: (run, begin) => kind(run, "smooth sliding") && only(run, begin, "slider.stiffness"),
    answer: "Above the critical stiffness the spring takes up what the contacts give. The grey trace is how it was before; the map shows the limit." },
  { title: "3 of 5: stop it with speed",
    question: "The same block in oil (more damping). Leave the spring alone, and make it slide smoothly by the speed of the drive only.",
    rig: { "slider.damping_ratio": 0.3 },
    solved: (run, begin) => kind(run, "smooth sliding") && only(run, begin, "drive.velocity"),
    answer: "When the block moves more than a breaking displacement within the delay, fewer contacts hold at any time, and they no longer break together." },
  { title: "4 of 5: what is the noise?",
    question: "This slides smoothly, and yet the force is rough: it rests on 100 contacts. Is that stick-slip? Take 10 000 contacts (N) and compare.",
    rig: { "slider.stiffness": "10 kN/m", "simulation.contacts": 100 },
    solved: (run) => kind(run, "smooth sliding") && count(run.asked) >= 9000,
    answer: "It was noise: contacts break one by one, and their force varies as 1/√N. A hundred times the contacts, a tenth of the noise." },
  { title: "5 of 5: what does N do to the slips?",
    question: "Stick-slip again, with 1000 contacts. Take 100 or 10 000: do the slips become smaller or rarer?",
    rig: {},
    solved: (run, begin) => kind(run, "stick-slip") && (count(run.asked) >= 10 * count(begin) || count(run.asked) <= 0.1 * count(begin)),
    answer: "Hardly: the slips of stick-slip are made by all contacts together, and stay. Only noise depends on N." },
];

function beginning(bench, index) {
  const document = structuredClone(bench);
  for (const [key, value] of Object.entries(QUESTIONS[index].rig)) put(document, key, value);
  return document;
}

let question = -1;

function judge() {
  if (question < 0) return;
  if (state.before === null) keep(state.shown.run); // of the beginning, to compare with
  if (!QUESTIONS[question].solved(state.shown.run, state.began)) return;
  $("tour-answer").textContent = `Yes. ${QUESTIONS[question].answer}`;
  $("tour-answer").className = "solved";
}
function tour(index) {
  question = index >= QUESTIONS.length ? -1 : index;
  $("tour").hidden = question < 0;
  keep(null);
  if (question < 0) return;
  const { title, question: words } = QUESTIONS[question];
  $("tour-title").textContent = title;
  $("tour-question").textContent = words;
  $("tour-answer").textContent = "";
  $("tour-answer").className = "";
  $("tour-next").textContent = question + 1 < QUESTIONS.length ? "Next question" : "Done";
  wait(false);
  if (state.page !== "simulate") $("tab-simulate").click();
  begin(beginning(state.presets[0].document, question));
}
$("tour-begin").onclick = () => { if (state.presets.length) tour(0); };
$("tour-reset").onclick = () => tour(question);
$("tour-next").onclick = () => tour(question + 1);
$("tour-end").onclick = () => tour(-1);

parts.tour = { drawn: (_, last) => { if (last) judge(); } };

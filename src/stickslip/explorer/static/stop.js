/* The page What would stop it?: the prediction, and mitigations that a button applies. */

import { $, element, list, mark, parts, pretty, progress, state, table } from "./page.js";
import { ask, on, saying } from "./talk.js";

const { shown } = state;
let asked = "", resting = 0;

on("advice", (reply) => {
  shown.advice = reply;
  mark("stop", "");
  show(reply);
}, (errors) => {
  $("stop-state").textContent = pretty(saying(errors));
  mark("stop", "refused", shown.advice ? "Refused: what stands here is about the rig before." : "");
}, "stop");

function predict() {
  const text = JSON.stringify(state.doc);
  if (asked === text) return;
  if (shown.advice) mark("stop", "computing", "Computing … this is about the rig before.");
  clearTimeout(resting);
  resting = setTimeout(() => {
    asked = text;
    $("stop-state").textContent = "predicting …";
    progress("stop", 0);
    ask("advice");
  }, 200);
}
function show(found) {
  $("stop-state").textContent = "";
  $("verdict").textContent = pretty(`${found.name}: ${found.verdict}`);
  $("verdict").parentElement.className = `verdict ${found.ill ? "stick-slip" : "smooth-sliding"}`;
  list("stop-evidence", found.evidence);
  table("numbers", found.numbers);
  table("margins", found.margins, ["parameter", "now", "limit below", "limit above"]);
  const mitigations = found.mitigations.map(({ steps }) => element("li", {},
    ...steps.map(({ title, to, values }) => element("p", {}, element("strong", { textContent: title }), ` (${pretty(to)}) `,
      element("button", { type: "button", textContent: "Apply", ariaLabel: `Apply: ${title}`, onclick: () => ask("edit", { turn: values }) })))));
  const none = found.ill ? "No change within the ranges searched gives smooth sliding." : "None needed.";
  $("mitigations").replaceChildren(...(mitigations.length ? mitigations : [element("li", { textContent: none })]));
  list("attempts", [...found.attempts, found.not_searched].filter(Boolean));
  const assumed = Object.entries(found.assumed).map(([key, how]) => element("li", { textContent: `${key}: ${how}` }));
  $("assumed").replaceChildren(...(assumed.length ? [element("h2", { textContent: "Assumed, not measured" }), element("ul", {}, ...assumed)] : []));
}

parts.stop = {
  open: () => { if (!state.waiting) predict(); },
  changed() {
    if (shown.advice && asked !== JSON.stringify(state.doc)) mark("stop", "computing", "This is about the rig before.");
    if (state.page === "stop") predict();
  },
};

/* The page What would stop it?: the prediction, and mitigations that a button applies. */

import { $, element, list, parts, pretty, state, table } from "./page.js";
import { ask, on, onceFor } from "./talk.js";

on("advice", show, { about: "stop" });
const refresh = onceFor("advice", () => JSON.stringify(state.doc), () => state.page === "stop");

function show(found) {
  $("verdict").textContent = pretty(`${found.name}: ${found.verdict}`);
  $("verdict").parentElement.className = `verdict ${found.needs_mitigation ? "stick-slip" : "smooth-sliding"}`;
  list("stop-evidence", found.evidence);
  table("numbers", found.numbers);
  table("margins", found.margins, ["parameter", "now", "limit below", "limit above"]);
  const mitigations = found.mitigations.map(({ title, values }) => element("li", {},
    element("p", {}, element("strong", { textContent: pretty(title) }), " ",
      element("button", { type: "button", textContent: "Apply", ariaLabel: `Apply: ${title}`, onclick: () => ask("edit", { turn: values }) }))));
  const none = found.needs_mitigation ? "No change within the ranges searched gives smooth sliding." : "None needed.";
  $("mitigations").replaceChildren(...(mitigations.length ? mitigations : [element("li", { textContent: none })]));
  list("attempts", [...found.attempts, found.not_searched].filter(Boolean));
  const assumed = Object.entries(found.assumed).map(([key, how]) => element("li", { textContent: `${key}: ${how}` }));
  $("assumed").replaceChildren(...(assumed.length ? [element("h2", { textContent: "Assumed, not measured" }), element("ul", {}, ...assumed)] : []));
}

parts.stop = { open: refresh, changed: refresh };

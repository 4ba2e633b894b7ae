/* The page Measured trace, and the trace itself, which the page Fit uses too. */

import { draw, forceLayout, forceTraces } from "./figures.js";
import { short } from "./fields.js";
import { $, list, mark, parts, showRegime, state, table, tellParts } from "./page.js";
import { saying } from "./talk.js";

const LARGEST = 50e6;
const { shown } = state;
let file = null;

/* The file, and how it is to be read; null before there is one. */
export const source = () => file && { file, query: { name: file.name, width: Math.max(300, $("pages").clientWidth),
  force: $("column-force").value, time: $("column-time").value, step: $("step").value } };

async function analyse(chosen) {
  file = chosen;
  $("again").hidden = false;
  if (file.size > LARGEST) {
    return complain(`${file.name} has ${Math.round(file.size / 1e6)} MB, more than ${LARGEST / 1e6}; keep every n-th row or a part of it, or use stickslip measure`);
  }
  $("trace-state").textContent = `reading ${file.name} …`;
  if (shown.trace) mark("trace", "computing", `Reading … this is ${shown.trace.name}.`);
  try {
    const answer = await fetch(`trace?${new URLSearchParams(source().query)}`, { method: "POST", body: file });
    if (file !== chosen) return;
    const found = await answer.json();
    if (found.errors) return complain(saying(found.errors));
    shown.trace = found;
    show(found);
    tellParts("measured", chosen);
  } catch {
    complain(`${chosen.name} could not be read, or the server is gone`);
  }
}
function complain(text) {
  $("trace-state").textContent = "";
  $("trace-complaint").textContent = text;
  $("trace-complaint").hidden = false;
  $("trace-found").hidden = true;
  shown.trace = null;
  tellParts("measured", null);
}
function show(found) {
  mark("trace", "");
  $("trace-complaint").hidden = true;
  $("trace-found").hidden = false;
  $("trace-state").textContent = `${found.name}: ${found.rows} rows${found.note ? `; ${found.note}` : ""}`;
  const per = found.regime.period;
  showRegime("trace-regime", found.regime, per && found.regime.kind !== "smooth sliding" && found.time.unit.endsWith("s") ? `${short(1 / per, 3)} Hz` : "");
  $("trace-reason").textContent = found.regime.reason;
  list("trace-evidence", found.regime.evidence);
  table("statistics", found.statistics);
  if (state.page === "trace") draw("plot-trace", forceTraces(found), forceLayout(found));
}

$("file").onchange = () => { if ($("file").files[0]) analyse($("file").files[0]); $("file").value = ""; };
$("sample").onclick = async () => {
  const answer = await fetch("sample.csv").catch(() => null);
  if (answer?.ok) analyse(new File([await answer.blob()], "sample.csv"));
};
$("again").onclick = () => analyse(file);
for (const kind of ["dragover", "drop"]) {
  window.addEventListener(kind, (event) => { // anywhere on the page, so that a miss does not leave it
    event.preventDefault();
    $("drop").classList.toggle("over", kind === "dragover");
    if (kind !== "drop" || !event.dataTransfer.files[0]) return;
    if (state.page !== "fit") $("tab-trace").click();
    analyse(event.dataTransfer.files[0]);
  });
}
window.addEventListener("dragleave", () => $("drop").classList.remove("over"));

parts.trace = {
  open() { $("source").hidden = false; if (shown.trace) show(shown.trace); },
  close() { $("source").hidden = true; },
};

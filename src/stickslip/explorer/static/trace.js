/* The page Measured trace, and the trace itself, which the page Fit uses too. */

import { draw, forceLayout, forceTraces, zoom } from "./figures.js";
import { $, element, list, parts, showRegime, state, table, tellParts } from "./page.js";
import { ask, on, refuse } from "./talk.js";

const { shown } = state;
const CHOICES = [$("column-force"), $("column-time")];
let file = null, largest = 0;

/* The file, and how it is to be read; null before there is one. */
export const source = () => file && { file, name: file.name,
  options: { force: $("column-force").value, time: $("column-time").value, step: $("step").value } };

async function analyse(chosen) {
  if (chosen.size > largest) {
    return complain(`${chosen.name} has ${Math.round(chosen.size / 1e6)} MB, more than ${largest / 1e6}; keep every n-th row or a part of it, or use stickslip measure`);
  }
  $("trace-state").textContent = `reading ${chosen.name} …`;
  const bytes = await chosen.arrayBuffer().catch(() => null);
  if (!bytes) return complain(`${chosen.name} could not be read`);
  file = new File([bytes], chosen.name); // a copy: the file may go, or change
  ask("trace", source());
}
on("trace", (reply) => {
  if (reply.columns) return offer(reply.columns);
  shown.trace = reply;
  show(reply);
  tellParts("measured", file);
}, { about: "trace", whole: (reply) => !reply.columns, refused() { $("trace-state").textContent = ""; tellParts("measured", null); } });
const complain = (message) => refuse("trace", [{ message }]);
on("sample", ({ text }) => analyse(new File([text], "sample.csv")));
/* The columns of the file; the choice of those of the file before stays where this one has them, too. */
function offer(columns) {
  const asked = JSON.stringify(source());
  for (const list of CHOICES) {
    const chosen = columns.some(([value]) => value === list.value) ? list.value : "";
    list.replaceChildren(new Option("automatic", ""), ...columns.map(([value, text, preview]) => new Option(`${text}: ${preview}`, value)));
    list.value = chosen;
  }
  if (asked !== JSON.stringify(source())) analyse(file);
}
function show(found) {
  $("trace-state").textContent = [`${found.name}: ${found.rows} rows`, found.note, `read: ${found.read}`].filter(Boolean).join("; ");
  showRegime("trace-regime", found.regime);
  $("trace-reason").textContent = found.regime.reason;
  list("trace-evidence", found.regime.evidence);
  showParts(found);
  table("statistics", found.statistics);
  $("trace-next").hidden = found.slips.count === 0;
  if (state.page === "trace") draw("plot-trace", forceTraces(found), forceLayout(found));
}

/* The parts that were judged apart; a click on one shows it in the trace, a second click all. */
function showParts({ parts: rows, time }) {
  $("trace-parts-title").hidden = rows.length === 0;
  const [head, ...lines] = rows;
  const row = (cells, tag) => element("tr", {}, ...cells.map((cell) => element(tag, { textContent: cell })));
  $("trace-parts").replaceChildren(...(head ? [row(head.cells, "th")] : []), ...lines.map(({ cells, span }) => {
    const line = row(cells, "td");
    line.tabIndex = 0;
    line.title = "Show this part";
    line.onclick = () => zoom("plot-trace", span.map((t) => t / time.factor));
    line.onkeydown = ({ key }) => { if (key === "Enter") line.click(); };
    return line;
  }));
}

$("file").onchange = () => { if ($("file").files[0]) analyse($("file").files[0]); $("file").value = ""; };
$("sample").onclick = () => ask("sample");
for (const input of [...CHOICES, $("step")]) input.onchange = () => { if (file) analyse(file); };
$("trace-next").onclick = () => $("tab-fit").click();
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
  greeted(reply) { largest = reply.largest; },
  open() { if (shown.trace) show(shown.trace); },
};

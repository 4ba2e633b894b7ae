"use strict";
/* The page. Its whole state is one document, the content of a rig file: shown in the fields, sent whole with every
   question, kept in the address. Answers carry the number of their question; only the newest counts. */

(() => {
  const { ALL, split, numeric, short, at, pointed, unfinished } = Fields;
  const $ = (id) => document.getElementById(id);
  const PAGES = ["simulate", "map", "stop", "trace"];
  const OLD = { interface: "simulate", advice: "stop" }; // names of pages in links made before
  const PAUSE = 1000; // ms without a key after which a number that was typed counts
  const PARAMETERS = { stiffness: "K, driving spring", velocity: "v, speed", mass: "M, mass", damping: "η, damping",
    delay: "τ, delay", std: "Δf, threshold std. dev.", ageing: "time of ageing" };
  const FRAME = 400; // ms after which a question is asked anew although the last is not answered

  let doc = null, presets = [], page = "simulate", cursor = 0.75, held = false, measured = null;
  let began = null, waiting = false, scales = null, before = null, question = -1;
  const shown = { run: null, friction: null, chart: null, bands: [], advice: null, trace: null };
  const asked = { chart: "", advice: "", band: "" };

  // ------------------------------------------------------------------------------------------------ asking

  let socket = null, counter = 0;
  const lanes = {}; // kind -> {id, sent, waiting, waiter}

  function ask(kind, content = {}) {
    const lane = (lanes[kind] ??= { id: 0, answered: 0, sent: 0 });
    lane.waiting = { kind, id: ++counter, document: doc, width: Math.max(300, $("pages").clientWidth), ...content };
    lane.wanted = lane.waiting.id;
    pump(lane);
    return lane.wanted;
  }
  function pump(lane) {
    clearTimeout(lane.waiter);
    if (!lane.waiting || socket?.readyState !== WebSocket.OPEN) return;
    const left = lane.id > lane.answered ? lane.sent + FRAME - performance.now() : 0;
    if (left > 0) return void (lane.waiter = setTimeout(pump, left, lane));
    lane.id = lane.waiting.id;
    lane.sent = performance.now();
    socket.send(JSON.stringify(lane.waiting));
    lane.waiting = null;
  }
  function drop(kind) {
    if (lanes[kind]) { lanes[kind].wanted = 0; lanes[kind].waiting = null; }
    if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify({ kind, drop: true }));
  }
  function connect() {
    socket = new WebSocket(`ws://${location.host}${location.pathname.replace(/[^/]*$/, "")}session`);
    socket.onopen = () => {
      notice("");
      for (const lane of Object.values(lanes)) { lane.answered = lane.id; pump(lane); }
    };
    socket.onclose = () => {
      notice("The server is gone, or has no room for another window. This page will find it again.");
      setTimeout(connect, 2000);
    };
    socket.onmessage = (event) => receive(JSON.parse(event.data));
  }
  function receive(reply) {
    if (reply.kind === "hello") return hello(reply);
    if (reply.kind === "error") return complain("run", reply.errors);
    const lane = lanes[reply.kind];
    if (!lane) return;
    if (reply.done || reply.errors) { lane.answered = Math.max(lane.answered, reply.id); pump(lane); }
    if (reply.id !== lane.wanted && !(reply.kind === "run" && reply.force && reply.id === lane.id)) return;
    if (reply.errors) return complain(reply.kind, reply.errors);
    ANSWERS[reply.kind](reply);
  }
  function notice(text) {
    $("notice").textContent = text;
    $("notice").hidden = !text;
  }

  // ------------------------------------------------------------------------------------------------ the document

  function hello(reply) {
    if (doc) return changed(); // connected again
    presets = reply.presets;
    fillPresets();
    const linked = fromAddress();
    doc = linked ?? reply.document;
    began = structuredClone(doc);
    // What a link holds was written by somebody else: it is shown, and computed on a click. A reload goes on.
    wait(linked !== null && sessionStorage.getItem("here") !== location.hash);
    rebuild();
    open(page);
    changed();
  }
  function wait(now) {
    waiting = now;
    $("waiting").hidden = !waiting;
    for (const about of ["run", "drawing", "map", "stop"]) if (waiting) mark(about, "waiting", "Not computed yet: this rig came with a link.");
  }
  function changed() {
    remember();
    if (waiting) return;
    document.body.dataset.asked = ask("run", { cursor });
    mark("run", "computing", shown.run ? "Computing … what stands here is the rig before." : "Computing …");
    drop("contacts"); // of the rig before
    frames = null;
    stage.pause();
    mark("drawing", "computing");
    clearTimeout(patience);
    patience = setTimeout(() => progress("run", NaN), 600); // a long run, or kernels that are being compiled
    if (shown.advice && asked.advice !== JSON.stringify(doc)) mark("stop", "computing", "This is about the rig before.");
    if (shown.chart && asked.chart !== signature(over())) mark("map", "computing", "This is the map of the rig before.");
    summarise();
    if (page === "map") askMap();
    if (page === "stop") askAdvice();
  }
  /* The sentence under the map is about one point: it stands only while the rig is there. */
  function summarise() {
    $("summary").textContent = shown.chart && shown.chart.about === JSON.stringify(doc) ? shown.chart.summary : "";
  }
  function replace(next) {
    doc = next;
    rebuild();
    changed();
  }
  /* Never stale: what is not about the rig in the fields is dimmed, and words say so. */
  function mark(about, state, words = "") {
    for (const part of document.querySelectorAll(`[data-about="${about}"]`)) {
      part.dataset.state = state;
      part.setAttribute("aria-busy", String(state === "computing"));
    }
    const line = $(`${about}-words`);
    line.textContent = words;
    line.hidden = words === "";
    document.body.dataset[`${about}State`] = state;
  }

  let remembering = 0, patience = 0;
  function remember() {
    clearTimeout(remembering);
    remembering = setTimeout(() => { history.replaceState(null, "", address()); keepHere(); }, 250);
  }
  const keepHere = () => { if (!waiting) sessionStorage.setItem("here", location.hash); };
  function address() {
    const bytes = new TextEncoder().encode(JSON.stringify(doc));
    const text = btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join(""));
    return `#${page}/${text.replaceAll("+", "-").replaceAll("/", "_").replace(/=+$/, "")}`;
  }
  function fromAddress() {
    const [name, text] = location.hash.slice(1).split("/"), where = OLD[name] ?? name;
    if (PAGES.includes(where)) page = where;
    if (!text) return null;
    try {
      const bytes = Uint8Array.from(atob(text.replaceAll("-", "+").replaceAll("_", "/")), (c) => c.charCodeAt(0));
      const found = JSON.parse(new TextDecoder().decode(bytes));
      return found && typeof found === "object" && !Array.isArray(found) ? found : null;
    } catch {
      notice("The link is damaged; this is the rig the app begins with.");
      return null;
    }
  }
  window.addEventListener("hashchange", () => {
    const found = fromAddress();
    if (found) { wait(true); replace(found); open(page); }
  });
  $("go").onclick = () => { wait(false); rebuild(); open(page); changed(); };

  // ------------------------------------------------------------------------------------------------ fields

  let rows = [];
  function element(tag, properties = {}, ...children) {
    const node = Object.assign(document.createElement(tag), properties);
    node.append(...children);
    return node;
  }
  function rebuild() {
    $("units").value = doc.units === "natural" ? "natural" : "SI";
    rows = [];
    const host = document.createDocumentFragment();
    let group = null;
    for (const field of ALL) {
      if (field.group) host.append((group = element("fieldset", {}, element("legend", { textContent: field.group }))));
      else if (!field.when || field.when(doc)) group.append(row(field));
    }
    $("fields").replaceChildren(host);
    showPreset();
  }
  function told(key) {
    const entry = Glossary.find((one) => one.key === key);
    return entry ? `${entry.term}${entry.unit ? ` (${entry.unit})` : ""}. ${entry.text}` : "";
  }
  function row(field) {
    const id = `field-${field.key.replaceAll(".", "-")}`, box = element("div", { className: "field" });
    const label = element("label", { htmlFor: id, title: told(field.key) });
    for (const event of ["pointerenter", "focusin"]) box.addEventListener(event, () => { $("help").textContent = told(field.key); });
    if (field.symbol) label.append(element("i", { textContent: field.symbol }), " ");
    label.append(field.title);
    const complaint = element("p", { className: "complaint", id: `${id}-complaint`, hidden: true });
    complaint.setAttribute("role", "alert");
    const made = { field, complaint };
    rows.push(made);
    if (field.choices) {
      made.input = element("select", { id }, ...Object.entries(field.choices).map(([value, text]) => new Option(text, value)));
      made.input.value = field.read(doc) ?? field.missing ?? Object.keys(field.choices)[0];
      made.input.onchange = () => { field.write(doc, made.input.value); rebuild(); changed(); };
      box.append(label, made.input, complaint);
      return box;
    }
    const natural = doc.units === "natural";
    const [number, unit] = split(field.read(doc) ?? field.missing ?? (field.zero ? 0 : undefined));
    made.unit = field.plain || natural ? "" : unit || field.si;
    made.input = element("input", { id, type: "text", inputMode: "decimal", value: number, autocomplete: "off" });
    made.input.setAttribute("aria-describedby", `${complaint.id} help`);
    const shownUnit = element("span", { className: "unit", textContent: field.plain && !natural ? relative(field) :
      micro(made.unit || field.unit || "") });
    made.shownUnit = shownUnit;
    if (field.swap) {
      const menu = element("button", { type: "button", textContent: `${shownUnit.textContent} ⇄`, title: `Give ${field.swap} instead` });
      menu.onclick = () => ask("edit", { damping_ratio: field.swap === "ζ" });
      shownUnit.replaceChildren(menu);
      menu.style.padding = "0 .3rem";
    }
    made.input.oninput = () => typing(made);
    made.input.onchange = () => { settleTyping(made); tidy(made); };
    box.append(label, made.input, shownUnit);
    if (field.range) {
      made.slider = element("input", { type: "range", min: 0, max: 1000, step: 1, id: `${id}-slider` });
      made.slider.setAttribute("aria-label", field.title);
      made.range = rangeOf(made, parseFloat(number));
      place(made);
      made.slider.oninput = () => {
        clearTimeout(made.pause);
        made.typed = false;
        made.input.value = String(valueAt(made, Number(made.slider.value)));
        enter(made, made.input.value);
      };
      box.append(made.slider);
    }
    box.append(complaint);
    return box;
  }
  const relative = (field) => (field.unit === "xₛ" ? "of xₛ" : "");
  /* The slider spans its natural range, or in SI as many decades about the value; always the value itself. */
  function rangeOf({ field }, value) {
    let [low, high] = field.range;
    if (!(field.plain || doc.units === "natural")) {
      const middle = value > 0 ? value : 1, factor = Math.sqrt(high / low);
      [low, high] = [middle / factor, middle * factor];
    }
    return value > 0 ? [Math.min(low, value), Math.max(high, value)] : [low, high];
  }
  function valueAt({ field, range: [low, high] }, position) {
    if (field.zero && position === 0) return 0;
    const value = low * Math.pow(high / low, position / 1000);
    return field.whole ? Math.round(value) : short(value, 3);
  }
  function place(made) {
    if (!made.slider) return;
    const value = parseFloat(made.input.value), [low, high] = made.range;
    if (field0(made, value)) made.slider.value = 0;
    else if (value > 0) made.slider.value = Math.round((1000 * Math.log(value / low)) / Math.log(high / low));
    made.slider.setAttribute("aria-valuetext", `${made.input.value} ${made.shownUnit.textContent}`);
  }
  const field0 = ({ field }, value) => field.zero && !(value > 0);
  /* While a number is typed nothing is computed: it counts after Enter, on leaving the field, or after a pause. */
  function typing(made) {
    const text = pointed(made.input.value); // a decimal comma becomes a point, before one's eyes
    if (text !== made.input.value) made.input.value = text;
    clearTimeout(made.pause);
    made.typed = true;
    if (waiting) return;
    mark("run", "computing", "Waiting for the number: press Enter.");
    if (!unfinished(text)) made.pause = setTimeout(settleTyping, PAUSE, made);
  }
  function settleTyping(made) {
    clearTimeout(made.pause);
    if (!made.typed) return;
    made.typed = false;
    const text = made.input.value.trim();
    if (text === "") { // emptied and left: what it was before
      made.input.value = split(made.field.read(doc) ?? made.field.missing ?? (made.field.zero ? 0 : undefined))[0];
      return changed();
    }
    enter(made, made.input.value);
  }
  /* What stands in a field goes into the document as it is; the server says what is wrong with it. */
  function enter(made, text) {
    const { field } = made, trimmed = text.trim().replace(/^([-+]?\d+)[.](?!\d)/, "$1"), [found, typedUnit] = split(trimmed);
    const natural = field.plain || doc.units === "natural";
    // The unit that stands beside the field may be typed as well.
    const known = natural && typedUnit !== "" && [field.unit, made.shownUnit.textContent].includes(typedUnit);
    const number = numeric(known ? found : trimmed);
    let value = trimmed;
    if (natural) value = isNaN(number) ? trimmed : number;
    else if (trimmed !== "never" && !typedUnit) value = `${trimmed} ${made.unit}`;
    field.write(doc, value);
    if (known) made.input.value = found;
    if (document.activeElement !== made.slider) place(made);
    changed();
  }
  function tidy(made) {
    const [number, unit] = split(made.input.value);
    if (!unit || made.field.plain || doc.units === "natural") return;
    made.unit = unit; // typed with a unit: it moves to its place beside the field
    made.input.value = number;
    if (made.slider) made.range = rangeOf(made, parseFloat(number));
    place(made);
    if (!made.field.swap) made.shownUnit.textContent = micro(unit);
  }
  function complain(kind, errors) {
    const said = word2(errors.map((e) => e.message).join("; "));
    if (["chart", "band", "advice"].includes(kind)) {
      const where = kind === "advice" ? "stop" : "map";
      $(`${where}-state`).textContent = said;
      progress(where, null);
      if (kind === "chart") { shown.chart = null; $("summary").textContent = ""; Plotly.purge($("plot-map")); mark("map", "refused", ""); }
      if (kind === "advice") mark("stop", "refused", shown.advice ? "Refused: what stands here is about the rig before." : "");
      return;
    }
    if (kind === "contacts") { mark("drawing", "refused"); return noDrawing(`No drawing: ${said}`); }
    settle();
    progress("run", null);
    noDrawing("");
    mark("drawing", "refused");
    mark("run", "refused", shown.run ? "Refused, see the message beside the rig: what stands here is the rig before." : "Refused.");
    const rest = [];
    for (const { key, message } of errors) {
      const made = key && rows.find((r) => key === r.field.key) || key && rows.find((r) => r.field.key.startsWith(`${key}.`) ||
        key.startsWith(`${r.field.key}.`));
      if (!made) { rest.push(message); continue; }
      made.input.setAttribute("aria-invalid", "true");
      made.complaint.textContent = message;
      made.complaint.hidden = false;
    }
    $("complaint").textContent = rest.join("; ");
    $("complaint").hidden = rest.length === 0;
    document.dispatchEvent(new CustomEvent("complained"));
  }
  function settle() {
    for (const made of rows) {
      made.input.removeAttribute("aria-invalid");
      made.complaint.hidden = true;
    }
    $("complaint").hidden = true;
  }

  function fillPresets() {
    const groups = {};
    presets.forEach(({ group, title }, i) => {
      groups[group] ??= element("optgroup", { label: group });
      groups[group].append(new Option(title, i));
    });
    $("preset").replaceChildren(new Option("(your own)", ""), ...Object.values(groups));
    $("preset").onchange = () => {
      const chosen = presets[$("preset").value];
      if (chosen) { cursor = 0.75; held = false; wait(false); begin(structuredClone(chosen.document)); }
    };
  }
  function begin(next) {
    began = structuredClone(next);
    shown.friction = null;
    replace(next);
  }
  $("reset").onclick = () => replace(structuredClone(began));
  $("keep").onclick = () => {
    before = before ? null : shown.run;
    $("keep").textContent = before ? "Let the kept trace go" : "Keep trace to compare";
    if (shown.run) drawForce();
  };
  function showPreset() {
    const text = JSON.stringify(doc);
    const index = presets.findIndex((preset) => JSON.stringify(preset.document) === text);
    $("preset").value = index < 0 ? "" : String(index);
  }

  // ------------------------------------------------------------------------------------------------ drawing

  const word = (text) => text.replace(/\b([xf])_s\b/g, "$1ₛ").replace(/\^2/g, "²").replace(/\btime\b/g, "time unit");
  function label({ title, unit }) {
    const shownUnit = unit === "time" ? "time units" : unit === "1" ? "" : word(unit);
    return shownUnit ? `${title} (${shownUnit})` : title;
  }
  /* A label up a low plot: in two lines if it is long. */
  function upright(variable) {
    const text = label(variable);
    if (text.length < 22 || !matchMedia("(max-width: 40rem)").matches) return text;
    const spaces = [...text.matchAll(/ /g)].map((found) => found.index);
    const cut = spaces.reduce((best, at) => (Math.abs(at - text.length / 2) < Math.abs(best - text.length / 2) ? at : best));
    return `${text.slice(0, cut)}<br>${text.slice(cut + 1)}`;
  }
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
  const CONFIG = { displayModeBar: false, displaylogo: false, responsive: true, showSendToCloud: false, plotlyServerURL: "",
    doubleClick: "reset" };
  function axis(title, more = {}) {
    return { title: { text: title, standoff: 6 }, gridcolor: colour("grid"), zeroline: false, linecolor: colour("quiet"),
      ticks: "outside", ticklen: 3, tickcolor: colour("quiet"), exponentformat: "power", automargin: true, ...more };
  }
  function layout(more) {
    return { paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", margin: { l: 56, r: 12, t: 22, b: 44 },
      font: { color: colour("ink"), size: 12, family: "system-ui, 'DejaVu Sans', sans-serif" }, showlegend: false,
      hovermode: false, dragmode: "zoom", ...more };
  }
  function draw(id, traces, more) {
    return Plotly.react($(id), traces, layout(more), CONFIG);
  }

  function forceTraces(run, friction) {
    const { slips } = run;
    const size = slips.count > 60 ? 3 : 6;
    const traces = before && run === shown.run ? [{ ...scaled(before, run), mode: "lines", line: { color: colour("quiet"), width: 1 }, opacity: 0.6, name: "before" }] : [];
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
  /* A kept trace in the units of the one that is shown; "time" and "force" may have another prefix. */
  function scaled(kept, run) {
    const turn = (packed, factor) => numbers(packed).map((value) => value * factor);
    if (kept.time.unit.slice(-1) !== run.time.unit.slice(-1)) return { x: [], y: [] };
    return { x: turn(kept.time.values, kept.time.factor / run.time.factor), y: turn(kept.force.values, kept.force.factor / run.force.factor) };
  }
  const numbers = ({ bdata }) => new Float32Array(Uint8Array.from(atob(bdata), (c) => c.charCodeAt(0)).buffer);
  /* One trace for all slips, on an axis of its own from 0 to 1: much quicker than a shape for each. */
  function shading({ slips: { start, end, count } }) {
    const x = [], y = [];
    if (count <= 200) start.forEach((begin, i) => { x.push(begin, begin, end[i], end[i], null); y.push(0, 1, 1, 0, null); });
    return { x, y, yaxis: "y2", mode: "lines", line: { width: 0 }, fill: "toself", fillcolor: `${colour("orange")}50`, name: "slip" };
  }
  function forceLayout(run, friction) {
    const count = run.slips.count, factor = run.force.factor, dots = count > 0 ? `${count === 1 ? "1 slip" : `${count} slips`}, marked` : "";
    const names = [[friction?.kinetic, "Fₖ"], [friction?.static, "Fₛ"]].filter(([value]) => value !== null && value !== undefined);
    const words = [dots, before && run === shown.run ? "grey: the trace kept" : ""].filter(Boolean).join("; ");
    return { shapes: [], yaxis2: { overlaying: "y", range: [0, 1], visible: false, fixedrange: true }, xaxis: axis(label(run.time), { range: run.span }), yaxis: axis(upright(run.force)),
      margin: { l: 56, r: 28, t: 22, b: 44 },
      annotations: [...names.map(([value, text]) => ({ xref: "paper", x: 1.004, xanchor: "left", y: value / factor, text,
        showarrow: false, font: { color: colour("green") } })), { xref: "paper", yref: "paper", x: 1, y: 1, xanchor: "right", yanchor: "bottom", showarrow: false,
        text: words, font: { color: colour(count > 0 ? "vermillion" : "quiet") } }] };
  }
  async function drawForce() {
    const run = shown.run, slips = run.slips.count;
    const replayed = frames && !frames.exact ? [{ x: frames.clock.map((t) => t / run.time.factor), y: frames.pull.map((f) => f / run.force.factor), mode: "lines",
      line: { color: colour("purple"), width: 1 }, name: "replayed" }] : [];
    await draw("plot-force", [...forceTraces(run, shown.friction), ...replayed], forceLayout(run, shown.friction));
    $("plot-force").setAttribute("aria-label", `Spring force against time: ${run.regime.kind}${slips ? `, ${slips} slips marked` : ""}`);
    point();
  }
  /* The cursor lies over the plot, which need not be drawn again as it moves. */
  function point(force) {
    const plot = $("plot-force"), frame = plot._fullLayout, run = shown.run, line = $("cursor"), dot = $("cursor-dot");
    if (!run || !frame?.xaxis || !frame.xaxis._length) return;
    const { xaxis, yaxis } = frame, time = run.span[0] + cursor * (run.span[1] - run.span[0]), x = xaxis.l2p(time);
    line.hidden = x < 0 || x > xaxis._length;
    line.style.transform = `translate(${xaxis._offset + x}px, ${yaxis._offset}px)`;
    line.style.height = `${yaxis._length}px`;
    const y = force === undefined ? -1 : yaxis.l2p(force / run.force.factor);
    dot.hidden = line.hidden || y < 0 || y > yaxis._length;
    dot.style.transform = `translate(${xaxis._offset + x}px, ${yaxis._offset + y}px)`;
  }
  function drawPhase() {
    const { velocity, force, drive } = shown.run.phase;
    return draw("plot-phase", [{ x: velocity.values, y: force.values, mode: "lines", line: { color: colour("blue"), width: 1.2 } }], {
      xaxis: axis(label(velocity), { range: velocity.range }), yaxis: axis(upright(force), { range: force.range }),
      shapes: [{ type: "line", x0: drive, x1: drive, yref: "paper", y0: 0, y1: 1, line: { color: colour("quiet"), dash: "dash", width: 1 } }],
      annotations: [{ x: drive, yref: "paper", y: 1, yanchor: "bottom", showarrow: false, text: "drive", font: { color: colour("quiet") } }] });
  }
  function drawStretchings() {
    const { x, stretching_density: Q, at: time } = shown.stretchings;
    const unit = shown.run.time.unit;
    $("at").textContent = `t = ${short(time)}${unit === "time" ? "" : ` ${unit}`}`;
    return draw("plot-stretchings", [{ x: x.values, y: Q.values, mode: "lines", line: { shape: "hvh", color: colour("purple"), width: 1.3 },
      fill: "tozeroy", fillcolor: `${colour("purple")}44` }], { xaxis: axis(label(x)), yaxis: axis(upright(Q), { rangemode: "tozero" }) });
  }

  function showRegime(prefix, regime, often = "") {
    $(prefix).textContent = regime.kind;
    const beside = $(`${prefix.replace(/regime$/, "")}often`);
    if (beside) beside.textContent = often;
    $(prefix).parentElement.className = `verdict ${regime.kind.replaceAll(" ", "-")}`;
  }
  function list(id, lines) {
    $(id).replaceChildren(...lines.map((textContent) => element("li", { textContent: word2(textContent) })));
  }
  const micro = (text) => text.replace(/\bu(m|s|N|g)\b/g, "µ$1");
  const word2 = (text) => micro(text).replace(/\b([xf])_s\b/g, "$1ₛ").replace(/\bF_s\b/g, "Fₛ").replace(/\bF_k\b/g, "Fₖ");
  function table(id, lines, head) {
    const cells = (tag, line) => element("tr", {}, ...line.map((textContent) => element(tag, { textContent: word2(textContent) })));
    const parts = [element("tbody", {}, ...lines.map((line) => cells("td", line)))];
    if (head) parts.unshift(element("thead", {}, cells("th", head)));
    $(id).replaceChildren(...parts);
  }
  function progress(where, share) {
    const bar = $(`${where}-progress`);
    bar.hidden = share === null;
    if (share !== null && share >= 0) bar.value = share;
    else bar.removeAttribute("value"); // not known: it moves to and fro
    if (where === "run") clearTimeout(patience);
  }

  const ANSWERS = {
    async run(reply) {
      if (reply.progress !== undefined) return progress("run", reply.progress);
      progress("run", null);
      if (reply.done) return;
      if (reply.friction) {
        shown.friction = reply.friction;
        $("friction").textContent = word2(reply.friction.words.join("; "));
        if (page === "simulate" && shown.run) drawForce();
        return;
      }
      const newest = reply.id === lanes.run.wanted;
      if (newest) {
        settle();
        if (reply.going_on) mark("run", "computing", "Undecided so far: the run goes on by itself …");
        else if (!rows.some((made) => made.typed)) mark("run", "");
      }
      reply.asked = structuredClone(newest ? doc : {});
      shown.run = reply;
      shown.stretchings = reply.stretchings;
      showRegime("regime", reply.regime, reply.period);
      showRegime("map-regime", reply.regime);
      $("reason").textContent = reply.regime.reason;
      list("notes", reply.notes);
      list("evidence", reply.regime.evidence);
      showPreset();
      offerParameters(Object.keys(reply.parameters));
      followDot(reply.parameters);
      if (newest && !reply.going_on) { judgeTour(); askFrames(); }
      if (page === "simulate") {
        await drawForce();
        later(drawRest); // the trace first
      }
      document.dispatchEvent(new CustomEvent("drawn", { detail: { id: reply.id, kind: reply.regime.kind, extended: reply.going_on } }));
    },
    contacts(reply) {
      if (!reply.frames) return;
      const time = timeNow(); // showing begins with the first frame
      frames = reply.frames;
      mark("drawing", "");
      stage.show(frames);
      frames.clock = Array.from(numbers(frames.times));
      frames.pull = Array.from(numbers(frames.force));
      const shownOf = frames.shown < frames.of ? `${frames.shown} of the ${frames.of} contacts` : `all ${frames.of} contacts`;
      $("stage-words").textContent = frames.exact ? shownOf : frames.own ? `${shownOf}, of another run of the same rig (purple line)`
        : `${shownOf}, of a run with contacts of the same rig (purple line)`;
      for (const id of ["play", "pace", "slow"]) $(id).disabled = false;
      if (!frames.exact && page === "simulate") drawForce();
      const [begin, end] = stage.span();
      stage.seek(time >= begin && time <= end ? time : begin);
      if (playing) stage.play();
    },
    stretchings(reply) {
      if (!reply.stretchings) return;
      shown.stretchings = reply.stretchings;
      if (page === "simulate") drawStretchings();
    },
    edit(reply) {
      if (reply.scales) scales = reply.scales; // for the way back
      if (reply.document) replace(reply.document);
    },
    chart(reply) {
      if (reply.progress !== undefined) return progress("map", reply.progress);
      if (reply.done) return progress("map", null);
      shown.chart = reply;
      shown.bands = [];
      asked.band = "";
      mark("map", "");
      $("map-state").textContent = "";
      reply.about = asked.about;
      summarise();
      drawMap();
      if ($("band").checked) askBand();
    },
    band(reply) {
      if (reply.progress !== undefined) return progress("map", reply.progress);
      if (reply.done) { $("map-state").textContent = shown.bands.some((b) => b.bands.length) ? "" : "no bistable band found"; return progress("map", null); }
      shown.bands.push(reply);
      $("map-state").textContent = `bistable band: ${reply.columns} of ${reply.of} columns`;
      drawMap();
    },
    advice(reply) {
      if (reply.progress !== undefined) return progress("stop", reply.progress);
      if (reply.done) return progress("stop", null);
      shown.advice = reply;
      mark("stop", "");
      showAdvice();
    },
  };
  const later = window.requestIdleCallback ? (work) => requestIdleCallback(work, { timeout: 120 }) : (work) => setTimeout(work, 40);
  async function drawRun() {
    if (!shown.run) return;
    await drawForce();
    drawRest();
  }
  function drawRest() {
    if (page !== "simulate") return;
    drawPhase();
    drawStretchings();
  }

  // The cursor: a look at another time of the same run.
  const timeAt = (event, id) => {
    const plot = $(id), frame = plot._fullLayout, box = plot.getBoundingClientRect();
    if (!frame?.xaxis) return null;
    const x = event.clientX - box.left - frame.xaxis._offset;
    return x < 0 || x > frame.xaxis._length ? null : frame.xaxis.p2l(x);
  };
  function look(event) {
    const time = shown.run && timeAt(event, "plot-force");
    if (time === null || time === undefined) return;
    const [begin, end] = shown.run.span;
    cursor = Math.min(Math.max((time - begin) / (end - begin), 0), 1);
    ask("stretchings", { cursor, duration: lasted() });
    const there = frames && stage.span(), now = timeNow();
    if (there && now >= there[0] && now <= there[1]) stage.seek(now);
    else { point(); askFrames(); }
  }
  $("plot-force").addEventListener("pointermove", (event) => { if (!held && !playing && event.pointerType === "mouse" && !event.buttons) look(event); });
  $("plot-force").addEventListener("click", (event) => { held = !held || playing; look(event); }, true);

  // ------------------------------------------------------------------------------------------------ the drawing

  let frames = null, playing = !matchMedia("(prefers-reduced-motion: reduce)").matches, framing = 0;
  const timeNow = () => (shown.run.span[0] + cursor * (shown.run.span[1] - shown.run.span[0])) * shown.run.time.factor;
  const lasted = () => shown.run.span[1] * shown.run.time.factor; // of the run on the page, which may be cut short
  const stage = Stage.make($("drawing"), colour, (time, force) => {
    if (!shown.run) return;
    cursor = (time / shown.run.time.factor - shown.run.span[0]) / (shown.run.span[1] - shown.run.span[0]);
    if (page === "simulate") point(force);
  });
  function askFrames() {
    clearTimeout(framing);
    framing = setTimeout(() => { if (page === "simulate" && shown.run && !waiting && document.body.dataset.runState === "") ask("contacts", { cursor, duration: lasted() }); }, 250);
  }
  function noDrawing(words) {
    clearTimeout(framing);
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
    else if (!playing) { stage.pause(); if (shown.run) ask("stretchings", { cursor, duration: lasted() }); }
  }
  $("play").onclick = () => setPlaying(!playing);
  $("pace").onchange = () => stage.pace(Number($("pace").value));
  $("slow").onchange = () => stage.slow($("slow").checked);
  $("sound").onchange = () => stage.sound($("sound").checked);
  window.addEventListener("resize", () => { if (page === "simulate") { stage.paint(); point(); } });

  // ------------------------------------------------------------------------------------------------ page 2

  /* The map stays as it is while only its own two parameters are varied. */
  function signature(over) {
    const keys = { stiffness: "slider.stiffness", velocity: "drive.velocity", mass: "slider.mass", damping: "slider.damping",
      delay: "interface.delay", std: "interface.thresholds.std",
      ageing: "interface.ageing.time" };
    const rest = structuredClone(doc);
    delete rest.simulation; delete rest.name; delete rest.assumed; delete rest.source;
    if (rest.drive) { delete rest.drive.distance; delete rest.drive.duration; }
    for (const parameter of over) Fields.put(rest, keys[parameter], undefined);
    if (over.includes("damping")) Fields.put(rest, "slider.damping_ratio", undefined);
    return JSON.stringify([over, rest]);
  }
  const over = () => [$("across").value, $("up").value];
  let resting = 0;
  function askMap() {
    if (dragging) return;
    clearTimeout(resting);
    if (waiting) return;
    if (shown.chart && asked.chart === signature(over())) return mark("map", "");
    resting = setTimeout(() => {
      asked.chart = signature(over());
      asked.about = JSON.stringify(doc);
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
    if (out(now[0], chart.x.ends) || out(now[1], chart.y.ends)) { asked.chart = ""; if (page === "map") askMap(); return; }
    chart.here = now;
    if (page === "map") Plotly.restyle($("plot-map"), { x: [[now[0]]], y: [[now[1]]] }, [$("plot-map").data.length - 1]);
  }
  function askBand() {
    const { chart } = shown;
    if (!chart || asked.band === asked.chart) return;
    asked.band = asked.chart;
    shown.bands = [];
    const ends = (id) => $("plot-map")._fullLayout[id].range.map((value) => Math.pow(10, value));
    progress("map", 0);
    $("map-state").textContent = "bistable band …";
    ask("band", { over: chart.over, x: ends("xaxis"), y: ends("yaxis") });
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
    if (!chart || page !== "map") return;
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
  /* An axis of the map: 1, 2, 5, 10 ... in the prefix that suits its middle. */
  function logarithmic({ title, unit, ends: [low, high] }) {
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
  let dragging = false;
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
    Plotly.restyle($("plot-map"), { x: [[x]], y: [[y]] }, [dot]);
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
      if (page === "map") askMap();
    }
  }
  for (const [id, chosen] of [["across", "stiffness"], ["up", "velocity"]]) {
    $(id).replaceChildren(...Object.entries(PARAMETERS).map(([value, text]) => new Option(text, value)));
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

  // ------------------------------------------------------------------------------------------------ page 3

  function askAdvice() {
    const text = JSON.stringify(doc);
    if (waiting || asked.advice === text) return;
    if (shown.advice) mark("stop", "computing", "Computing … this is about the rig before.");
    clearTimeout(resting);
    resting = setTimeout(() => {
      asked.advice = text;
      $("stop-state").textContent = "predicting …";
      progress("stop", 0);
      ask("advice");
    }, 200);
  }
  function showAdvice() {
    const found = shown.advice;
    $("stop-state").textContent = "";
    $("verdict").textContent = word2(`${found.name}: ${found.verdict}`);
    $("verdict").parentElement.className = `verdict ${found.ill ? "stick-slip" : "smooth-sliding"}`;
    list("stop-evidence", found.evidence);
    table("numbers", found.numbers);
    table("margins", found.margins, ["parameter", "now", "limit below", "limit above"]);
    const mitigations = found.mitigations.map(({ words, steps }) => element("li", {},
      ...steps.map(({ title, to, values }) => element("p", {}, element("strong", { textContent: title }), ` (${word2(to)}) `,
        element("button", { type: "button", textContent: "Apply", ariaLabel: `Apply: ${title}`, onclick: () => ask("edit", { turn: values }) }))),
      element("p", { className: "quiet", textContent: word2(words) })));
    const none = found.ill ? "No change within the ranges searched gives smooth sliding." : "None needed.";
    $("mitigations").replaceChildren(...(mitigations.length ? mitigations : [element("li", { textContent: none })]));
    list("attempts", [...found.attempts, found.not_searched].filter(Boolean));
    const assumed = Object.entries(found.assumed).map(([key, how]) => element("li", { textContent: `${key}: ${how}` }));
    $("assumed").replaceChildren(...(assumed.length ? [element("h2", { textContent: "Assumed, not measured" }), element("ul", {}, ...assumed)] : []));
  }

  // ------------------------------------------------------------------------------------------------ page 4

  const LARGEST = 50e6;
  async function analyse(file) {
    measured = file;
    $("again").hidden = false;
    if (file.size > LARGEST) {
      return traceComplaint(`${file.name} has ${Math.round(file.size / 1e6)} MB, more than ${LARGEST / 1e6}; keep every n-th row or a part of it, or use stickslip measure`);
    }
    $("trace-state").textContent = `reading ${file.name} …`;
    if (shown.trace) mark("trace", "computing", `Reading … this is ${shown.trace.name}.`);
    const query = new URLSearchParams({ name: file.name, width: Math.max(300, $("pages").clientWidth), force: $("column-force").value,
      time: $("column-time").value, step: $("step").value });
    try {
      const answer = await fetch(`trace?${query}`, { method: "POST", body: file });
      if (file !== measured) return;
      const found = await answer.json();
      if (found.errors) traceComplaint(found.errors.map((e) => e.message).join("; "));
      else showTrace(found);
    } catch {
      traceComplaint(`${file.name} could not be read, or the server is gone`);
    }
  }
  function traceComplaint(text) {
    $("trace-state").textContent = "";
    $("trace-complaint").textContent = text;
    $("trace-complaint").hidden = false;
    $("trace-found").hidden = true;
  }
  function showTrace(found) {
    shown.trace = found;
    mark("trace", "");
    $("trace-complaint").hidden = true;
    $("trace-found").hidden = false;
    $("trace-state").textContent = `${found.name}: ${found.rows} rows${found.note ? `; ${found.note}` : ""}`;
    const per = found.regime.period;
    showRegime("trace-regime", found.regime, per && found.regime.kind !== "smooth sliding" && found.time.unit.endsWith("s") ? `${short(1 / per, 3)} Hz` : "");
    $("trace-reason").textContent = found.regime.reason;
    list("trace-evidence", found.regime.evidence);
    table("statistics", [["slips", String(found.slips.count)], ...found.statistics]);
    draw("plot-trace", forceTraces(found), forceLayout(found));
  }
  $("file").onchange = () => { if ($("file").files[0]) analyse($("file").files[0]); $("file").value = ""; };
  $("sample").onclick = async () => {
    const answer = await fetch("sample.csv").catch(() => null);
    if (answer?.ok) analyse(new File([await answer.blob()], "sample.csv"));
  };
  $("again").onclick = () => analyse(measured);
  for (const kind of ["dragover", "drop"]) {
    window.addEventListener(kind, (event) => { // anywhere on the page, so that a miss does not leave it
      event.preventDefault();
      $("drop").classList.toggle("over", kind === "dragover");
      if (kind === "drop" && event.dataTransfer.files[0]) { open("trace"); analyse(event.dataTransfer.files[0]); }
    });
  }
  window.addEventListener("dragleave", () => $("drop").classList.remove("over"));

  // ------------------------------------------------------------------------------------------------ around it

  function open(next) {
    page = next;
    document.body.dataset.page = page;
    for (const name of PAGES) {
      $(`page-${name}`).hidden = name !== page;
      $(`tab-${name}`).setAttribute("aria-selected", String(name === page));
      $(`tab-${name}`).tabIndex = name === page ? 0 : -1;
    }
    if (!doc) return;
    remember();
    if (page === "simulate") { drawRun(); if (shown.run && !frames) askFrames(); if (playing && frames) stage.play(); }
    else stage.pause();
    if (waiting) return;
    if (page === "map") { drawMap(); askMap(); }
    if (page === "stop") askAdvice();
    if (page === "trace" && shown.trace) showTrace(shown.trace);
  }
  for (const name of PAGES) $(`tab-${name}`).onclick = () => open(name);
  document.querySelector("nav").addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!step) return;
    open(PAGES[(PAGES.indexOf(page) + step + PAGES.length) % PAGES.length]);
    $(`tab-${page}`).focus();
  });
  $("units").onchange = () => ask("edit", { units: $("units").value, ...($("units").value === "SI" && scales ? { scales } : {}) });

  // ------------------------------------------------------------------------------------------------ the tour and the glossary

  function judgeTour() {
    if (question < 0) return;
    if (before === null) { before = shown.run; drawForce(); } // of the beginning, to compare with
    if (!Tour.QUESTIONS[question].solved(shown.run, began)) return;
    $("tour-answer").textContent = `Yes. ${Tour.QUESTIONS[question].answer}`;
    $("tour-answer").className = "solved";
  }
  function tour(index) {
    question = index >= Tour.QUESTIONS.length ? -1 : index;
    $("tour").hidden = question < 0;
    before = null;
    $("keep").textContent = "Keep trace to compare";
    if (question < 0) { if (shown.run && page === "simulate") drawForce(); return; }
    const { title, question: words } = Tour.QUESTIONS[question];
    $("tour-title").textContent = title;
    $("tour-question").textContent = words;
    $("tour-answer").textContent = "";
    $("tour-answer").className = "";
    $("tour-next").textContent = question + 1 < Tour.QUESTIONS.length ? "Next question" : "Done";
    wait(false);
    if (page !== "simulate") open("simulate");
    begin(Tour.begin(presets[0].document, question));
  }
  $("tour-begin").onclick = () => { if (presets.length) tour(0); };
  $("tour-reset").onclick = () => tour(question);
  $("tour-next").onclick = () => tour(question + 1);
  $("tour-end").onclick = () => tour(-1);
  $("glossary-list").replaceChildren(...Glossary.flatMap(({ term, unit, text }) => [element("dt", {}, term, unit ? element("span", { className: "quiet", textContent: ` ${unit}` }) : ""),
    element("dd", { textContent: text })]));
  $("glossary-open").onclick = () => $("glossary").showModal();
  $("glossary-close").onclick = () => $("glossary").close();

  for (const button of document.querySelectorAll("[data-download]")) {
    button.onclick = async () => {
      const form = button.dataset.download;
      const answer = await fetch(`download/${form}`, { method: "POST", body: JSON.stringify({ document: doc, duration: form !== "toml" && shown.run ? lasted() : null }) }).catch(() => null);
      if (!answer) return notice("The server is gone. Start `stickslip explore` again; this page will find it.");
      if (!answer.ok) return complain("run", (await answer.json()).errors);
      const url = URL.createObjectURL(await answer.blob());
      const name = (String(doc.name ?? "rig").toLowerCase().replace(/[^a-z0-9]+/g, "-").replace(/^-|-$/g, "") || "rig");
      element("a", { href: url, download: `${name}.${form}` }).click();
      setTimeout(() => URL.revokeObjectURL(url), 10_000);
    };
  }
  $("link").onclick = async () => {
    const link = location.origin + location.pathname + address();
    history.replaceState(null, "", link);
    keepHere();
    let done = "Copied";
    try { await navigator.clipboard.writeText(link); } catch { done = "It is in the address bar"; }
    $("link").textContent = done;
    setTimeout(() => { $("link").textContent = "Copy link"; }, 2000);
  };
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { stage.recolour(); open(page); });

  setPlaying(playing);
  open(page);
  connect();
})();

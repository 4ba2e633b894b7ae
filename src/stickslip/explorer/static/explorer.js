"use strict";
/* The page. Its whole state is one document, the content of a rig file: shown in the fields, sent whole with every
   question, kept in the address. Answers carry the number of their question; only the newest counts. */

(() => {
  const { ALL, split, numeric, short, at } = Fields;
  const $ = (id) => document.getElementById(id);
  const PAGES = ["interface", "map", "advice", "trace"];
  const KNOBS = { stiffness: "K, driving spring", velocity: "v, speed", mass: "M, mass", damping: "η, damping",
    delay: "τ, delay", std: "Δf, threshold std. dev.", ageing: "time of ageing" };
  const FRAME = 400; // ms after which a question is asked anew although the last is not answered

  let doc = null, presets = [], page = "interface", cursor = 0.75, held = false, measured = null;
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
    socket = new WebSocket(`ws://${location.host}/session`);
    socket.onopen = () => {
      notice("");
      for (const lane of Object.values(lanes)) { lane.answered = lane.id; pump(lane); }
    };
    socket.onclose = () => {
      notice("The server is gone. Start `stickslip explore` again; this page will find it.");
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
    doc = fromAddress() ?? reply.document;
    rebuild();
    open(page);
    changed();
  }
  function changed() {
    remember();
    document.body.dataset.asked = ask("run", { cursor });
    clearTimeout(patience);
    patience = setTimeout(() => progress("run", NaN), 600); // a long run, or kernels that are being compiled
    if (page === "map") askMap();
    if (page === "advice") askAdvice();
  }
  function replace(next) {
    doc = next;
    rebuild();
    changed();
  }

  let remembering = 0, patience = 0;
  function remember() {
    clearTimeout(remembering);
    remembering = setTimeout(() => history.replaceState(null, "", address()), 250);
  }
  function address() {
    const bytes = new TextEncoder().encode(JSON.stringify(doc));
    const text = btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join(""));
    return `#${page}/${text.replaceAll("+", "-").replaceAll("/", "_").replace(/=+$/, "")}`;
  }
  function fromAddress() {
    const [where, text] = location.hash.slice(1).split("/");
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
    if (found) { replace(found); open(page); }
  });

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
  function row(field) {
    const id = `field-${field.key.replaceAll(".", "-")}`, box = element("div", { className: "field" });
    const label = element("label", { htmlFor: id, title: field.title });
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
    made.input.setAttribute("aria-describedby", complaint.id);
    const shownUnit = element("span", { className: "unit", textContent: field.plain && !natural ? relative(field) :
      made.unit || field.unit || "" });
    made.shownUnit = shownUnit;
    if (field.swap) {
      const menu = element("button", { type: "button", textContent: `${shownUnit.textContent} ⇄`, title: `Give ${field.swap} instead` });
      menu.onclick = () => ask("edit", { damping_ratio: field.swap === "ζ" });
      shownUnit.replaceChildren(menu);
      menu.style.padding = "0 .3rem";
    }
    made.input.oninput = () => enter(made, made.input.value);
    made.input.onchange = () => tidy(made);
    box.append(label, made.input, shownUnit);
    if (field.range) {
      made.slider = element("input", { type: "range", min: 0, max: 1000, step: 1, id: `${id}-slider` });
      made.slider.setAttribute("aria-label", field.title);
      made.range = rangeOf(made, parseFloat(number));
      place(made);
      made.slider.oninput = () => {
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
  /* What stands in a field goes into the document as it is; the server says what is wrong with it. */
  function enter(made, text) {
    const pointed = text.replace(/^(\s*[-+]?\d+),(\d+)(?![\d.,])/, "$1.$2"); // a decimal comma, before one's eyes
    if (pointed !== text) made.input.value = pointed;
    const { field } = made, trimmed = pointed.trim(), number = numeric(trimmed), good = !isNaN(number);
    const [, unit] = split(trimmed);
    let value = trimmed;
    if (field.plain || doc.units === "natural") value = good ? number : trimmed;
    else if (trimmed !== "" && trimmed !== "never" && !unit) value = `${trimmed} ${made.unit}`;
    field.write(doc, value);
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
    if (!made.field.swap) made.shownUnit.textContent = unit;
  }
  function complain(kind, errors) {
    if (["chart", "band", "advice"].includes(kind)) {
      const where = kind === "advice" ? "advice" : "map";
      $(`${where}-state`).textContent = word2(errors.map((e) => e.message).join("; "));
      progress(where, null);
      if (kind === "chart") { shown.chart = null; $("summary").textContent = ""; Plotly.purge($("plot-map")); }
      return;
    }
    settle();
    progress("run", null);
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
      if (chosen) { cursor = 0.75; held = false; replace(structuredClone(chosen.document)); }
    };
  }
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
    const traces = [
      { x: run.time.values, y: run.force.values, mode: "lines", line: { color: colour("blue"), width: 1.3 }, name: "force" },
      { x: slips.start, y: slips.before, mode: "markers", marker: { color: colour("vermillion"), size }, name: "slips" },
    ];
    const ends = run.span, factor = run.force.factor;
    for (const [value, name, dash] of [[friction?.kinetic, "Fₖ", "dash"], [friction?.static, "Fₛ", "dot"]]) {
      if (value === null || value === undefined) continue;
      traces.push({ x: ends, y: [value / factor, value / factor], mode: "lines", line: { color: colour("green"), dash, width: 1.3 }, name });
    }
    return [...traces, shading(run)];
  }
  /* One trace for all slips, on an axis of its own from 0 to 1: much quicker than a shape for each. */
  function shading({ slips: { start, end, count } }) {
    const x = [], y = [];
    if (count <= 200) start.forEach((begin, i) => { x.push(begin, begin, end[i], end[i], null); y.push(0, 1, 1, 0, null); });
    return { x, y, yaxis: "y2", mode: "lines", line: { width: 0 }, fill: "toself", fillcolor: `${colour("orange")}50`, name: "sliding" };
  }
  function forceLayout(run, friction) {
    const count = run.slips.count, factor = run.force.factor;
    const names = [[friction?.kinetic, "Fₖ"], [friction?.static, "Fₛ"]].filter(([value]) => value !== null && value !== undefined);
    return { shapes: [], yaxis2: { overlaying: "y", range: [0, 1], visible: false, fixedrange: true }, xaxis: axis(label(run.time), { range: run.span }), yaxis: axis(upright(run.force)),
      margin: { l: 56, r: 28, t: 22, b: 44 },
      annotations: [...names.map(([value, text]) => ({ xref: "paper", x: 1.004, xanchor: "left", y: value / factor, text,
        showarrow: false, font: { color: colour("green") } })), { xref: "paper", yref: "paper", x: 1, y: 1, xanchor: "right", yanchor: "bottom", showarrow: false,
        text: count === 1 ? "1 slip marked" : `${count} slips marked`, font: { color: colour("vermillion") } }] };
  }
  function drawForce() {
    const run = shown.run;
    const now = run.span[0] + cursor * (run.span[1] - run.span[0]);
    const plan = forceLayout(run, shown.friction);
    plan.shapes.push({ type: "line", xref: "x", yref: "paper", x0: now, x1: now, y0: 0, y1: 1,
      line: { color: colour("purple"), width: 1.5 } });
    return draw("plot-force", forceTraces(run, shown.friction), plan);
  }
  function drawPhase() {
    const { velocity, force, drive } = shown.run.phase;
    return draw("plot-phase", [{ x: velocity.values, y: force.values, mode: "lines", line: { color: colour("blue"), width: 1.2 } }], {
      xaxis: axis(label(velocity)), yaxis: axis(upright(force)),
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

  function showRegime(prefix, regime) {
    $(prefix).textContent = regime.kind;
    $(prefix).parentElement.className = `verdict ${regime.kind.replaceAll(" ", "-")}`;
  }
  function list(id, lines) {
    $(id).replaceChildren(...lines.map((textContent) => element("li", { textContent: word2(textContent) })));
  }
  const word2 = (text) => text.replace(/\b([xf])_s\b/g, "$1ₛ").replace(/\bF_s\b/g, "Fₛ").replace(/\bF_k\b/g, "Fₖ");
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
        if (page === "interface" && shown.run) drawForce();
        return;
      }
      if (reply.id === lanes.run.wanted) settle();
      shown.run = reply;
      shown.stretchings = reply.stretchings;
      showRegime("regime", reply.regime);
      showRegime("map-regime", reply.regime);
      $("reason").textContent = reply.regime.reason;
      list("evidence", reply.regime.evidence);
      showPreset();
      followDot(reply.parameters);
      if (page === "interface") {
        await drawForce();
        later(drawRest); // the trace first
      }
      document.dispatchEvent(new CustomEvent("drawn", { detail: { id: reply.id, kind: reply.regime.kind } }));
    },
    stretchings(reply) {
      if (!reply.stretchings) return;
      shown.stretchings = reply.stretchings;
      if (page === "interface") drawStretchings();
    },
    edit(reply) {
      if (reply.document) replace(reply.document);
    },
    chart(reply) {
      if (reply.progress !== undefined) return progress("map", reply.progress);
      if (reply.done) return progress("map", null);
      shown.chart = reply;
      shown.bands = [];
      asked.band = "";
      $("map-state").textContent = "";
      $("summary").textContent = reply.summary.replace(/^.*?: smooth/, "Smooth");
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
      if (reply.progress !== undefined) return progress("advice", reply.progress);
      if (reply.done) return progress("advice", null);
      shown.advice = reply;
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
    if (page !== "interface") return;
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
    ask("stretchings", { cursor });
    const lines = $("plot-force").layout.shapes.length - 1, now = begin + cursor * (end - begin);
    Plotly.relayout($("plot-force"), { [`shapes[${lines}].x0`]: now, [`shapes[${lines}].x1`]: now });
  }
  $("plot-force").addEventListener("pointermove", (event) => { if (!held && event.pointerType === "mouse" && !event.buttons) look(event); });
  $("plot-force").addEventListener("click", (event) => { held = !held; look(event); }, true);

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
    return JSON.stringify([over, rest]);
  }
  const over = () => [$("across").value, $("up").value];
  let resting = 0;
  function askMap() {
    if (dragging) return;
    clearTimeout(resting);
    if (shown.chart && asked.chart === signature(over())) return;
    resting = setTimeout(() => {
      asked.chart = signature(over());
      drop("band");
      shown.bands = [];
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
    const dark = matchMedia("(prefers-color-scheme: dark)").matches;
    const middle = dark ? "#2b3138" : "#f7f7f7";
    const traces = [
      { type: "heatmap", x: chart.x.values, y: chart.y.values, z: chart.shade, customdata: chart.rate, zmin: -1, zmax: 1,
        colorscale: [[0, dark ? "#56b4e9" : "#0072b2"], [0.5, middle], [1, dark ? "#e69f00" : "#e66f00"]], opacity: 0.85,
        hovertemplate: `growth rate %{customdata} ${word(chart.rate_unit)}<extra></extra>`,
        colorbar: { title: { text: `growth rate (${word(chart.rate_unit)})`, side: "right" }, tickvals: chart.levels.at,
          ticktext: chart.levels.text, thickness: 12, outlinewidth: 0 } },
      { ...bands, mode: "lines", fill: "toself", fillpattern: { shape: "/", size: 7, fgcolor: colour("edge"), bgcolor: "rgba(0,0,0,0)" },
        line: { width: 0 }, hoverinfo: "skip", name: "bistable" },
      ...chart.curves.map(({ x, y }) => ({ x, y, mode: "lines", line: { color: colour("edge"), width: 2.2 }, hoverinfo: "skip", name: "boundary" })),
      { x: [chart.here[0]], y: [chart.here[1]], mode: "markers", hoverinfo: "skip", name: "this rig",
        marker: { size: 15, color: colour("paper"), line: { color: colour("vermillion"), width: 4 } } },
    ];
    const range = (values) => { const e = chart[values].ends; return [Math.log10(e[0]), Math.log10(e[1])]; };
    const tick = { exponentformat: doc.units === "natural" ? "power" : "SI", minexponent: 0, dtick: "D2" };
    return draw("plot-map", traces, { hovermode: "closest", dragmode: false, margin: { l: 62, r: 8, t: 10, b: 48 },
      xaxis: axis(label(chart.x), { type: "log", range: range("x"), ...tick }),
      yaxis: axis(label(chart.y), { type: "log", range: range("y"), ...tick }) });
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
  for (const [id, chosen] of [["across", "stiffness"], ["up", "velocity"]]) {
    $(id).replaceChildren(...Object.entries(KNOBS).map(([value, text]) => new Option(text, value)));
    $(id).value = chosen;
    $(id).onchange = () => {
      const other = $(id === "across" ? "up" : "across");
      if (other.value === $(id).value) other.value = Object.keys(KNOBS).find((parameter) => parameter !== $(id).value);
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
    if (asked.advice === text) return;
    clearTimeout(resting);
    resting = setTimeout(() => {
      asked.advice = text;
      $("advice-state").textContent = "predicting …";
      progress("advice", 0);
      ask("advice");
    }, 200);
  }
  function showAdvice() {
    const found = shown.advice;
    $("advice-state").textContent = "";
    $("verdict").textContent = word2(`${found.name}: ${found.verdict}`);
    $("verdict").parentElement.className = `verdict ${found.ill ? "stick-slip" : "smooth-sliding"}`;
    list("advice-evidence", found.evidence);
    table("numbers", found.numbers);
    table("margins", found.margins, ["parameter", "now", "limit below", "limit above"]);
    const mitigations = found.mitigations.map(({ parameter, words, steps }) => element("li", {}, word2(words), element("br"),
      ...steps.map(({ title, value }) => element("button", { type: "button", textContent: `Apply ${word2(title)}`,
        onclick: () => ask("edit", { turn: { [parameter]: value } }) }))));
    const none = found.ill ? "No change within the ranges searched gives smooth sliding." : "None needed.";
    $("mitigations").replaceChildren(...(mitigations.length ? mitigations : [element("li", { textContent: none })]));
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
    $("trace-complaint").hidden = true;
    $("trace-found").hidden = false;
    $("trace-state").textContent = `${found.name}: ${found.rows} rows${found.note ? `; ${found.note}` : ""}`;
    showRegime("trace-regime", found.regime);
    $("trace-reason").textContent = found.regime.reason;
    list("trace-evidence", found.regime.evidence);
    table("statistics", [["slips", String(found.slips.count)], ...found.statistics]);
    draw("plot-trace", forceTraces(found), forceLayout(found));
  }
  $("file").onchange = () => { if ($("file").files[0]) analyse($("file").files[0]); $("file").value = ""; };
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
    if (page === "interface") drawRun();
    if (page === "map") { drawMap(); askMap(); }
    if (page === "advice") askAdvice();
    if (page === "trace" && shown.trace) showTrace(shown.trace);
  }
  for (const name of PAGES) $(`tab-${name}`).onclick = () => open(name);
  document.querySelector("nav").addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!step) return;
    open(PAGES[(PAGES.indexOf(page) + step + PAGES.length) % PAGES.length]);
    $(`tab-${page}`).focus();
  });
  $("units").onchange = () => ask("edit", { units: $("units").value });

  for (const button of document.querySelectorAll("[data-download]")) {
    button.onclick = async () => {
      const form = button.dataset.download;
      const answer = await fetch(`download/${form}`, { method: "POST", body: JSON.stringify(doc) }).catch(() => null);
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
    let done = "Copied";
    try { await navigator.clipboard.writeText(link); } catch { done = "It is in the address bar"; }
    $("link").textContent = done;
    setTimeout(() => { $("link").textContent = "Copy link"; }, 2000);
  };
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => open(page));

  open(page);
  connect();
})();

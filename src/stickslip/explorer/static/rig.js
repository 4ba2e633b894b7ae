/* The rig: its fields, its presets, and its place in the address. */

import { fieldsOf, joined, numeric, pointed, short, split, unfinished } from "./fields.js";
import { $, complainAt, element, field, labelled, mark, micro, notice, state, tellParts } from "./page.js";
import { ask, on, saying } from "./talk.js";

const PAUSE = 1000; // ms without a key after which a number that was typed counts

let all = [], rows = [], scales = null, remembering = 0;

on("hello", (reply) => {
  if (state.doc) return changed(); // connected again
  state.presets = reply.presets;
  all = fieldsOf(reply.glossary);
  fillPresets();
  tellParts("greeted", reply);
  const linked = fromAddress();
  state.doc = linked ?? reply.document;
  if (reply.chain && !linked) state.page = "fronts";
  state.began = structuredClone(state.doc);
  // What a link holds was written by somebody else: it is shown, and computed on a click. A reload goes on.
  wait(linked !== null && sessionStorage.getItem("here") !== location.hash);
  rebuild();
  $(`tab-${state.page}`).click();
  changed();
});
on("edit", (reply) => {
  if (reply.scales) scales = reply.scales; // for the way back
  replace(reply.document);
}, { refused: (errors) => complain(errors) });

export function wait(now) {
  state.waiting = now;
  $("waiting").hidden = !now;
  if (now) for (const about of ["run", "drawing", "map", "stop", "fronts"]) mark(about, "waiting");
}
/* The rig is another: what is on the screen is about the one before. */
export function changed() {
  remember();
  if (state.waiting) return;
  document.body.dataset.asked = ask("run", { cursor: state.cursor });
  mark("run", "computing");
  tellParts("changed");
}
export function replace(next) {
  state.doc = next;
  rebuild();
  changed();
}
export function begin(next) {
  state.began = structuredClone(next);
  state.shown.friction = null;
  replace(next);
}
export const anyTyped = () => rows.some((made) => made.typed);

// -------------------------------------------------------------------------------------------------------- address

export function remember() {
  clearTimeout(remembering);
  remembering = setTimeout(() => { history.replaceState(null, "", address()); keepHere(); }, 250);
}
export const keepHere = () => { if (!state.waiting) sessionStorage.setItem("here", location.hash); };
export function address() {
  const bytes = new TextEncoder().encode(JSON.stringify(state.doc));
  const text = btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join(""));
  return `#${state.page}/${text.replaceAll("+", "-").replaceAll("/", "_").replace(/=+$/, "")}`;
}
function fromAddress() {
  const [name, text] = location.hash.slice(1).split("/");
  if ($(`page-${name}`)) state.page = name;
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
  if (found) { wait(true); replace(found); $(`tab-${state.page}`).click(); }
});
$("go").onclick = () => { wait(false); rebuild(); $(`tab-${state.page}`).click(); changed(); };

// --------------------------------------------------------------------------------------------------------- fields

function rebuild() {
  $("units").value = state.doc.units === "natural" ? "natural" : "SI";
  rows = [];
  const host = document.createDocumentFragment();
  let group = null;
  for (const field of all) {
    if (field.group) host.append((group = element("fieldset", {}, element("legend", { textContent: field.group }))));
    if (!field.when || field.when(state.doc)) group.append(row(field));
  }
  $("fields").replaceChildren(host);
  showPreset();
}
/* What stands in a field is what stands in the document, unit and all. */
const written = ({ read, missing, zero }) => micro(String(read(state.doc) ?? missing ?? (zero ? 0 : "")));
const bare = ({ plain }) => plain || state.doc.units === "natural";

function row(field) {
  const id = `field-${field.key.replaceAll(".", "-")}`;
  const complaint = element("p", { className: "complaint", id: `${id}-complaint`, role: "alert", hidden: true });
  const made = { field, complaint };
  rows.push(made);
  const box = field.choices ? choice(id, made) : number(id, made);
  for (const event of ["pointerenter", "focusin"]) box.addEventListener(event, () => { $("help").textContent = field.help; });
  box.append(complaint);
  return box;
}
function choice(id, made) {
  const { choices, read, write, missing } = made.field;
  made.input = element("select", { id }, ...Object.entries(choices).map(([value, text]) => new Option(text, value)));
  made.input.value = read(state.doc) ?? missing ?? Object.keys(choices)[0];
  made.input.onchange = () => { write(state.doc, made.input.value); rebuild(); changed(); };
  return labelled(id, made.field, made.input);
}
function number(id, made) {
  const { field: told } = made, value = written(told);
  made.unit = bare(told) ? "" : split(value)[1] || told.si; // of a number that is typed without one
  const box = field(id, { ...told, unit: bare(told) ? told.unit ?? "" : "" }, () => {
    settleTyping(made);
    made.input.value = written(told);
  }, { value, oninput: () => typing(made) });
  made.input = box.children[1];
  made.input.setAttribute("aria-describedby", `${made.complaint.id} help`);
  if (told.swap) {
    const menu = element("button", { type: "button", textContent: `⇄ ${told.swap}`, title: `Give ${told.swap} instead` });
    menu.onclick = () => ask("edit", { damping_ratio: told.swap === "ζ" });
    box.lastChild.replaceChildren(menu);
  }
  if (told.range) {
    made.slider = element("input", { type: "range", min: 0, max: 1000, step: 1, id: `${id}-slider` });
    made.slider.setAttribute("aria-label", told.title);
    made.range = rangeOf(made, parseFloat(value));
    place(made);
    made.slider.oninput = () => {
      clearTimeout(made.pause);
      made.typed = false;
      made.input.value = `${valueAt(made, Number(made.slider.value))} ${made.unit}`.trim();
      enter(made, made.input.value);
    };
    box.append(made.slider);
  }
  return box;
}
/* The slider spans its natural range, or in SI as many decades about the value; always the value itself. */
function rangeOf({ field }, value) {
  let [low, high] = field.range;
  if (!bare(field)) {
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
  if (made.field.zero && !(value > 0)) made.slider.value = 0;
  else if (value > 0) made.slider.value = Math.round((1000 * Math.log(value / low)) / Math.log(high / low));
  made.slider.setAttribute("aria-valuetext", made.input.value);
}
/* While a number is typed nothing is computed: it counts after Enter, on leaving the field, or after a pause. */
function typing(made) {
  const text = pointed(made.input.value); // a decimal comma becomes a point, before one's eyes
  if (text !== made.input.value) made.input.value = text;
  clearTimeout(made.pause);
  made.typed = true;
  if (state.waiting) return;
  mark("run", "computing", "Waiting for the number: press Enter.");
  if (!unfinished(text)) made.pause = setTimeout(settleTyping, PAUSE, made);
}
function settleTyping(made) {
  clearTimeout(made.pause);
  if (!made.typed) return;
  made.typed = false;
  if (made.input.value.trim() === "") return changed(); // emptied and left: what it was before
  if (made.field.whole) made.input.value = joined(made.input.value);
  enter(made, made.input.value);
}
/* What stands in a field goes into the document as it is; the server says what is wrong with it. */
function enter(made, text) {
  const { field } = made, trimmed = text.trim().replace(/^([-+]?\d+)[.](?!\d)/, "$1"), number = numeric(trimmed);
  if (!isNaN(number)) field.write(state.doc, bare(field) ? number : `${trimmed} ${made.unit}`);
  else field.write(state.doc, trimmed);
  if (field.replaces) return rebuild(), changed(); // other keys: their fields come and go
  if (document.activeElement !== made.slider) place(made);
  changed();
}
/* Complaints about the rig: each beside its field, the rest above them. */
export function complain(errors) {
  settle();
  tellParts("refused");
  mark("run", "refused");
  const rest = [];
  for (const { key: place, message } of errors) {
    const key = place && place.split("[")[0]; // of a list, the whole is in one field
    const made = key && rows.find((r) => key === r.field.key) || key && rows.find((r) => r.field.key.startsWith(`${key}.`) ||
      key.startsWith(`${r.field.key}.`));
    if (!made) { rest.push({ message }); continue; }
    made.input.setAttribute("aria-invalid", "true");
    made.complaint.textContent = message;
    made.complaint.hidden = false;
  }
  complainAt("complaint", saying(rest));
  document.dispatchEvent(new CustomEvent("complained"));
}
function settle() {
  for (const made of rows) {
    made.input.removeAttribute("aria-invalid");
    made.complaint.hidden = true;
  }
  $("complaint").hidden = true;
}
/* The server has taken what stands in the fields: a unit that was typed is that of the field from now on. */
export function accept() {
  settle();
  for (const made of rows.filter(({ field, typed }) => !field.choices && !typed && !bare(field))) {
    const [value, unit] = split(made.input.value);
    if (!unit || unit === made.unit) continue;
    made.unit = unit;
    if (made.slider) made.range = rangeOf(made, parseFloat(value));
    place(made);
  }
}

// -------------------------------------------------------------------------------------------------------- presets

function fillPresets() {
  const groups = {};
  state.presets.forEach(({ group, title }, i) => {
    groups[group] ??= element("optgroup", { label: group });
    groups[group].append(new Option(title, i));
  });
  $("preset").replaceChildren(new Option("(your own)", ""), ...Object.values(groups));
  $("preset").onchange = () => {
    const chosen = state.presets[$("preset").value];
    if (!chosen) return;
    state.cursor = 0.75;
    tellParts("chosen");
    wait(false);
    begin(structuredClone(chosen.document));
  };
}
export function showPreset() {
  const text = JSON.stringify(state.doc);
  const index = state.presets.findIndex((preset) => JSON.stringify(preset.document) === text);
  $("preset").value = index < 0 ? "" : String(index);
}
$("reset").onclick = () => replace(structuredClone(state.began));
$("units").onchange = () => ask("edit", { units: $("units").value, ...($("units").value === "SI" && scales ? { scales } : {}) });

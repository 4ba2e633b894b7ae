/* The fields of the rig: where each stands in the document (the content of a rig file), its units and its slider. */

export const at = (tree, path) => path.split(".").reduce((node, key) => (node == null ? undefined : node[key]), tree);
export const put = (tree, path, value) => {
  const keys = path.split("."), last = keys.pop();
  let node = tree;
  for (const key of keys) node = node[key] !== null && typeof node[key] === "object" ? node[key] : (node[key] = {});
  if (value === undefined) delete node[last];
  else node[last] = value;
};
const simple = (path) => ({ read: (doc) => at(doc, path), write: (doc, value) => put(doc, path, value) });

// A delay is a number, "never", or a table with mean, standard deviation and the fate of negative draws.
const random = (doc) => (at(doc, "interface.delay") !== null && typeof at(doc, "interface.delay") === "object");
const delay = {
  read: (doc) => (random(doc) ? at(doc, "interface.delay.mean") : at(doc, "interface.delay")),
  write: (doc, value) => put(doc, random(doc) ? "interface.delay.mean" : "interface.delay", value),
};
const delayStd = {
  read: (doc) => (random(doc) ? at(doc, "interface.delay.std") : undefined),
  write: (doc, value) => {
    const mean = delay.read(doc), [number, unit] = split(value), none = numeric(number) === 0 && !/\d/.test(unit);
    if (none) put(doc, "interface.delay", mean);
    else put(doc, "interface.delay", { negative: at(doc, "interface.delay.negative") ?? "clip",
      mean: mean ?? (doc.units === "natural" ? 0 : "0 ms"), std: value });
  },
};

// A file gives the time 1/beta^2 in which thresholds age; the page shows the rate beta.
const seconds = { s: 1, ms: 1e-3, us: 1e-6, "µs": 1e-6, ns: 1e-9, min: 60, h: 3600 };
const ageing = {
  read: (doc) => {
    const time = at(doc, "interface.ageing.time");
    if (time === undefined) return undefined;
    const [number, unit] = split(time);
    const rate = Math.pow(numeric(number) * (unit ? seconds[unit] ?? NaN : 1), -0.5);
    if (!isFinite(rate)) return time;
    return doc.units === "natural" ? short(rate) : `${short(rate)} 1/√s`;
  },
  write: (doc, value) => {
    const [number, unit] = split(value), rate = unit === "" || unit === "1/√s" ? numeric(number) : NaN;
    if (rate === 0) return put(doc, "interface.ageing", undefined);
    const time = rate > 0 ? short(Math.pow(rate, -2)) : value; // a time, or what the server will refuse
    put(doc, "interface.ageing", { model: "langevin", ...at(doc, "interface.ageing"),
      time: doc.units === "natural" || typeof time === "string" ? time : `${time} s` });
  },
};

const byRatio = (doc) => at(doc, "slider.damping_ratio") !== undefined;
const damping = {
  read: (doc) => at(doc, byRatio(doc) ? "slider.damping_ratio" : "slider.damping"),
  write: (doc, value) => put(doc, byRatio(doc) ? "slider.damping_ratio" : "slider.damping", value),
};
const contacts = (doc) => at(doc, "simulation.method") !== "master equation";
const SI = (doc) => doc.units !== "natural";
const heated = (key) => (doc) => at(doc, `interface.temperature.${key}`) !== undefined;
const held = (doc) => at(doc, "drive.pieces") === undefined;

/* key: as the server's messages name it; unit: natural; si: SI; range: of the slider, natural; zero: may be 0;
   plain: a number without a unit in either system; when: shown only then; choices: a menu. */
export const ALL = [
  { group: "Slider and drive" },
  { key: "slider.stiffness", symbol: "K", title: "driving spring", unit: "k", si: "N/m", range: [0.05, 50] },
  { key: "drive.velocity", symbol: "v", title: "speed", unit: "xₛ/time", si: "m/s", range: [0.01, 100], when: held },
  { key: "slider.mass", symbol: "M", title: "mass", unit: "fₛ time²/xₛ", si: "kg", range: [1e-6, 1] },
  { key: "slider.damping", symbol: "η", title: "damping", unit: "1/time", si: "1/s", range: [1, 3000], ...damping,
    when: (doc) => !byRatio(doc), swap: "ζ" },
  { key: "slider.damping_ratio", symbol: "ζ", title: "damping ratio", unit: "", plain: true, range: [0.005, 15],
    ...damping, when: byRatio, swap: "η" },
  { group: "Contacts" },
  { key: "interface.delay", symbol: "τ", title: "delay", unit: "time", si: "s", range: [0.002, 5], zero: true, ...delay },
  { key: "interface.delay.std", symbol: "Δτ", title: "its std. dev.", unit: "time", si: "s", range: [0.002, 1], zero: true,
    ...delayStd },
  { key: "interface.delay.negative", title: "delays below 0", choices: { clip: "become 0", redraw: "are drawn again",
    fold: "change sign" }, when: random },
  { key: "interface.thresholds.std", symbol: "Δf", title: "threshold std. dev.", unit: "xₛ", plain: true,
    range: [0.01, 0.5], when: (doc) => at(doc, "interface.thresholds.std") !== undefined },
  { key: "interface.initial.std", symbol: "Δf₀", title: "initial std. dev.", unit: "xₛ", plain: true,
    range: [0.001, 0.5], when: (doc) => at(doc, "interface.initial.low") === undefined },
  { key: "interface.ageing.time", symbol: "β", title: "ageing rate", unit: "1/√time", si: "1/√s", range: [0.05, 10],
    zero: true, ...ageing },
  { key: "interface.temperature.temperature", symbol: "T", title: "temperature", unit: "K", si: "K", range: [30, 3000], when: heated("temperature") },
  { key: "interface.temperature.activation_volume", symbol: "Vₐ", title: "activation vol.", unit: "nm^3", si: "nm^3", range: [0.05, 5],
    when: heated("activation_volume") },
  { key: "interface.temperature.width", symbol: "w", title: "width of Bell", unit: "xₛ", si: "m", range: [0.002, 0.2], when: heated("width") },
  { key: "interface.temperature.attempts", symbol: "ω₀", title: "attempts", unit: "1/time", si: "1/s", when: heated("attempts") },
  { key: "interface.contact_strength", symbol: "N fₛ", title: "contact strength", si: "N", when: SI },
  { key: "interface.breaking_displacement", symbol: "xₛ", title: "breaking displ.", si: "m", when: SI },
  { group: "Simulation" },
  { key: "simulation.method", title: "solver", choices: { contacts: "N contacts",
    "master equation": "master equation" }, missing: "contacts" },
  { key: "simulation.contacts", symbol: "N", title: "contacts", unit: "", plain: true, whole: true, range: [10, 1e5],
    when: contacts, missing: 10000 },
  { key: "simulation.seed", title: "seed", unit: "", plain: true, whole: true, when: contacts, missing: 1 },
  { key: "simulation.rtol", title: "error", unit: "", plain: true, range: [1e-8, 1e-2],
    when: (doc) => !contacts(doc), missing: 1e-4 },
  { key: "simulation.start", title: "start", choices: { "from rest": "at rest", sliding: "sliding smoothly" },
    missing: "from rest" },
  { key: "drive.distance", title: "distance", unit: "xₛ", si: "m", range: [5, 500],
    when: (doc) => held(doc) && at(doc, "drive.duration") === undefined },
  { key: "drive.duration", title: "duration", unit: "time", si: "s",
    when: (doc) => held(doc) && at(doc, "drive.duration") !== undefined },
].map((field) => (field.key && !field.read ? { ...field, ...simple(field.key) } : field));

const NUMBER = "[-+]?(?:\\d+\\.?\\d*|\\.\\d+)(?:[eE][-+]?\\d{1,3})?";
const WHOLE = new RegExp(`^\\s*${NUMBER}\\s*$`), WITH_UNIT = new RegExp(`^\\s*(${NUMBER})\\s*((?:1\\s*/|[^\\d\\s.,]).*)?$`);
/* A number written as the server reads it; NaN for anything else, such as "0x10", "1e999" or "". */
export const numeric = (text) => (WHOLE.test(text) && isFinite(Number(text)) ? Number(text) : NaN);
/* "4 MN/m" -> ["4", "MN/m"]; 4 -> ["4", ""]; what is no number stays whole. */
export function split(value) {
  if (value === undefined || value === null) return ["", ""];
  if (typeof value === "number") return [String(value), ""];
  const found = WITH_UNIT.exec(value);
  return found ? [found[1], (found[2] ?? "").trim()] : [String(value), ""];
}
/* A decimal comma becomes a point ("1,5"); thousands apart ("1 200", "1.200,5") are not guessed at. */
export const pointed = (text) => text.replace(/^(\s*[-+]?\d*),(\d+)(?![\d.,])/, "$1.$2");
/* A whole number may have its thousands apart: "10 000". */
export const joined = (text) => (/^\s*\d{1,3}(\s\d{3})+\s*$/.test(text) ? text.replace(/\s/g, "") : text);
/* Still being typed: "", "-", "1.", "1e", "1.5e-". */
export const unfinished = (text) => /^\s*[-+]?(\d*[.,]?|(\d+[.,]?\d*|[.,]\d+)[eE][-+]?)\s*$/.test(text) && !/^\s*[-+]?\d+\s*$/.test(text);
export const short = (value, digits = 4) => Number(value.toPrecision(digits));

/* The fields of the rig: where each stands in the document (the content of a rig file), its units and its slider. */

export const at = (tree, path) => path.split(".").reduce((node, key) => (node == null ? undefined : node[key]), tree);
export const put = (tree, path, value) => {
  const keys = path.split("."), last = keys.pop();
  let node = tree;
  for (const key of keys) node = node[key] !== null && typeof node[key] === "object" ? node[key] : (node[key] = {});
  if (value === undefined) delete node[last];
  else node[last] = value;
};

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

// A measured curve is written point by point: "0.1 mm/s, 5 N; 1 mm/s, 4 N". It takes the place of other keys, which are kept.
const besides = new WeakMap(); // of each document: those of one rig are not another's
const curve = {
  read: (doc) => (Array.isArray(at(doc, "interface.friction")) ? at(doc, "interface.friction").map((point) => point.join(", ")).join("; ") : undefined),
  write: (doc, value) => {
    const others = ["contact_strength", "mu_k", "areas", "delay", "v_half", "newborn", "ageing", "activation"];
    if (value === "none") {
      doc.interface = { ...doc.interface, ...besides.get(doc) };
      return put(doc, "interface.friction", undefined);
    }
    if (!at(doc, "interface.friction")) besides.set(doc, Object.fromEntries(others.map((key) => [key, at(doc, `interface.${key}`)])));
    for (const key of others) put(doc, `interface.${key}`, undefined);
    put(doc, "interface.friction", value.split(";").map((point) => point.split(",").map((cell) => (
      isNaN(numeric(cell)) ? cell.trim() : numeric(cell)))));
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

// Each solver has numbers of its own; those of the other one are kept for when it is chosen again.
const kept = { contacts: 10_000, seed: 1, rtol: 1e-4 };
const solver = {
  write: (doc, value) => {
    for (const key of ["contacts", "seed", "rtol"]) {
      kept[key] = at(doc, `simulation.${key}`) ?? kept[key];
      put(doc, `simulation.${key}`, (key === "rtol") === (value === "master equation") ? kept[key] : undefined);
    }
    put(doc, "simulation.method", value);
  },
};
/* The fields of a rig, from the glossary that the server sends: it has their words, units and ranges. A field is shown if its
   key stands in the document, or something is known to stand for it. */
const SPECIAL = { "interface.friction": curve, "interface.delay": delay, "interface.delay.std": delayStd, "interface.ageing.time": ageing, "simulation.method": solver };
export const fieldsOf = (glossary) => glossary.filter(({ field }) => field).map(({ key, field, term, unit, text }) => (
  { key, ...field, help: `${term}${unit ? ` (${unit})` : ""}. ${text}`, read: (doc) => at(doc, key), write: (doc, value) => put(doc, key, value),
    when: (doc) => at(doc, key) !== undefined || field.missing !== undefined || field.zero, ...SPECIAL[key] }));

const NUMBER = "[-+]?(?:\\d+\\.?\\d*|\\.\\d+)(?:[eE][-+]?\\d{1,3})?";
const WHOLE = new RegExp(`^\\s*${NUMBER}\\s*$`), WITH_UNIT = new RegExp(`^\\s*(${NUMBER})\\s*((?:1\\s*/|[^\\d\\s.,]).*)?$`);
/* A number written as the server reads it; NaN for anything else, such as "0x10", "1e999" or "". */
export const numeric = (text) => (WHOLE.test(text) && isFinite(Number(text)) ? Number(text) : NaN);
/* "4 MN/m" -> ["4", "MN/m"]; 4 -> ["4", ""]; what is no number stays whole. */
export function split(value) {
  const found = WITH_UNIT.exec(value ?? "");
  return found ? [found[1], (found[2] ?? "").trim()] : [String(value ?? ""), ""];
}
/* A decimal comma becomes a point ("1,5"); thousands apart ("1 200", "1.200,5") are not guessed at. */
export const pointed = (text) => text.replace(/^(\s*[-+]?\d*),(\d+)(?![\d.,])/, "$1.$2");
/* A whole number may have its thousands apart: "10 000". */
export const joined = (text) => (/^\s*\d{1,3}(\s\d{3})+\s*$/.test(text) ? text.replace(/\s/g, "") : text);
/* Still being typed: "", "-", "1.", "1e", "1.5e-". */
export const unfinished = (text) => /^\s*[-+]?(\d*[.,]?|(\d+[.,]?\d*|[.,]\d+)[eE][-+]?)\s*$/.test(text) && !/^\s*[-+]?\d+\s*$/.test(text);
export const short = (value, digits = 4) => Number(value.toPrecision(digits));

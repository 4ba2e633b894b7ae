/* The drawing: slider, spring and base, and the contacts as bristles. It replays frames of a run that the server has
   made: where each contact is in a frame was computed, nothing is made up. Between two frames a contact that holds in
   both moves evenly. Frames lie closer together in slips, so that an even pace of frames slows down there. */

import { unpacked } from "./page.js";

const PER_SECOND = 30, ATTACHED = 1, RENEWED = 2, FLASH = 0.3, GAP = 46, TOP = 18;

/* A drawing on a canvas; seen(time, force) is called at each picture. */
export function makeStage(canvas, colour, seen) {
  let frames = null, place = 0, playing = false, last = 0, pace = 1, slow = true, flashes = [], asked = 0;
  let shades = [];

  function show(answer) {
    const parts = {};
    for (const name of ["times", "force", "slider", "drive", "stretching", "flags"]) parts[name] = unpacked(answer[name]);
    frames = { ...answer, ...parts, count: parts.times.length };
    const lengths = frames.drive.map((d, i) => d - frames.slider[i]);
    [frames.longest, frames.shortest] = [Math.max(...lengths, 1), Math.min(...lengths, 0)];
    flashes = new Float32Array(frames.shown);
    place = 0;
    canvas.dataset.frames = frames.count;
    paint();
  }
  function clear() { frames = null; pause(); paint(); }
  const span = () => (frames ? [frames.times[0], frames.times.at(-1)] : null);
  const now = () => mix(frames.times, place);
  function mix(values, at) {
    const i = Math.min(Math.floor(at), frames.count - 2);
    return values[i] + (values[i + 1] - values[i]) * (at - i);
  }
  function placeAt(time) {
    const after = frames.times.findIndex((t) => t > time), high = after < 0 ? frames.count - 1 : Math.max(after, 1);
    const begin = frames.times[high - 1], step = frames.times[high] - begin;
    return high - 1 + (step > 0 ? Math.min(Math.max((time - begin) / step, 0), 1) : 0);
  }
  function seek(time) {
    if (!frames) return;
    place = placeAt(time);
    flashes.fill(0);
    paint();
  }
  function play() {
    if (!frames || playing) return;
    playing = true;
    last = performance.now();
    requestAnimationFrame(step);
  }
  function pause() { playing = false; }
  function step(clock) {
    if (!playing || !frames) return;
    const passed = Math.min((clock - last) / 1000, 0.1), before = place;
    last = clock;
    if (slow) place += passed * PER_SECOND * pace;
    else { // evenly in time: the whole in as long as it takes with slow slips
      const [begin, end] = span();
      place = placeAt(now() + ((end - begin) * passed * PER_SECOND * pace) / frames.count);
      if (place >= frames.count - 1.001) place = frames.count;
    }
    if (place >= frames.count - 1) { place = 0; flashes.fill(0); }
    else broken(Math.floor(before), Math.floor(place));
    for (let c = 0; c < flashes.length; c++) flashes[c] *= Math.exp(-passed / FLASH);
    paint();
    requestAnimationFrame(step);
  }
  const holds = (i, c) => frames.flags[i * frames.shown + c] & ATTACHED;
  const renewed = (i, c) => frames.flags[i * frames.shown + c] & RENEWED;
  const stretched = (i, c) => frames.stretching[i * frames.shown + c] * frames.step;
  /* Which contacts broke from one frame to another: they flash, the brighter, the more they were stretched. */
  function broken(from, to) {
    let sum = 0;
    for (let i = from; i < to; i++) {
      for (let c = 0; c < frames.shown; c++) {
        if (!holds(i, c) || (holds(i + 1, c) && !renewed(i + 1, c))) continue;
        const force = Math.min(Math.abs(stretched(i, c)), 1);
        flashes[c] = Math.max(flashes[c], force);
        sum += force;
      }
    }
    canvas.dataset.broken = Number(canvas.dataset.broken ?? 0) + sum;
  }
  function fit() {
    const ratio = Math.min(window.devicePixelRatio || 1, 2), width = canvas.clientWidth, height = canvas.clientHeight;
    if (canvas.width !== Math.round(width * ratio)) canvas.width = Math.round(width * ratio);
    if (canvas.height !== Math.round(height * ratio)) canvas.height = Math.round(height * ratio);
    return [ratio, width, height];
  }
  function palette() {
    const parse = (name) => [1, 3, 5].map((i) => parseInt(colour(name).slice(i, i + 2), 16));
    const [from, to] = [parse("blue"), parse("vermillion")];
    shades = Array.from({ length: 17 }, (_, i) => `rgb(${from.map((a, j) => Math.round(a + (to[j] - a) * (i / 16))).join(",")})`);
  }
  function paint() {
    if (!canvas.clientWidth) return; // on another page
    const [ratio, width, height] = fit(), ink = canvas.getContext("2d");
    ink.setTransform(ratio, 0, 0, ratio, 0, 0);
    ink.clearRect(0, 0, width, height);
    canvas.dataset.painted = ++asked;
    if (!frames) return;
    if (!shades.length) palette();
    const i = Math.min(Math.floor(place), frames.count - 2), part = place - i;
    const X = mix(frames.slider, place), D = mix(frames.drive, place);
    const base = height - 20, block = Math.min(0.52 * width, 14 * frames.shown), wall = width - 26;
    const each = Math.min(22, block / 14), rest = 0.1 * width;
    const room = wall - block - rest - 1.4 * each - 8, scale = Math.min(each, room / (frames.longest - frames.shortest));
    const right = wall - rest - (D - X - frames.shortest) * scale, left = right - block, under = base - GAP;

    // The base, with marks that stay where they are while the slider moves over it.
    ink.fillStyle = colour("panel");
    ink.fillRect(0, base, width, height - base);
    ink.strokeStyle = colour("quiet");
    ink.lineWidth = 1;
    ink.beginPath();
    ink.moveTo(0, base + 0.5);
    ink.lineTo(width, base + 0.5);
    const pitch = 2 * each, shift = (((left - X * each) % pitch) + pitch) % pitch;
    for (let x = shift - pitch; x < width + pitch; x += pitch) { ink.moveTo(x, base); ink.lineTo(x - 7, base + 9); }
    ink.stroke();

    // The contacts.
    for (let c = 0; c < frames.shown; c++) {
      const foot = left + (block * (c + 0.5)) / frames.shown;
      const stays = holds(i, c) && holds(i + 1, c) && !renewed(i + 1, c), at = part < 0.5 ? i : i + 1;
      const x = stays ? stretched(i, c) + (stretched(i + 1, c) - stretched(i, c)) * part : stretched(at, c);
      const held = stays || holds(at, c);
      ink.beginPath();
      ink.moveTo(foot, under);
      if (held) {
        const tip = foot - x * each;
        ink.strokeStyle = shades[Math.round(16 * Math.min(Math.abs(x) / 1.2, 1))];
        ink.lineWidth = 2;
        ink.quadraticCurveTo(foot, base - GAP * 0.35, tip, base);
      } else {
        ink.strokeStyle = colour("quiet");
        ink.lineWidth = 1.2;
        ink.lineTo(foot, under + GAP * 0.45);
      }
      ink.stroke();
      if (flashes[c] > 0.08) {
        ink.globalAlpha = Math.min(1, flashes[c]);
        ink.fillStyle = colour("orange");
        ink.beginPath();
        ink.arc(foot, base - GAP * 0.4, 2 + 6 * flashes[c], 0, 7);
        ink.fill();
        ink.globalAlpha = 1;
      }
    }

    // Slider, spring and drive.
    ink.fillStyle = colour("field");
    ink.strokeStyle = colour("ink");
    ink.lineWidth = 1.5;
    ink.beginPath();
    ink.roundRect(left, TOP, block, under - TOP, 5);
    ink.fill();
    ink.stroke();
    const middle = TOP + (under - TOP) / 2, turns = 9, length = wall - right;
    ink.beginPath();
    ink.moveTo(right, middle);
    for (let k = 0; k <= 2 * turns; k++) {
      const along = right + 6 + ((length - 12) * k) / (2 * turns);
      ink.lineTo(along, k === 0 || k === 2 * turns ? middle : middle + (k % 2 ? 8 : -8));
    }
    ink.lineTo(wall, middle);
    ink.stroke();
    ink.fillStyle = colour("ink");
    ink.fillRect(wall, TOP - 4, 5, under - TOP + 8);
    ink.font = "12px system-ui, 'DejaVu Sans', sans-serif";
    ink.textAlign = "center";
    ink.fillText("slider", left + block / 2, middle + 4);
    ink.fillStyle = colour("quiet");
    ink.fillText("spring", (right + wall) / 2, TOP - 5);
    ink.textAlign = "right";
    ink.fillText("drive →", width - 4, under + 18);
    canvas.dataset.time = now();
    canvas.dataset.stretched = stretched(i, 0);
    seen(now(), mix(frames.force, place));
  }
  return { show, clear, play, pause, seek, span, paint, pace: (value) => { pace = value; },
    slow: (value) => { slow = value; }, recolour: () => { shades = []; paint(); } };
}

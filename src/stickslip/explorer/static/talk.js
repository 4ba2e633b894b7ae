/* Questions to the server, and its answers. Each kind of question has a lane in which only the newest counts; answers
   carry the number of their question. */

import { $, notice, progress, state, tellParts } from "./page.js";

const FRAME = 400; // ms after which a question is asked anew although the last is not answered

let socket = null, counter = 0;
const lanes = {}; // kind -> {id, answered, sent, waiting, waiter}
const kinds = {}; // kind -> {answer, refused, bar}

/* What is done with answers of a kind, and with complaints about its question; the bar that shows how far it is. */
export function on(kind, answer, refused = () => {}, bar = null) {
  kinds[kind] = { answer, refused, bar };
}
/* Ask a question; a file goes with it in the same message, after the first line. */
export function ask(kind, content = {}) {
  const lane = (lanes[kind] ??= { id: 0, answered: 0, sent: 0 });
  lane.waiting = { kind, id: ++counter, document: state.doc, width: Math.max(300, $("pages").clientWidth), ...content };
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
  const { file, ...question } = lane.waiting, text = JSON.stringify(question);
  socket.send(file ? new Blob([text, "\n", file]) : text);
  lane.waiting = null;
}
export function drop(kind) {
  if (lanes[kind]) { lanes[kind].wanted = 0; lanes[kind].waiting = null; }
  if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify({ kind, drop: true }));
}
export const isNewest = (reply) => reply.id === lanes[reply.kind].wanted;

export function connect() {
  socket = new WebSocket(`ws://${location.host}${location.pathname.replace(/[^/]*$/, "")}session`);
  socket.onopen = () => {
    notice("");
    for (const lane of Object.values(lanes)) { lane.answered = lane.id; pump(lane); }
  };
  socket.onclose = () => {
    notice("The server is gone, or has no room for another window. This page will find it again.");
    tellParts("lost");
    setTimeout(connect, 2000);
  };
  socket.onmessage = (event) => receive(JSON.parse(event.data));
}
function receive(reply) {
  if (reply.kind === "hello") return kinds.hello.answer(reply);
  if (reply.kind === "error") return kinds.run.refused(reply.errors);
  const lane = lanes[reply.kind];
  if (!lane) return;
  if (reply.done || reply.errors) { lane.answered = Math.max(lane.answered, reply.id); pump(lane); }
  if (reply.id !== lane.wanted && !(reply.kind === "run" && reply.force && reply.id === lane.id)) return;
  const { answer, refused, bar } = kinds[reply.kind];
  if (reply.progress !== undefined) return void (bar && progress(bar, reply.progress));
  if (bar && (reply.done || reply.errors || reply.force)) progress(bar, null);
  if (reply.errors) refused(reply.errors);
  else if (!reply.done) answer(reply);
}
export const saying = (errors) => errors.map((error) => error.message).join("; ");

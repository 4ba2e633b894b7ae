/* Questions to the server, and its answers. Each kind of question has a lane in which only the newest counts; answers
   carry the number of their question. */

import { $, complainAt, mark, notice, progress, state } from "./page.js";

const FRAME = 400; // ms after which a question is asked anew although the last is not answered
const PATIENCE = 600; // ms after which a bar shows that something is computed

let socket = null, counter = 0;
const lanes = {}; // by kind of question

/* What is done with answers of a kind. What stands on the page of them (`about`) is marked as they are asked for, come or
   are refused; an answer that is not `whole` does not stand yet. A `bar` shows how far it is. */
export function on(kind, answer, { about = null, bar = about, refused = () => {}, whole = () => true } = {}) {
  const shows = bar && $(`${bar}-progress`) ? bar : null, stop = about && $(`${about}-stop`);
  lanes[kind] = { kind, answer, refused, about, whole, bar: shows, id: 0, answered: 0, sent: 0, waiting: null };
  if (stop) stop.onclick = () => { drop(kind); refuse(kind, [], "stopped"); };
}
/* Ask a question; a file goes with it in the same message, after the first line. */
export function ask(kind, content = {}) {
  const lane = lanes[kind];
  lane.waiting = { kind, id: ++counter, document: state.doc, width: Math.max(300, $("pages").clientWidth), ...content };
  lane.wanted = lane.waiting.id;
  if (lane.about) mark(lane.about, lane.how = "computing");
  clearTimeout(lane.patience);
  if (lane.bar) lane.patience = setTimeout(progress, PATIENCE, lane.bar, NaN);
  pump(lane);
  return lane.wanted;
}
/* A question that is asked after a rest, when it is `due`, and once for each thing that it is `of`. What comes back is to be
   called whenever that may have changed: what stands on the page is marked then. */
export function onceFor(kind, of, due, content = () => ({}), rest = 200) {
  const lane = lanes[kind];
  let resting = 0;
  return () => {
    clearTimeout(resting);
    if (state.waiting) return;
    if (lane.of === of()) return mark(lane.about, lane.how);
    mark(lane.about, "computing");
    if (due()) resting = setTimeout(() => { lane.of = of(); ask(kind, content()); }, rest);
  };
}
export const isAbout = (kind, what) => lanes[kind].of === what;
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
  Object.assign(lanes[kind], { wanted: 0, waiting: null });
  ended(lanes[kind]);
  if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify({ kind, drop: true }));
}
export const isNewest = (reply) => reply.id === lanes[reply.kind].wanted;
export const isPending = (kind) => lanes[kind].wanted > lanes[kind].answered;

export function connect() {
  socket = new WebSocket(`ws://${location.host}${location.pathname.replace(/[^/]*$/, "")}session`);
  socket.onopen = () => {
    notice("");
    for (const lane of Object.values(lanes)) { lane.answered = lane.id; pump(lane); }
  };
  socket.onclose = () => {
    notice("The server is gone, or has no room for another window. This page will find it again.");
    for (const { kind, about, id, answered } of Object.values(lanes)) if (about && id > answered) refuse(kind, [{ message: "The server is gone." }]);
    setTimeout(connect, 2000);
  };
  socket.onmessage = (event) => receive(JSON.parse(event.data));
}
function receive(reply) {
  const lane = lanes[reply.kind === "error" ? "run" : reply.kind];
  if (reply.id == null) return reply.errors ? lane.refused(reply.errors) : lane.answer(reply);
  if (reply.done || reply.errors) { lane.answered = Math.max(lane.answered, reply.id); pump(lane); }
  if (reply.id !== lane.wanted && !(reply.kind === "run" && reply.force && reply.id === lane.id)) return;
  if (reply.progress !== undefined) return void (lane.bar && progress(lane.bar, reply.progress));
  if (reply.done || reply.errors || reply.force) ended(lane);
  if (reply.errors) return refuse(reply.kind, reply.errors);
  if (reply.done) return;
  if (lane.about && lane.whole(reply)) mark(lane.about, lane.how = "");
  lane.answer(reply);
}
function ended({ bar, patience }) {
  clearTimeout(patience);
  if (bar) progress(bar, null);
}
/* What was asked is not answered: complaints are shown, and it may be asked again. */
export function refuse(kind, errors, how = "refused") {
  const lane = lanes[kind], { about, refused } = lane;
  lane.of = null;
  if (about) {
    mark(about, how);
    complainAt(`${about}-complaint`, saying(errors));
  }
  refused(errors);
}
export const saying = (errors) => errors.map((error) => error.message).join("; ");

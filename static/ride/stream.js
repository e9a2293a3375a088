// Simulations of a slider that is being moved, over a websocket: of the requests that wait for
// their turn the service runs the newest alone. Where there is no websocket, each is sent by itself.

import * as api from "../common/api.js";

/** Milliseconds after which a websocket is tried again that could not be had. */
const AGAIN = 30_000;
/**
 * Milliseconds without a word, while something is asked, after which a websocket is given up: after a
 * sleep or behind another address its connection may be gone without anybody having been told.
 */
const SILENCE = 15_000;

let socket = null;
let failed = -Infinity;
/** What gives the websocket up. */
let timer = null;
/** What was asked and not answered, by `seq`: {body, resolve, reject}, in the order of asking. */
const asked = new Map();

/** Whether one more may be asked for while another is under way. */
export const open = () => socket?.readyState === WebSocket.OPEN && socket.bufferedAmount === 0;

/** A run, or null where a newer one was asked for before it had its turn. */
export function simulate(body) {
  if (performance.now() < failed + AGAIN) return api.simulate(body);
  return new Promise((resolve, reject) => {
    asked.set(body.seq, { body, resolve, reject });
    timer ??= setTimeout(giveUp, SILENCE);
    if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify(body));
    else if (socket?.readyState !== WebSocket.CONNECTING) connect();
  });
}

function connect() {
  const mine = api.simulations();
  let opened = false;
  socket = mine;
  mine.binaryType = "arraybuffer";
  mine.onopen = () => {
    opened = true;
    asked.forEach(({ body }) => mine.send(JSON.stringify(body)));
  };
  mine.onmessage = ({ data }) => {
    if (typeof data !== "string") answer(api.decode(data));
    else refuse(JSON.parse(data));
    clearTimeout(timer);
    timer = asked.size ? setTimeout(giveUp, SILENCE) : null;
  };
  mine.onclose = () => {
    if (!opened) failed = performance.now();
    if (socket === mine) closed();
  };
}

function answer(run) {
  taken(run.head.seq)?.resolve(run);
}

/** Of what cannot be read the service knows no number; then nothing that was asked can be. */
function refuse(problem) {
  taken(problem.seq ?? Math.max(...asked.keys()))?.reject(new api.Refusal(problem, problem.status));
}

/** The request of a number; those before it were superseded. */
function taken(seq) {
  const one = asked.get(seq);
  for (const [number, { resolve }] of asked) {
    if (number < seq) {
      asked.delete(number);
      resolve(null);
    }
  }
  asked.delete(seq);
  return one;
}

function giveUp() {
  const lost = socket;
  failed = performance.now();
  closed();
  lost?.close();
}

/** What was under way is asked for once more by itself, which tells what is the matter. */
function closed() {
  socket = null;
  clearTimeout(timer);
  timer = null;
  const [newest] = [...asked.values()].slice(-1);
  if (!newest) return;
  const { body, resolve, reject } = taken(newest.body.seq);
  api.simulate(body).then(resolve, reject);
}

// Simulations of the page: nothing queues up behind a slider.
//
// While a run of "now" is under way, newer values are sent after it all the time, of which the
// service takes the newest (stream.js): what it simulates is what the slider says by then.

import { withValues } from "../car/controls.js";
import * as api from "../common/api.js";
import { get, set } from "../common/store.js";
import { allChannels, visibleChannels } from "./charts.js";
import { POSE_CHANNELS } from "./poses.js";
import { rimsOf } from "./preparation.js";
import * as stream from "./stream.js";

const MOST_SAMPLES = 2001;
const MEASURED_SAMPLES = 4001;
/** Milliseconds from a run of "now" that is under way to the next. */
const PACE = 25;
/** Milliseconds after which a refusal of this code is asked again by itself. */
const PAUSES = { busy: 500, unavailable: 2000 };
/** Codes of a service that does not simulate yet, or no more; the page waits until one does. */
const AWAY = ["compiling", "draining"];

const wanted = { now: false, reference: false, measured: false, scene: false };
const underWay = { now: 0, reference: 0, alone: 0 };
/** How many runs were refused for the moment, and wait until they may be asked for again. */
let refused = 0;
let sequence = 0;
/** When a run of "now" was asked for last, and what asks for the next. */
let sent = -Infinity;
let timer = null;
/** Milliseconds from a wish to its charts, for the status line and the tests. */
export const timing = { asked: 0, shown: [] };

/** Nothing is under way and nothing is wanted. */
export const idle = () => !someUnderWay() && !timer;

const someUnderWay = () => underWay.now + underWay.reference + underWay.alone > 0;

/** Resolves once no request is under way that began before the last change. */
export async function settled() {
  while (!idle()) await new Promise((done) => setTimeout(done, 30));
}

/** Ask for runs: "now", "reference", "measured"; `scene` also sends the car's nodes. */
export function want(...names) {
  if (names.includes("now") && !wanted.now) timing.asked = performance.now();
  names.forEach((name) => { wanted[name] = true; });
  begin();
}

/** A car on the chosen ride, as much of it as the page shows. */
export function request(car) {
  return {
    ...ofRide(car), max_samples: MOST_SAMPLES, decimate: "stride", seq: ++sequence,
    channels: [...new Set([...POSE_CHANNELS, ...visibleChannels()])],
  };
}

/** A car on the chosen ride, every channel and sample of it. */
export function ofRide(car) {
  const ride = get("ride");
  const body = { ...car };
  if (ride.kind === "measurement") {
    body.rims = rimsOf(ride.id);
  } else {
    body.manoeuvre = get("manoeuvres").find(({ key }) => key === ride.key)?.given ?? ride.key;
    body.lift_off = get("liftOff");
    if (get("road")) body.road = get("road");
  }
  return body;
}

/** Begin whatever is wanted and may begin by now. */
function begin() {
  for (;;) {
    const next = get("ready") && get("online") ? following() : null;
    if (!next) return;
    perform(...next);
  }
}

/** What may begin, as [kind, work], or null. */
function following() {
  if (underWay.alone) return null;
  if (wanted.measured || wanted.scene) {
    return someUnderWay() ? null : ["alone", wanted.measured ? measured : now];
  }
  if (wanted.now && mayHurry()) return ["now", now];
  return wanted.reference && !underWay.reference ? ["reference", reference] : null;
}

/** Whether one more run of "now" may begin; if it may after a while, it does. */
function mayHurry() {
  if (!underWay.now) return true;
  if (refused || !stream.open()) return false;
  const early = sent + PACE - performance.now();
  if (early > 0) {
    timer ??= setTimeout(() => {
      timer = null;
      begin();
    }, early);
  }
  return early <= 0;
}

async function perform(kind, work) {
  underWay[kind] += 1;
  try {
    await work();
  } catch (error) {
    if (!(error instanceof api.Refusal)) {
      underWay[kind] -= 1;
      throw error;
    }
    if (error.lost) set({ online: false });
    else if (AWAY.includes(error.code)) set({ ready: false });
    else {
      // A session that is busy asked too much itself: there is nothing to tell.
      if (error.code !== "busy") set({ trouble: error });
      if (error.code in PAUSES) await pause(PAUSES[error.code]);
    }
  }
  underWay[kind] -= 1;
  begin();
}

async function pause(milliseconds) {
  refused += 1;
  await new Promise((done) => setTimeout(done, milliseconds));
  refused -= 1;
}

async function measured() {
  wanted.measured = false;
  const ride = get("ride");
  if (ride.kind !== "measurement") {
    set({ measured: null });
    return;
  }
  const row = get("measurements").find(({ id }) => id === ride.id);
  const have = new Set(row?.channels.map(({ name }) => name));
  const names = [...new Set([...POSE_CHANNELS, ...allChannels()])].filter((name) => have.has(name));
  const run = await retried("measured", () => api.measurement(ride.id, names, MEASURED_SAMPLES));
  if (ride === get("ride")) set({ measured: run });
}

async function now() {
  const [vehicle, values] = [get("vehicle"), get("values")];
  const isStill = sameRide();
  const scene = wanted.scene;
  const asked = timing.asked;
  wanted.now = wanted.scene = false;
  sent = performance.now();
  const body = request({ vehicle, values, scene });
  const run = await retried(...(scene ? ["scene", () => api.simulate(body)] : ["now", () => stream.simulate(body)]))
    .catch((error) => { throw Object.assign(error, { values }); });
  if (!run || !isStill()) return;
  set({ trouble: null, now: run, valuesNow: values, vehicleNow: withValues(vehicle, values) });
  timing.shown.push(performance.now() - asked);
  if (timing.shown.length > 500) timing.shown.shift();
}

async function reference() {
  wanted.reference = false;
  const compare = get("compare");
  if (compare === "none") {
    set({ reference: null });
    return;
  }
  const isStill = sameRide();
  const car =
    compare === "7dof"
      ? { vehicle: get("vehicle"), values: get("values"), model: "7dof" }
      : { vehicle: get("baseline") };
  const run = await retried("reference", () => api.simulate(request(car)));
  if (isStill() && compare === get("compare")) set({ reference: run });
}

/** Tells later whether the ride and its road are still the ones of now. */
function sameRide() {
  const [ride, road] = [get("ride"), get("road")];
  return () => ride === get("ride") && road === get("road");
}

/** A wish that the service could not hear is kept for when it answers again. */
async function retried(name, work) {
  try {
    return await work();
  } catch (error) {
    if (error.lost || error.code in PAUSES || AWAY.includes(error.code)) wanted[name] = true;
    throw error;
  }
}


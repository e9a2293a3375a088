// Simulations of the page: one in flight, the newest wish next; nothing queues up behind a slider.

import * as api from "./api.js";
import { allChannels, visibleChannels } from "./charts.js";
import { withValues } from "./controls.js";
import { POSE_CHANNELS } from "./poses.js";
import { rimsOf } from "./preparation.js";
import { get, set } from "./store.js";

const MOST_SAMPLES = 2001;
const MEASURED_SAMPLES = 4001;

const wanted = { now: false, reference: false, measured: false, scene: false };
let running = false;
let sequence = 0;
/** Milliseconds from the newest wish to its charts, for the status line and the tests. */
export const timing = { asked: 0, shown: [] };

/** Nothing is under way and nothing is wanted. */
export const idle = () => !running;

/** Resolves once no request is under way that began before the last change. */
export async function settled() {
  while (running) await new Promise((done) => setTimeout(done, 30));
}

/** Ask for runs: "now", "reference", "measured"; `scene` also sends the car's nodes. */
export function want(...names) {
  if (names.includes("now") && !wanted.now) timing.asked = performance.now();
  names.forEach((name) => { wanted[name] = true; });
  if (!running) loop();
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

async function loop() {
  running = true;
  while (get("ready") && get("online") && Object.values(wanted).some(Boolean)) {
    try {
      if (wanted.measured) await measured();
      else if (wanted.now || wanted.scene) await now();
      else if (wanted.reference) await reference();
    } catch (error) {
      if (!(error instanceof api.Refusal)) {
        running = false;
        throw error;
      }
      if (error.lost) set({ online: false });
      else if (error.code === "compiling") set({ ready: false });
      else if (error.code === "busy") await new Promise((done) => setTimeout(done, 500));
      else set({ trouble: error });
    }
  }
  running = false;
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
  const run = await retried(scene ? "scene" : "now", () => api.simulate(request({ vehicle, values, scene })))
    .catch((error) => { throw Object.assign(error, { values }); });
  if (!isStill()) return;
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
    if (error.lost || error.code === "compiling" || error.code === "busy") wanted[name] = true;
    throw error;
  }
}


// Identification: start a fit as set up, follow it, hand its result on.

import * as api from "./api.js";
import { withValues } from "./controls.js";
import { $, h, inPlace } from "./dom.js";
import * as free from "./free.js";
import { notice, refused } from "./notices.js";
import * as noise from "./noise.js";
import { brakingOf, rimsOf } from "./preparation.js";
import * as result from "./result.js";
import * as setup from "./setup.js";
import { get, on, set } from "./store.js";

let job = null;
let holdouts = {};
let view = "setup";
let starting = false;
let unfollow = () => {};
let hooks = {};

export const current = () => job;

/** Build the panel; `open` shows its tab, `apply(values)` moves the sliders. */
export function build(callbacks) {
  hooks = callbacks;
  $("#identify").addEventListener("click", () => {
    hooks.open();
    start();
  });
  free.build();
  on("measurements ride", () => {
    const panel = $("#identification");
    if (view === "setup" && !panel.hidden && !panel.contains(document.activeElement)) show();
  });
  on("vehicle", () => { if (view === "fit") show(); });
  on("values", () => { if (view === "setup" && !$("#identification").hidden) free.askBounds(); });
  on("online", (state) => {
    if (state.online && job && !api.isFinal(job.state)) watch(job.id);
  });
  show();
}

/** The tab has been opened: start values may have moved since. */
export function opened() {
  if (view === "setup") show();
}

const busy = () => job !== null && !api.isFinal(job.state);

/** Take up the newest job of a session that is opened again. */
export async function resume(jobs) {
  const newest = [...jobs].sort((a, b) => (a.created < b.created ? 1 : -1));
  const live = newest.find(({ state }) => !api.isFinal(state));
  const done = newest.find(({ state }) => state === "done");
  const from = live ?? done;
  if (!from) return;
  job = await api.identification(from.id);
  view = "fit";
  if (done && done.id !== from.id) set({ fit: (await api.identification(done.id)).result, fitJob: done });
  if (job.state === "done") await finished();
  else watch(job.id);
  show();
}

/** Start a fit as set up; a second press while it is being sent starts no second one. */
async function start() {
  if (starting || busy()) return;
  starting = true;
  await submit();
  starting = false;
  show();
}

async function submit() {
  const runs = setup.fitted();
  if (!runs.length) {
    view = "setup";
    notice("error", "No run to fit", "Set at least one measured run to “fit”.");
    return;
  }
  const bounds = await free.bounds();
  const body = {
    vehicle: withValues(get("vehicle"), get("values")),
    runs: runs.map(({ id }) => id),
    free: free.names(),
    bounds,
    noise: noise.typed(),
    traction: get("traction"),
    settings: get("rimsSettings"),
    braking: brakingOf(runs.map(({ id }) => id)),
    key: crypto.randomUUID?.() ?? String(Math.random()).slice(2),
  };
  holdouts = Object.fromEntries(setup.heldOut().map((run) => [run.id, null]));
  try {
    job = await api.identify(body);
  } catch (error) {
    if (error.lost) set({ online: false });
    refused(error, "Starting the identification");
    return;
  }
  view = "fit";
  watch(job.id);
}

function watch(id) {
  unfollow();
  unfollow = api.follow("identifications", id, (progress) => {
    if (job?.id !== id) return;
    job.progress = progress;
    if (view === "fit") result.advance(job);
  }, async (state) => {
    if (job?.id !== id) return;
    job = { ...job, ...state };
    if (state.state === "done") await finished();
    show();
  });
}

async function finished() {
  try {
    job = await api.identification(job.id);
  } catch (error) {
    refused(error, "Reading the fit");
    return;
  }
  set({ fit: job.result, fitJob: job });
  show();
  await scoreHoldouts();
}

/** A run that the fit has not seen, driven by the identified car. */
async function scoreHoldouts() {
  const fitted = job;
  const used = new Set(fitted.runs.map(({ id }) => id));
  const seen = get("measurements").filter(({ id }) => used.has(id));
  const ids = Object.keys(holdouts).length ? Object.keys(holdouts)
    : setup.unseen(seen).map(({ id }) => id);
  for (const id of ids) {
    try {
      const run = await api.simulate({
        vehicle: fitted.result.vehicle,
        rims: { ...rimsOf(id), traction: fitted.traction, settings: fitted.result.settings },
        channels: ["chassis.z"], max_samples: 10,
      });
      holdouts = { ...holdouts, [id]: run.head.fit_percent };
    } catch (error) {
      if (error.lost) return;
      holdouts = { ...holdouts, [id]: error.message };
    }
  }
  if (job === fitted) show();
}

async function cancel() {
  try {
    await api.cancelIdentification(job.id);
  } catch (error) {
    refused(error, "Cancelling");
  }
}

function show() {
  const panel = $("#identification");
  const running = busy();
  $("#identify").disabled = running;
  $("#identify").textContent = running ? "Identifying …" : "Identify";
  inPlace(panel, () => panel.replaceChildren(
    h("div", { className: "switch", role: "group", "aria-label": "Identification" },
      step("setup", "Set-up"), step("fit", "Fit"),
      h("span", { className: "grow" }),
      running
        ? h("button", { type: "button", id: "cancel", className: "danger", on: { click: cancel } },
            "Cancel")
        : h("button", { type: "button", id: "start", className: "primary", on: { click: start } },
            "Identify")),
    view === "setup" ? setup.view() : result.view(job, holdouts, hooks.apply),
  ), "#start, #cancel");
  if (view === "fit") result.advance(job);
}

function step(key, text) {
  return h("button", {
    type: "button", "aria-pressed": view === key,
    on: { click: () => { view = key; show(); } },
  }, text);
}

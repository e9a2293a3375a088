// Identification: start a fit as set up, follow it, hand its result on.

import { withValues } from "../car/controls.js";
import * as api from "../common/api.js";
import { $, h, inPlace } from "../common/dom.js";
import { jobs } from "../common/job.js";
import { nameOf } from "../common/names.js";
import { notice } from "../common/notices.js";
import { get, on, set } from "../common/store.js";
import { brakingOf, ready, rimsOf } from "../ride/preparation.js";
import * as fit from "./fit.js";
import * as free from "./free.js";
import * as priors from "./priors.js";
import * as profile from "./profile.js";
import * as result from "./result.js";
import * as search from "./search_form.js";
import * as sensors from "./sensors_form.js";
import * as setup from "./setup.js";

let holdouts = {};
let view = "setup";
let hooks = {};
const { now: current, busy, sending, start: send, resume: takeUp, cancel } =
  jobs("identifications", "identification", { changed: show, progressed: advance, ended });

export { current };

/** Build the panel; `open` shows its tab, `apply(result)`, `drive` and `see` take what was found further. */
export function build(callbacks) {
  hooks = callbacks;
  $("#identify").addEventListener("click", () => {
    hooks.open();
    start();
  });
  free.build();
  fit.build(() => { if (view === "fit") show(); });
  on("measurements ride use", () => {
    const panel = $("#identification");
    if (view === "setup" && !panel.hidden && !panel.contains(document.activeElement)) show();
  });
  on("measurements ride use", saidOfRuns);
  on("vehicle", () => { if (view === "fit") show(); });
  on("values", () => { if (view === "setup" && !$("#identification").hidden) free.askBounds(); });
  show();
}

/** The tab has been opened: start values may have moved since. */
export function opened() {
  if (view === "setup") show();
}

/** Take up the newest job of a session that is opened again: one under way, else one that is done. */
export async function resume() {
  let done;
  await takeUp((all) => {
    done = all.find(({ state }) => state === "done");
    return all.find(({ state }) => !api.isFinal(state)) ?? done;
  });
  const job = current();
  if (!job) return;
  view = "fit";
  if (done && done.id !== job.id) hold(await api.job("identifications", done.id));
  if (!busy()) await ended();
  if (get("fitJob")) await profile.resume(get("fitJob").id);
  show();
}

/** A fit as set up; null where there is nothing to fit. */
async function request() {
  const runs = setup.fitted();
  if (!runs.length) {
    view = "setup";
    notice("error", "No run to fit", "Set at least one measured run to “fit”.");
    return null;
  }
  const body = {
    vehicle: withValues(get("vehicle"), get("values")),
    runs: runs.map(({ id }) => id),
    free: free.names(),
    bounds: await free.bounds(),
    noise: get("noise"),
    priors: priors.typed(free.names()),
    ...get("search"),
    sensors: get("sensors"),
    fit_noise: get("fitNoise"),
    traction: get("traction"),
    settings: get("rimsSettings"),
    braking: brakingOf(runs.map(({ id }) => id)),
    key: crypto.randomUUID?.() ?? String(Math.random()).slice(2),
  };
  holdouts = Object.fromEntries(setup.heldOut(runs).map((run) => [run.id, null]));
  return body;
}

async function start() {
  if (![ready, search.ready, priors.ready, sensors.ready].every((one) => one())) return;
  const taken = send(request);
  press();
  if (!await taken) return;
  view = "fit";
  show();
}

/** Take what the fit offers for one of its channels, and fit again. */
function offer(one) {
  sensors.take(one);
  start();
}

function advance() {
  if (view === "fit") result.advance(current());
}

/** A fit and the identification that found it are one. */
const hold = (job) => set({ fit: job.result, fitJob: job });

async function ended() {
  const job = current();
  if (job.state !== "done") return;
  hold(job);
  show();
  await scoreHoldouts();
}

/** A run that the fit has not seen, driven by the identified car. */
async function scoreHoldouts() {
  const fitted = current();
  const used = new Set(fitted.runs.map(({ id }) => id));
  const seen = get("measurements").filter(({ id }) => used.has(id));
  const ids = Object.keys(holdouts).length ? Object.keys(holdouts)
    : setup.heldOut(seen, fitted.result.vehicle.name).map(({ id }) => id);
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
  if (current() === fitted) show();
}

function show() {
  const panel = $("#identification");
  const running = busy();
  inPlace(panel, () => panel.replaceChildren(
    h("div", { className: "switch", role: "group", "aria-label": "Identification" },
      step("setup", "Set-up"), step("fit", "Fit"),
      view === "fit" ? h("span", { className: "subs", role: "group", "aria-label": "Views of the fit" }, fit.tabs(current())) : null,
      view === "setup" ? h("span", { className: "hint to-fit", id: "to-fit" }) : null,
      running
        ? h("button", { type: "button", id: "cancel", className: "danger", on: { click: cancel } },
            "Cancel")
        : h("button", { type: "button", id: "start", className: "primary", on: { click: start } },
            "Identify")),
    view === "setup" ? setup.view(show) : fit.view(current(), holdouts, { ...hooks, offer }),
  ), "#start, #cancel");
  saidOfRuns();
  press();
  advance();
}

/** The buttons that begin a fit, while one is sent or under way. */
function press() {
  const waits = sending() || busy();
  for (const button of [$("#identify"), $("#start")].filter(Boolean)) {
    Object.assign(button, { disabled: waits, textContent: waits ? "Identifying …" : "Identify" });
  }
}

/** Which runs a press on Identify fits. */
function saidOfRuns() {
  const names = setup.fitted().map(({ id }) => nameOf(id));
  const text = names.length ? `Fits ${names.join(", ")}` : "No run to fit";
  $("#identify").title = `${text}: finds the free parameters`;
  const said = $("#to-fit");
  if (said) Object.assign(said, { textContent: text, title: text });
  const button = $("#start");
  if (button) button.title = text;
}

function step(key, text) {
  return h("button", {
    type: "button", "aria-pressed": view === key,
    on: { click: () => { view = key; show(); } },
  }, text);
}

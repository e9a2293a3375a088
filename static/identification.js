// Identification: choose runs and free parameters, watch the fit, read it, apply it.

import * as api from "./api.js";
import { DETERMINED, isBounded, withValues } from "./controls.js";
import { percent, short } from "./comfort.js";
import { costChart } from "./cost.js";
import { $, breakable, fileName, h, saveFile, symbol } from "./dom.js";
import { notice, refused } from "./notices.js";
import { get, on, set } from "./store.js";
import * as units from "./units.js";

const ROLES = { fit: "fit", holdout: "hold out", no: "leave out" };
const WELL = { yes: "well", weakly: "weakly", no: "not" };
const STATES = {
  queued: "Waiting for a worker …",
  running: "Fitting …",
  done: "Done",
  failed: "Failed",
  cancelled: "Cancelled",
};

/** What is chosen: the role of each run, free parameters, bounds that differ from the default. */
const choice = { roles: {}, fixed: new Set(), bounds: {}, traction: "exact" };
let job = null;
let holdouts = {};
let view = "setup";
let cost = null;
let unfollow = () => {};
let hooks = {};

export const current = () => job;

/** Build the panel; `open` shows its tab, `apply(values)` moves the sliders. */
export function build(callbacks) {
  hooks = callbacks;
  $("#identify").addEventListener("click", () => {
    hooks.open();
    if (!busy()) start();
  });
  on("measurements parameters", () => { if (view === "setup") show(); });
  on("online", (state) => {
    if (state.online && job && !api.isFinal(job.state)) watch(job.id);
  });
  show();
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
  if (done && done.id !== from.id) set({ fit: (await api.identification(done.id)).result });
  if (job.state === "done") await finished();
  else watch(job.id);
  show();
}

function roleOf(run) {
  if (!run.usable_for_identification) return "no";
  if (choice.roles[run.id]) return choice.roles[run.id];
  const usable = get("measurements").filter((m) => m.usable_for_identification);
  return usable[0] === run || usable.length === 1 ? "fit" : "holdout";
}

const runsAs = (role) => get("measurements").filter((run) => roleOf(run) === role);

async function start() {
  const runs = runsAs("fit");
  if (!runs.length) {
    view = "setup";
    show();
    notice("error", "No run to fit", "Set at least one measured run to “fit”.");
    return;
  }
  const names = get("parameters").map(({ name }) => name);
  const body = {
    vehicle: withValues(get("vehicle"), get("values")),
    runs: runs.map(({ id }) => id),
    free: names.filter((name) => !choice.fixed.has(name)),
    traction: choice.traction,
    key: crypto.randomUUID?.() ?? String(Math.random()).slice(2),
  };
  if (Object.keys(choice.bounds).length) body.bounds = choice.bounds;
  holdouts = Object.fromEntries(runsAs("holdout").map((run) => [run.id, null]));
  try {
    job = await api.identify(body);
  } catch (error) {
    if (error.lost) set({ online: false });
    refused(error, "Starting the identification");
    return;
  }
  view = "fit";
  cost = null;
  show();
  watch(job.id);
}

function watch(id) {
  unfollow();
  unfollow = api.follow(id, (progress) => {
    if (job?.id !== id) return;
    job.progress = progress;
    advance();
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
  set({ fit: job.result });
  show();
  await scoreHoldouts();
}

/** A run that the fit has not seen, driven by the identified car. */
async function scoreHoldouts() {
  const fitted = job;
  const used = new Set(fitted.runs.map(({ id }) => id));
  const ids = Object.keys(holdouts).length ? Object.keys(holdouts)
    : get("measurements").filter((m) => m.usable_for_identification && !used.has(m.id))
      .map((m) => m.id);
  for (const id of ids) {
    try {
      const run = await api.simulate({
        vehicle: fitted.result.vehicle, rims: { measurement: id, traction: fitted.traction },
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
  cost = null;
  panel.replaceChildren(
    h("div", { className: "switch", role: "group", "aria-label": "Identification" },
      step("setup", "Set-up"), step("fit", "Fit"),
      h("span", { className: "grow" }),
      running
        ? h("button", { type: "button", id: "cancel", className: "danger", on: { click: cancel } },
            "Cancel")
        : h("button", { type: "button", id: "start", className: "primary", on: { click: start } },
            "Identify")),
    view === "setup" ? setup() : fit(),
  );
  advance();
}

function step(key, text) {
  return h("button", {
    type: "button", "aria-pressed": view === key,
    on: { click: () => { view = key; show(); } },
  }, text);
}

function setup() {
  const runs = get("measurements");
  return h("div", { className: "setup scrolls" },
    h("section", {},
      h("h3", {}, "Runs"),
      runs.length
        ? h("table", { className: "runs" }, h("tbody", {}, runs.map(runRow)))
        : h("p", { className: "empty" }, "No measurement yet; add one under Measurements."),
      h("p", { className: "hint" },
        "A run held out is not fitted: it shows how well the car predicts what it has not seen."),
      h("label", { className: "block" }, "Traction",
        select({ exact: "exact: the traction that gives the measured a_x",
          paper: "paper: total mass times a_x (biased)" }, choice.traction,
        (value) => { choice.traction = value; }, { id: "traction" }))),
    h("section", {},
      h("h3", {}, "Free parameters"),
      h("table", { className: "free" },
        h("thead", {}, h("tr", {}, ["Free", "", "Start", "Lower", "Upper", ""].map((text) =>
          h("th", { scope: "col" }, text)))),
        h("tbody", {}, get("parameters").map(freeRow)))));
}

function runRow(run) {
  const role = roleOf(run);
  return h("tr", {},
    h("th", { scope: "row", title: run.name }, breakable(run.name)),
    h("td", {}, run.usable_for_identification
      ? select(ROLES, role, (value) => { choice.roles[run.id] = value; },
        { "aria-label": `Use of ${run.name}` })
      : h("span", { className: "badge", title: `It lacks ${run.missing.join(", ")}.` },
        "not for fitting")));
}

function select(options, value, change, properties) {
  const element = h("select", { ...properties, on: { change: () => change(element.value) } },
    Object.entries(options).map(([key, text]) =>
      h("option", { value: key, selected: key === value }, text)));
  return element;
}

function freeRow(parameter) {
  const { name, display_factor: factor, display_unit: unit } = parameter;
  const start = get("values")[name];
  const free = !choice.fixed.has(name);
  const bounds = choice.bounds[name] ?? defaultBounds(parameter, start);
  const bound = (index, word) => {
    const field = h("input", {
      type: "number", step: "any", disabled: !free, value: units.plain(bounds[index] * factor, 4),
      "aria-label": `${word} bound of ${parameter.label}, ${unit}`,
      on: {
        change: () => {
          const both = [...(choice.bounds[name] ?? bounds)];
          both[index] = Number(field.value) / factor;
          if (field.value === "") delete choice.bounds[name];
          else choice.bounds[name] = both;
          show();
        },
      },
    });
    return field;
  };
  return h("tr", { className: free ? "" : "off" },
    h("td", {}, h("input", {
      type: "checkbox", checked: free, "aria-label": `${parameter.label} is free`,
      on: { change: (event) => {
        if (event.target.checked) choice.fixed.delete(name);
        else choice.fixed.add(name);
        show();
      } },
    })),
    h("th", { scope: "row", title: parameter.label }, symbol(parameter.symbol), " ",
      h("span", { className: "soft long" }, parameter.label)),
    h("td", {}, units.number(start * factor)),
    h("td", {}, bound(0, "Lower")), h("td", {}, bound(1, "Upper")),
    h("td", { className: "unit" }, unit));
}

/** The service's default bounds, shown before the fit; it applies its own when none is changed. */
function defaultBounds(parameter, start) {
  if (parameter.name.endsWith("pivot.angle")) return [-0.3, 1.3];
  if (parameter.name.endsWith("pivot.distance")) return start < 0 ? [-10, -0.1] : [0.1, 10];
  return [0.05 * start, 8 * start];
}

function fit() {
  if (!job) {
    return h("p", { className: "empty" },
      "No fit yet. “Identify” fits the twelve parameters to the runs marked “fit” and takes a " +
      "few seconds.");
  }
  const { result } = job;
  cost = costChart(result ? 92 : 150);
  if (!result) return running();
  return h("div", { className: "fit" },
    h("div", { className: "fit-main scrolls" },
      h("p", { className: `outcome ${job.state}`, id: "outcome" }, outcome()),
      estimates(result),
      result.warnings.length
        ? h("ul", { className: "warnings" }, result.warnings.map((text) => h("li", {}, text)))
        : null),
    h("div", { className: "fit-side scrolls" },
      h("button", { type: "button", id: "apply", className: "primary wide",
        on: { click: () => hooks.apply(result) } }, "Apply to sliders"),
      scores(result),
      h("button", { type: "button", className: "wide", title: "fit.json, also for the command line",
        on: { click: () => saveFile(result, `${fileName(job.runs[0].name)}-fit.json`) } },
        "Save fit"),
      h("h3", {}, "Cost"), cost.element, h("p", { className: "hint", id: "cost-now" })));
}

/** While it runs, or after it was stopped: the curve and the best car so far. */
function running() {
  return h("div", { className: "fit" },
    h("div", { className: "fit-main scrolls" },
      h("p", { className: `outcome ${job.state}`, id: "outcome" }, outcome()),
      job.error ? h("div", { className: "problem", role: "alert" },
        h("strong", {}, "The identification failed"), h("p", {}, job.error.detail)) : null,
      h("h3", {}, "Cost"), cost.element, h("p", { className: "hint", id: "cost-now" })),
    h("div", { className: "fit-side scrolls" }, h("h3", {}, "Best so far"),
      h("table", { className: "best" }, h("tbody", { id: "best" }))));
}

function outcome() {
  if (!job.result) return STATES[job.state];
  const { result } = job;
  return `${result.outcome} ${units.number(result.seconds, 2)} s, ${result.simulations} simulations.`;
}

/** Only numbers and the curve move while the fit runs. */
function advance() {
  if (!job || view !== "fit" || !cost) return;
  const { progress } = job;
  const history = job.result?.cost_history ?? progress?.cost_history ?? [];
  cost.show(history);
  const last = history.at(-1) ?? progress?.cost;
  const simulations = job.result?.simulations ?? progress?.simulations ?? 0;
  $("#best")?.replaceChildren(...Object.entries(progress?.parameters ?? {}).map(([name, value]) => {
    const row = units.parameter(name);
    return h("tr", {}, h("th", { scope: "row", title: row.label }, symbol(row.symbol)),
      h("td", {}, units.number(value * row.display_factor)),
      h("td", { className: "unit" }, row.display_unit));
  }));
  $("#cost-now").textContent = last === undefined || last === null ? "Not started yet."
    : `${units.number(last, 4)} after ${history.length} steps, ${simulations} simulations`;
}

function estimates(result) {
  return h("table", { className: "estimates" },
    h("thead", {}, h("tr", {},
      ["Parameter", "Value", "Unit", "95 % interval", "Start", "Determined"].map((text) =>
        h("th", { scope: "col", className: text === "Start" ? "long" : "" }, text)))),
    h("tbody", {}, result.parameters.map((estimate) => {
      const row = units.parameter(estimate.name);
      const factor = row.display_factor;
      const interval = estimate.confidence_interval;
      return h("tr", {},
        h("th", { scope: "row", title: row.label }, symbol(row.symbol), " ",
          h("span", { className: "soft long" }, row.label)),
        h("td", { className: "strong" }, units.number(estimate.value * factor)),
        h("td", { className: "unit" }, row.display_unit),
        h("td", { className: "span" }, isBounded(interval)
          ? `${units.number(interval[0] * factor, 4)} … ${units.number(interval[1] * factor, 4)}`
          : "unbounded"),
        h("td", { className: "soft long" }, units.number(estimate.start * factor)),
        h("td", {}, h("span", {
          className: `determined ${estimate.determined}`, title: DETERMINED[estimate.determined],
        }, WELL[estimate.determined])));
    })));
}

/** Fit percent of every run, fitted or held out. */
function scores(result) {
  const fitted = job.runs.map((run) => [run.name, "fitted",
    result.fit_percent[run.name] ?? result.fit_percent[run.id]]);
  const names = new Map(get("measurements").map(({ id, name }) => [id, name]));
  const unseen = Object.entries(holdouts).map(([id, score]) =>
    [names.get(id) ?? id, "held out", score]);
  const channels = [...new Set([...fitted, ...unseen].flatMap(([, , score]) =>
    score && typeof score === "object" ? Object.keys(score) : []))];
  return h("table", { className: "scores" },
    h("thead", {}, h("tr", {}, h("th", { scope: "col" }, "Fit, %"),
      channels.map((channel) => h("th", { scope: "col" }, short(channel))))),
    h("tbody", {}, [...fitted, ...unseen].map(([name, role, score]) =>
      h("tr", { className: role === "fitted" ? "" : "held-out" },
        h("th", { scope: "row", title: name }, h("span", { className: "run-name" }, name),
          h("span", { className: "soft" }, ` ${role}`)),
        typeof score === "string"
          ? h("td", { colSpan: channels.length || 1 }, score)
          : channels.map((channel) => h("td", {},
            score ? percent(score[channel]).replace(" %", "") : "…"))))));
}

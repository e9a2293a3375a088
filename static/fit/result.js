// What an identification found, and how far it is while it runs.

import { isOfThisCar } from "../car/controls.js";
import { DETERMINED, mark, WORDS } from "../common/determined.js";
import { $, breakable, capital, counted, fileName, h, saveFile, symbol } from "../common/dom.js";
import { span } from "../common/intervals.js";
import { queued } from "../common/job.js";
import { distinct, nameOf } from "../common/names.js";
import { get } from "../common/store.js";
import * as units from "../common/units.js";
import { worded } from "../common/wording.js";
import { percent, short } from "../ride/comfort.js";
import { costChart } from "./cost.js";
import * as sensors from "./sensors_form.js";
import { combinations, summary } from "./verdict.js";

const STATES = {
  done: "Done",
  failed: "Failed",
  cancelled: "Cancelled",
};

let cost = null;

/**
 * The view of a job, or of none. hooks: apply(result) moves the sliders, verdict() and profile(name)
 * show those, offer(one) applies what the fit offers.
 */
export function view(job, holdouts, hooks) {
  cost = null;
  if (!job) {
    return h("p", { className: "empty" },
      "No fit yet. “Identify” fits the free parameters to the runs marked “fit” and takes a " +
      "few seconds.");
  }
  const { result } = job;
  cost = costChart(result ? 92 : 150);
  if (!result) return running(job);
  return h("div", { className: "fit" },
    h("div", { className: "fit-main scrolls", tabIndex: 0, role: "region",
      "aria-label": "Identified parameters" },
      h("p", { className: `outcome ${job.state}`, id: "outcome" }, outcome(job), " ",
        summary(result, hooks.verdict), " ", toWarnings(result)),
      ofAnotherCar(result),
      estimates(result, hooks.profile),
      combinations(result),
      sensors.found(result, { span, words: WORDS }),
      warnings(result, hooks.offer)),
    h("div", { className: "fit-side scrolls" },
      h("button", { type: "button", id: "apply", className: "primary wide",
        on: { click: () => hooks.apply(result) } }, "Apply to sliders"),
      scores(job, holdouts),
      h("button", { type: "button", className: "wide", title: "fit.json, also for the command line",
        on: { click: () => saveFile(result, `${fileName(job.runs[0].name)}-fit.json`) } },
        "Save fit"),
      h("h3", {}, "Cost"), cost.element, h("p", { className: "hint", id: "cost-now" })));
}

/** While it runs, or after it was stopped: the curve and the best car so far. */
function running(job) {
  return h("div", { className: "fit" },
    h("div", { className: "fit-main scrolls" },
      h("p", { className: `outcome ${job.state}`, id: "outcome" }, outcome(job)),
      h("p", { id: "stage-of-fit" }),
      job.error ? h("div", { className: "problem", role: "alert" },
        h("strong", {}, "The identification failed"), h("p", {}, worded(job.error.detail))) : null,
      h("h3", {}, "Cost"), cost.element, h("p", { className: "hint", id: "cost-now" })),
    h("div", { className: "fit-side scrolls" }, h("h3", {}, "Best so far"),
      h("table", { className: "best" }, h("tbody", { id: "best" }))));
}

function outcome(job) {
  if (job.state === "queued") return queued(job);
  if (job.state === "running" && begun(job)) return `Fitting ${job.runs.map(({ id, name }) => nameOf(id) ?? name).join(", ")} …`;
  if (job.state === "running") return "Starting the fit …";
  if (!job.result) return STATES[job.state];
  return job.result.outcome;
}

/** A fit holds for the known data it was made with: the stiffnesses of one car suit no other. */
function ofAnotherCar(result) {
  if (isOfThisCar(result)) return null;
  const { vehicle } = result;
  const now = get("vehicle");
  return h("p", { className: "worse", id: "other-car" }, vehicle.name === now.name
    ? "Found before the car's known data were changed; identify again."
    : `Found for “${vehicle.name}”, but the sliders belong to “${now.name}”.`);
}

/** In a low window the warnings lie below the table; this leads there. */
function toWarnings({ warnings }) {
  if (!warnings.length) return "";
  return h("button", {
    type: "button", className: "link to-warnings",
    on: { click: () => {
      $("#identification .warnings").lastChild.scrollIntoView({ block: "nearest" });
      $("#identification .warnings").focus({ preventScroll: true });
    } },
  }, `${warnings.length} warning${warnings.length > 1 ? "s" : ""} below`);
}

/** Whether it has told how far it is. */
const begun = ({ progress }) => Object.keys(progress ?? {}).length > 0;

/** Only words, numbers and the curve move while the fit runs. */
export function advance(job) {
  if (!job || !cost?.element.isConnected) return;
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
  if (!job.result) $("#outcome").textContent = outcome(job);
  const stage = $("#stage-of-fit");
  if (stage) stage.textContent = stageOf(job);
  $("#cost-now").textContent = last === undefined || last === null ? ""
    : `${units.number(last, 4)} after ${counted(history.length, "step")}, ${counted(simulations, "simulation")}` +
      (job.result ? `, ${units.number(job.result.seconds, 2)} s` : "");
}

/** Which of its searches a fit from many starts is at, and how long they still take where that is known. */
function stageOf({ state, starts, progress }) {
  if (state !== "running" || !progress?.stage) return "";
  const { stage, search, searches, seconds_left: left } = progress;
  if (stage === "screening") return `Screening ${starts} starts: each is simulated once.`;
  const place = searches > 1 ? `search ${search} of ${searches}` : "";
  if (stage === "reweighing") return `Fitting again with the noise found${place ? `: ${place}` : ""}.`;
  if (!place) return "";
  return `${capital(place)}, from the start values and the best of ${starts} starts` +
    `${left === null ? "" : `; about ${Math.ceil(left)} s left`}.`;
}

/** What is wrong or doubtful, with a button where the fit offers the remedy. */
function warnings({ warnings: said, offers = [] }, apply) {
  if (!said.length && !offers.length) return null;
  return h("ul", { className: "warnings", tabIndex: -1 },
    offers.map((offer) => h("li", { className: "offer" }, h("span", {}, worded(offer.sentence)),
      h("button", { type: "button", on: { click: () => apply(offer) } }, "Apply and fit again"))),
    said.map((text) => h("li", {}, worded(text))));
}

function estimates(result, profile) {
  const columns = [["Parameter"], ["Value"], ["Unit", "unit"], ["95 % interval"], ["Start", "long"],
    ["Searched between", "bounds"], ["Determined"], ["", "action"]];
  return h("table", { className: "estimates" },
    h("thead", {}, h("tr", {}, columns.map(([text, className = ""]) =>
      h("th", { scope: "col", className }, text)))),
    h("tbody", {}, result.parameters.map((one) => estimateRow(one, result, profile))));
}

function estimateRow(estimate, result, profile) {
  const row = units.parameter(estimate.name);
  const shown = (value, digits) => units.number(value * row.display_factor, digits);
  const interval = estimate.confidence_interval;
  const bounds = `${shown(estimate.lower, 3)} … ${shown(estimate.upper, 3)}`;
  const upper = estimate.upper - estimate.value < estimate.value - estimate.lower;
  const searched = `Searched between ${units.withUnit(bounds, row.display_unit)}, from ${shown(estimate.start)}`;
  return h("tr", { title: searched },
    h("th", { scope: "row", title: `${row.label}. ${searched}` }, symbol(row.symbol), " ",
      h("span", { className: "soft long" }, row.label)),
    h("td", { className: "strong" }, shown(estimate.value)),
    h("td", { className: "unit" }, row.display_unit),
    h("td", { className: "span" }, span(interval, row.display_factor)),
    h("td", { className: "soft long" }, shown(estimate.start)),
    h("td", { className: "soft span bounds" }, bounds),
    h("td", {}, estimate.at_bound ? atBound(estimate, upper, searched) : mark(estimate, result)),
    h("td", { className: "action" }, h("button", { type: "button", className: "profile-of",
      "aria-label": `Profile of ${row.label}`, title: "Profile: how the fit gets worse when this one is held elsewhere",
      on: { click: () => profile(estimate.name) } })));
}

function atBound({ determined }, upper, searched) {
  const side = upper ? "upper" : "lower";
  return h("span", { className: `determined ${determined}`,
    title: `At its ${side} bound, so ${DETERMINED[determined]}. ${searched}` }, `at ${side}`);
}

/** Fit percent of every run, fitted or held out, in the channels that the fit compares. */
function scores(job, holdouts) {
  const { result } = job;
  const inFit = distinct(job.runs.map(({ name }) => name));
  const fitted = job.runs.map(({ id, name }, k) =>
    [nameOf(id) ?? name, "fitted", result.fit_percent[inFit[k]]]);
  const unseen = Object.entries(holdouts).map(([id, score]) =>
    [nameOf(id) ?? "deleted", "held out", score]);
  const channels = [...new Set(fitted.flatMap(([, , score]) => Object.keys(score)))];
  return h("table", { className: "scores" },
    h("thead", {}, h("tr", {}, h("th", { scope: "col" }, "Fit, %"),
      channels.map((channel) => h("th", { scope: "col" }, short(channel))))),
    [...fitted, ...unseen].map(([name, role, score]) =>
      h("tbody", { className: role === "fitted" ? "" : "held-out" },
        h("tr", {}, h("th", { scope: "rowgroup", colSpan: channels.length + 1, title: name },
          breakable(name.replace(/\.\w+(?= \(|$)/, "")))),
        h("tr", {}, h("td", { className: "soft" }, role),
          typeof score === "string"
            ? h("td", { className: "said", colSpan: channels.length || 1 }, worded(score))
            : channels.map((channel) => h("td", {},
              score ? percent(score[channel]).replace(" %", "") : "…"))))));
}

// Validation: let the fitted car predict its runs and others, follow the job, show what it found.

import * as api from "../common/api.js";
import { $, h, inPlace } from "../common/dom.js";
import { jobs, queued } from "../common/job.js";
import { nameOf, ofAnotherCar } from "../common/names.js";
import { refused } from "../common/notices.js";
import { get, on } from "../common/store.js";
import { worded } from "../common/wording.js";
import { heldOut, unseen } from "../fit/setup.js";
import { stagesOf } from "../recordings/stages.js";
import { brakingOf } from "../ride/preparation.js";
import * as pivots from "./pivots.js";
import { sections } from "./validation_view.js";

/** The choice of what is kept with the recording. */
const KEPT = "kept";

/** By run, whether it is held out and what was driven, where that was chosen here. */
const held = {};
const told = {};

/** {id, scores} of the last one that is done, with its histories. */
let found = null;
const { now: current, busy, start, resume: takeUp, cancel } =
  jobs("validations", "validation", { changed: show, ended });

export { current };

/** Build the panel. */
export function build() {
  on("fitJob measurements use vehicle", show);
  show();
}

/** Take up the newest validation of a session that is opened again. */
export async function resume() {
  await takeUp();
  if (current() && !busy()) await ended();
  show();
}

/**
 * Recordings of the fit, those that it has not seen, and which of these are held out: unless chosen here,
 * as they are used in the set-up.
 */
function runs() {
  const used = new Set(get("fitJob").runs.map(({ id }) => id));
  const seen = get("measurements").filter(({ id }) => used.has(id));
  const others = unseen(seen);
  const usual = new Set(heldOut(seen, car()));
  return { seen, others, holdOut: others.filter((run) => held[run.id] ?? usual.has(run)) };
}

/** Name of the car that predicts. */
const car = () => get("fit").vehicle.name;

function request() {
  const { seen, holdOut } = runs();
  const ids = holdOut.map(({ id }) => id);
  const chosen = [...seen.map(({ id }) => id), ...ids];
  return {
    identification: get("fitJob").id,
    hold_out: ids,
    manoeuvres: Object.fromEntries(chosen.filter((id) => id in told).map((id) => [id, told[id]])),
    braking: brakingOf(ids),
    geometry: pivots.geometry(),
  };
}

async function ended() {
  if (current().state !== "done") return;
  const { id } = current();
  try {
    found = { id, scores: await api.validationDocument(id) };
  } catch (error) {
    refused(error, "Reading the validation");
  }
}

function show() {
  const panel = $("#validation");
  inPlace(panel, () => panel.replaceChildren(...content().filter(Boolean)), "#validate, #cancel-validation");
}

function content() {
  if (!get("fitJob")) {
    return [h("p", { className: "empty" },
      "No fit yet. Identify the car first; then it can be held against runs that it has not seen.")];
  }
  const { seen, others, holdOut } = runs();
  const job = current();
  const scores = found?.id === job?.id ? found?.scores : null;
  return [
    h("ul", { className: "runs" }, seen.map((run) => runRow(run, h("span", { className: "soft" }, "fitted"))),
      others.map((run) => runRow(run, holding(run, holdOut.includes(run))))),
    get("vehicle").name === car() ? null
      : h("p", { className: "hint", id: "predicts" }, `The fitted car, “${car()}”, predicts, not the one on the sliders.`),
    pivots.view(),
    h("div", { className: "row-tools" },
      busy() ? h("button", { type: "button", id: "cancel-validation", className: "danger", on: { click: cancel } },
        "Cancel")
        : h("button", { type: "button", id: "validate", className: "primary",
          on: { click: () => pivots.ready() && start(request) } }, "Validate"),
      scores ? h("a", { className: "button", id: "report", target: "_blank", rel: "noopener",
        href: api.reportUrl(job.id) }, "Open report") : null,
      h("span", { className: "hint", id: "validation-state" }, state())),
    job?.error ? h("div", { className: "problem", role: "alert" }, h("p", {}, worded(job.error.detail))) : null,
    ...(scores ? sections(scores) : []),
  ];
}

function state() {
  const job = current();
  if (!job) return "A report for print comes with it.";
  if (job.state === "running") return `${job.progress?.predictions ?? 0} of ${job.progress?.of ?? "…"} predictions`;
  if (job.state === "queued") return queued(job);
  return { cancelled: "Cancelled", failed: "Failed", done: "" }[job.state];
}

function runRow(run, role) {
  const manoeuvres = get("manoeuvres").filter(({ kind, given }) => kind !== "posts" && !given);
  const choice = h("select", { "aria-label": `Manoeuvre of ${nameOf(run.id)}`,
    title: "Where the very manoeuvre and road are known, the run is predicted over its road as well",
    on: { change: () => tell(run.id, choice.value) } },
  run.manoeuvre ? h("option", { value: KEPT }, `as told: ${run.manoeuvre.name}`) : null,
  h("option", { value: "", selected: told[run.id] === null }, "manoeuvre not known"),
  manoeuvres.map(({ key, name }) => h("option", { value: key, selected: told[run.id] === key }, name)));
  return h("li", {}, h("span", { className: "run-name", title: nameOf(run.id) }, nameOf(run.id)),
    h("span", { className: "run-use" }, role, choice), remark(run));
}

/** Why a run may say little of the car. */
function remark(run) {
  const signs = stagesOf(run).find(({ state }) => state === "look");
  const said = [ofAnotherCar(run, car()) ? `Recorded with another car: ${run.vehicle}.` : "", signs?.told ?? ""];
  return said.some(Boolean) ? h("p", { className: "doubt" }, said.filter(Boolean).join(" ")) : null;
}

function tell(id, value) {
  if (value === KEPT) delete told[id];
  else told[id] = value || null;
}

function holding(run, checked) {
  const box = h("input", { type: "checkbox", checked, "aria-label": `Hold out ${nameOf(run.id)}`,
    on: { change: () => { held[run.id] = box.checked; } } });
  return h("label", { className: "inline" }, box, "hold out");
}

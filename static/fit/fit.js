// The views of a fit that is done: what was found, what it is worth, and what to drive next.

import { h } from "../common/dom.js";
import * as advice from "./advice.js";
import * as correlation from "./correlation.js";
import * as profile from "./profile.js";
import * as residuals from "./residuals.js";
import * as result from "./result.js";
import * as verdict from "./verdict.js";

const VIEWS = {
  parameters: { title: "Parameters" },
  verdict: { title: "Verdict", view: (job) => verdict.view(job.result) },
  correlation: { title: "Correlation", view: (job) => correlation.view(job.result) },
  residuals: { title: "Residuals", view: residuals.view },
  minima: { title: "Minima", view: residuals.minima },
  profile: { title: "Profile", is: profile.asked, view: profile.view },
  advice: { title: "Next run", is: ({ result: { converged } }) => converged, view: advice.view },
};
let chosen = "parameters";
let show = () => {};

/** `changed()` draws the panel anew. */
export function build(changed) {
  show = changed;
  for (const { build: begin } of [profile, advice]) begin(changed);
}

export function open(key) {
  chosen = key;
  show();
}

const there = (job) => Object.entries(VIEWS).filter(([, { is }]) => !is || is(job));

/** Buttons that choose the view of a fit; none while there is no fit. */
export function tabs(job) {
  if (!job?.result) return [];
  const views = there(job);
  if (!views.some(([key]) => key === chosen)) chosen = "parameters";
  return views.map(([key, { title }]) => h("button", { type: "button", className: "sub", id: `fit-${key}`,
    "aria-pressed": key === chosen, on: { click: () => open(key) } }, title));
}

/** The chosen view; hooks: apply(result), drive(candidate), see(candidate), offer(offer). */
export function view(job, holdouts, hooks) {
  if (!job?.result || chosen === "parameters" || !there(job).some(([key]) => key === chosen)) {
    return result.view(job, holdouts, { ...hooks, verdict: () => open("verdict"),
      profile: (name) => { chosen = "profile"; profile.ask(job, name); show(); } });
  }
  return VIEWS[chosen].view(job, hooks);
}

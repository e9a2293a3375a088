// The profile likelihood of one parameter of a fit: how much worse the fit gets when it is held
// elsewhere and all others are fitted anew.

import * as api from "../common/api.js";
import { h } from "../common/dom.js";
import { symbolOf } from "../common/formula.js";
import { span } from "../common/intervals.js";
import { jobs, queued } from "../common/job.js";
import { refused } from "../common/notices.js";
import { AXIS, COLOURS, fitWidth } from "../common/plots.js";
import * as units from "../common/units.js";
import { worded } from "../common/wording.js";

const HEIGHT = 196;
/** Points on each side at most, as the service has it. */
const POINTS = 32;

/** {identification: {parameter: profile}} of what was found. */
const found = {};
let chosen = null;
/** The identification of the newest question, which may not have been sent yet. */
let about = null;
/** Why the newest question was refused: the refusal, with the fit's id and the parameter. */
let refusal = null;
let show = () => {};
const { now: current, busy, start: send, resume: takeUp, cancel } =
  jobs("profiles", "profile", { changed: () => show(), ended: keep });

export { current };

/** `changed()` draws the view anew. */
export function build(changed) {
  show = changed;
}

/** Profiles of a fit that is taken up again. */
export async function resume(identification) {
  let done = [];
  await takeUp((all) => {
    const own = all.filter((one) => one.identification === identification);
    done = own.filter(({ state }) => state === "done");
    return own.find(({ state }) => !api.isFinal(state));
  });
  for (const { id } of done) keepOne(await api.job("profiles", id));
  chosen = done[0]?.parameter ?? current()?.parameter ?? null;
}

function keepOne({ identification, parameter, result }) {
  found[identification] = { ...found[identification], [parameter]: result };
}

async function keep() {
  if (current().result) keepOne(current());
}

const wasRefused = (fitted, name) => refusal?.identification === fitted.id && refusal.parameter === name;

const isOf = (job) => current()?.identification === job.id;

/** Whether there is anything to look at for a fit. */
export const asked = (job) => Boolean(found[job.id]) || about === job.id || isOf(job);

/** Ask for the profile of a parameter, or show it where it is known. */
export function ask(job, name) {
  [chosen, about, refusal] = [name, job.id, null];
  if (found[job.id]?.[name] || (isOf(job) && busy() && current().parameter === name)) show();
  else if (busy()) refused(Object.assign(new Error("Another profile is under way; wait for it, or cancel it."),
    { code: "busy" }), "The profile");
  else {
    send(() => ({ identification: job.id, parameter: name, key: crypto.randomUUID?.() ?? String(Math.random()).slice(2) }),
      (error) => {
        if (error.code === undefined) throw error;
        refusal = { error, identification: job.id, parameter: name };
      });
  }
}

export function view(job) {
  const known = found[job.id] ?? {};
  const name = known[chosen] || wasRefused(job, chosen) || (isOf(job) && current().parameter === chosen) ? chosen : Object.keys(known)[0] ?? chosen;
  const others = h("div", { className: "profile-others" });
  const profile = known[name];
  return h("div", { className: "fit-two" },
    h("div", { className: "fit-main scrolls" }, choice(job, known, name),
      profile ? drawing(job.result, profile, others) : waiting(job, name)),
    h("div", { className: "fit-side scrolls" }, profile ? others : null));
}

/** All parameters; choosing one whose profile is not there yet asks for it. */
function choice(job, known, name) {
  const select = h("select", { "aria-label": "Profile of", disabled: busy(), on: { change: () => ask(job, select.value) } },
    job.result.parameters.map((one) => h("option", { value: one.name, selected: one.name === name },
      `${units.parameter(one.name).label}${known[one.name] ? "" : " …"}`)));
  return h("div", { className: "row-tools profile-tools" }, select,
    Object.keys(known).length < job.result.parameters.length ? h("span", { className: "hint" }, "… when chosen") : null);
}

/** Under way, cancelled or failed. */
function waiting(fitted, name) {
  const job = current();
  if (busy()) {
    const points = job.progress?.points ?? 0;
    return h("div", { className: "row-tools" },
      h("button", { type: "button", className: "danger", id: "cancel-profile", on: { click: cancel } }, "Cancel profile"),
      h("progress", { max: POINTS, value: points, "aria-label": "Points fitted" }),
      h("span", { className: "hint", role: "status" }, job.state === "queued" ? queued(job)
        : `${units.parameter(job.parameter).label}: ${points} points fitted; each is a fit of all other parameters.`));
  }
  const again = name ? h("button", { type: "button", on: { click: () => ask(fitted, name) } }, "Try again") : null;
  if (wasRefused(fitted, name)) {
    const { message, code } = refusal.error;
    return h("div", { className: "problem", role: "alert" }, h("p", {}, message), code === "deleted" ? null : again);
  }
  const own = isOf(fitted) && job.parameter === name;
  if (own && job.error) return h("div", { className: "problem", role: "alert" }, h("p", {}, job.error.detail), again);
  return h("p", { className: "empty" }, own && job.state === "cancelled" ? "Cancelled. " : "", again);
}

function drawing(result, profile, others) {
  const row = units.parameter(profile.name);
  const { display_factor: factor, display_unit: unit } = row;
  const estimate = result.parameters.find(({ name }) => name === profile.name);
  const box = h("div", { className: "profile-plot" });
  const points = profile.points;
  const steps = h("input", { type: "range", min: 0, max: points.length - 1, step: 1, className: "profile-steps",
    "aria-label": `Held at, ${unit}`, on: { input: () => at(Number(steps.value)) } });
  const at = (i) => {
    steps.value = i;
    steps.setAttribute("aria-valuetext", units.withUnit(units.number(points[i].value * factor), unit));
    others.replaceChildren(...heldAt(points[i], points, row));
  };
  const fitted = points.reduce((best, { distance }, i) => (Math.abs(distance) < Math.abs(points[best].distance) ? i : best), 0);
  setTimeout(() => { if (box.isConnected) draw(box, profile, estimate, row, at); });
  at(fitted);
  return h("div", {},
    h("p", { className: "outcome profile-said" }, symbolOf(profile.name), " 95 %: ",
      h("strong", {}, units.withUnit(span(profile.confidence_interval, factor), unit)),
      h("span", { className: "soft" }, ` by the profile; ${span(estimate.confidence_interval, factor)} by the fit's errors.`)),
    // Profiles of an earlier service have none.
    (profile.sentences ?? []).map((text) => h("p", { className: "hint" }, worded(text))),
    box, steps,
    h("p", { className: "legend-line profile-legend" }, h("span", { className: "key now" }, "profile"),
      h("span", { className: "key reference" }, "if the errors were exactly Gaussian"),
      h("span", { className: "key quantile" }, `± ${units.number(profile.quantile, 3)}, 95 %`)));
}

function draw(box, profile, estimate, { display_factor: factor, display_unit: unit, label }, at) {
  const x = profile.points.map(({ value }) => value * factor);
  const t = profile.points.map(({ distance }) => distance);
  const level = (value) => x.map(() => value);
  const series = (stroke, width, dash = [], points = false) =>
    ({ stroke, width, dash, points: { show: points, size: 6, fill: stroke } });
  const plot = new window.uPlot({
    width: Math.max(box.clientWidth, 200), height: HEIGHT, legend: { show: false }, padding: [8, 14, 0, 0],
    scales: { x: { time: false }, y: { range: (_, low, high) => [Math.min(low, -profile.quantile) - 0.4, Math.max(high, profile.quantile) + 0.4] } },
    axes: [{ ...AXIS, size: 38, gap: 3, label: units.withUnit(label, unit, ", "), labelFont: AXIS.font, labelSize: 14, labelGap: 0 },
      { ...AXIS, size: 46, gap: 4, label: "distance, standard errors", labelFont: AXIS.font, labelSize: 14, labelGap: 0 }],
    cursor: { points: { show: false }, drag: { x: false, y: false }, y: false },
    hooks: { setCursor: [({ cursor }) => { if (cursor.idx !== null && cursor.left >= 0) at(cursor.idx); }] },
    series: [{}, series(COLOURS.now, 1.6, [], true), { ...series(COLOURS.reference, 1.2, [6, 4]), auto: false },
      series(COLOURS.measured, 0.8, [3, 3]), series(COLOURS.measured, 0.8, [3, 3])],
  }, [x, t, gaussian(profile, estimate), level(profile.quantile), level(-profile.quantile)], box);
  plot.root.setAttribute("role", "img");
  plot.root.setAttribute("aria-label", `Profile of ${label}`);
  fitWidth(plot, box);
}

/** The distance by the covariance alone, straight in the search's variable. */
function gaussian({ points, name }, { value, std_error: error }) {
  if (!Number.isFinite(error)) return points.map(() => null);
  const angle = name.endsWith(".angle");
  return points.map((point) => {
    if (angle) return (point.value - value) / error;
    const ratio = point.value / value;
    return ratio > 0 ? Math.log(ratio) / (error / Math.abs(value)) : null;
  });
}

/** What the others do when the parameter is held at a point. */
function heldAt(point, points, { display_factor: factor, display_unit: unit, name }) {
  const fit = points.reduce((best, one) => (Math.abs(one.distance) < Math.abs(best.distance) ? one : best));
  return [
    h("h3", {}, symbolOf(name), ` held at ${units.withUnit(units.number(point.value * factor), unit)}`),
    h("p", { className: "hint" }, `${units.fixed(point.distance, 2)} standard errors from the fit, cost ${units.number(point.cost, 5)}. The others then:`),
    h("table", { className: "best" }, h("tbody", {}, Object.entries(point.others).map(([other, value]) => {
      const row = units.parameter(other);
      const change = 100 * (value - fit.others[other]) / Math.abs(fit.others[other] || 1);
      return h("tr", { title: row.label }, h("th", { scope: "row" }, symbolOf(other)),
        h("td", {}, units.number(value * row.display_factor, 3)),
        h("td", { className: "unit" }, row.display_unit),
        h("td", { className: Math.abs(change) < 1 ? "soft" : "strong" }, `${signed(change)} %`));
    }))),
  ];
}

const signed = (change) => `${change > 0.005 ? "+" : ""}${units.fixed(change, Math.abs(change) < 10 ? 1 : 0)}`;

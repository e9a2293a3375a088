// The sliders, made from the service's table of parameters.
//
// The truth is `values` of the store (SI); a slider shows it, clamped to its range. On each track
// lie the baseline (a tick) and, after a fit, the 95 % interval of the identified value (a band).

import { condition, DETERMINED } from "../common/determined.js";
import { $, capital, h, symbol } from "../common/dom.js";
import { isKnown, span } from "../common/intervals.js";
import { notice } from "../common/notices.js";
import { get, on, set } from "../common/store.js";
import * as units from "../common/units.js";

const GROUPS = { front: "Front axle", rear: "Rear axle" };
const THUMB = 14;
const rows = new Map();
let twoSlope = null;
/** The number that was typed last, until a car with it has been simulated: {parameter, before}. */
let entered = null;

export const valueAt = (vehicle, path) => path.split(".").reduce((part, key) => part[key], vehicle);

/** Whether the slider of an estimate is where the fit put it. */
export const holds = ({ name, value }) =>
  Math.abs(get("values")[name] - value) <= 1e-6 * Math.abs(value);

/** The vehicle with the given {path: value} in it. */
export function withValues(vehicle, values) {
  const copy = structuredClone(vehicle);
  for (const [path, value] of Object.entries(values)) {
    const keys = path.split(".");
    const last = keys.pop();
    keys.reduce((part, key) => part[key], copy)[last] = value;
  }
  return copy;
}

/** Whether the dampers of an axle keep one slope in jounce and rebound, at every speed. */
const isLinear = ({ suspension }) =>
  (suspension.rebound_ratio ?? 1) === 1 && suspension.knee_speed === undefined;

/** {path: value} of the parameters in a vehicle; linear dampers have none of those of bent ones. */
export const valuesOf = (vehicle) => Object.fromEntries(get("parameters")
  .filter(({ name, linear_start }) => linear_start === null || !isLinear(vehicle[name.split(".")[0]]))
  .map(({ name }) => [name, valueAt(vehicle, name)])
  .filter(([, value]) => value !== undefined));

/** Whether a parameter is one of two-slope dampers. */
export const ofBentDamper = ({ linear_start }) => linear_start !== null;

const bent = () => get("parameters").some((row) => ofBentDamper(row) && row.name in get("values"));

/** The vehicle with linear dampers. */
export function straightened(vehicle) {
  const copy = structuredClone(vehicle);
  for (const side of Object.keys(GROUPS)) {
    copy[side].suspension.rebound_ratio = 1;
    delete copy[side].suspension.knee_speed;
  }
  return copy;
}

/** Whether a fit was made with the known data of the sliders' car: its errors suit no other. */
export function isOfThisCar(fit) {
  if (!fit) return false;
  const now = get("vehicle");
  const known = (car) => JSON.stringify(
    { ...straightened(withValues(car, valuesOf(now))), name: "", source: "" });
  return known(fit.vehicle) === known(now);
}

/** Give the sliders' car dampers with two slopes and a knee, or linear ones. */
function bend(wanted) {
  const rows = get("parameters").filter(ofBentDamper);
  const values = { ...get("values") };
  for (const { name, linear_start } of rows) {
    if (wanted) values[name] ??= linear_start;
    else delete values[name];
  }
  set(wanted ? { values } : { vehicle: straightened(get("vehicle")), values });
}

/** Every slider back to the baseline, whose dampers may be linear. */
function resetAll() {
  const values = valuesOf(get("baseline"));
  const linear = !get("parameters").some((row) => ofBentDamper(row) && row.name in values);
  set(linear ? { vehicle: straightened(get("vehicle")), values } : { values });
}

/** Build the panel once the table is here. */
export function build({ onBaseline }) {
  const panel = $("#parameters");
  panel.append(
    h("div", { className: "panel-head" },
      h("h2", {}, "Parameters"),
      h("button", {
        type: "button", id: "reset-all", title: "Every slider back to the baseline",
        on: { click: resetAll },
      }, "Reset"),
      h("button", {
        type: "button", id: "set-baseline",
        title: "Take the sliders' values as the baseline to compare with",
        on: { click: onBaseline },
      }, "Set baseline")),
  );
  for (const [side, title] of Object.entries(GROUPS)) {
    const group = h("fieldset", {}, h("legend", {}, title));
    for (const parameter of get("parameters")) {
      if (parameter.name.startsWith(`${side}.`)) group.append(row(parameter, side));
    }
    panel.append(group);
  }
  twoSlope = h("input", { type: "checkbox", id: "bent", on: { change: () => bend(twoSlope.checked) } });
  panel.append(
    h("label", { className: "inline", title: "Give the car dampers with another slope in rebound than in jounce, and " +
      "a speed at which the force has fallen to half; or linear ones" }, twoSlope, " Two-slope dampers"),
    h("p", { className: "track-legend" },
      h("span", { className: "mark-baseline" }, "baseline"),
      h("span", { className: "mark-interval" }, "95 % interval of the fit")),
    h("p", { className: "track-legend", id: "interval-legend", hidden: true },
      Object.entries(DETERMINED).map(([verdict, text]) =>
        h("span", { className: `mark-interval ${verdict}` }, text.replace(" determined", "")))),
    h("p", { className: "track-legend", id: "outside-legend", hidden: true },
      h("span", { className: "mark-outside" }, "number beyond its slider")),
  );
  on("values baseline fit vehicle", show);
  on("now trouble", judge);
  show();
}

function row(parameter, side) {
  const { name, display_factor: factor, display_unit: unit } = parameter;
  const label = plainLabel(parameter, side);
  const id = name.replaceAll(".", "-");
  const lower = parameter.slider_lower * factor;
  const upper = parameter.slider_upper * factor;
  const step = Number((parameter.step * factor).toPrecision(3));
  const change = (shown) => {
    if (Number.isFinite(shown)) set({ values: { ...get("values"), [name]: shown / factor } });
  };
  const before = { value: 0 };
  const isAccepted = (shown) => shown >= parameter.lower * factor &&
    shown <= parameter.upper * factor && Math.abs(shown) >= parameter.apart * factor;
  const typed = () => {
    if (field.value !== "" && isAccepted(Number(field.value))) change(Number(field.value));
  };
  const left = () => {
    const typo = field.validity.badInput || (field.value !== "" && !isAccepted(Number(field.value)));
    if (typo) refuse(parameter, before.value, unaccepted(parameter, field.value));
    else if (get("values")[name] !== before.value) {
      entered = { parameter, before: before.value };
      judge();
    }
    field.value = units.short(get("values")[name] * factor);
    before.value = get("values")[name];
  };
  /** Arrows move by the slider's step, as far as a car goes; Escape gives up what was typed. */
  const keys = (event) => {
    const at = get("values")[name] * factor;
    const steps = { ArrowUp: 1, ArrowDown: -1 }[event.key];
    const typing = get("values")[name] !== before.value || field.value !== units.short(at);
    if (!steps && !(event.key === "Escape" && typing)) return;
    event.preventDefault();
    const next = steps ? Math.round(at / step + steps) * step : before.value * factor;
    if (isAccepted(next)) change(next);
    field.value = units.short(get("values")[name] * factor);
  };
  const slider = h("input", {
    type: "range", id: `slider-${id}`, min: lower, max: upper, step: "any",
    "aria-label": units.withUnit(parameter.label, unit, ", "),
    on: {
      input: () => {
        const raw = Number(slider.value);
        change(raw <= lower || raw >= upper ? raw : Math.round(raw / step) * step);
      },
      keydown: (event) => nudge(event, slider, step, lower, upper, change),
    },
  });
  const field = h("input", {
    type: "number", id: `value-${id}`, step: "any", inputMode: "decimal",
    on: {
      focus: () => { before.value = get("values")[name]; },
      input: typed,
      change: left,
      blur: show,
      keydown: keys,
    },
  });
  const parts = {
    parameter, slider, field, lower, upper,
    baseline: h("span", { className: "tick" }),
    interval: h("span", { className: "interval" }),
    spread: h("span", { className: "spread" }),
    reset: h("button", {
      type: "button", className: "reset", "aria-label": `Reset ${parameter.label}`,
      on: {
        click: () =>
          set({ values: { ...get("values"), [name]: valueAt(get("baseline"), name) } }),
      },
    }, "↺"),
  };
  rows.set(name, parts);
  parts.element = h("div", { className: "parameter", dataset: { name } },
    h("label", { htmlFor: field.id, title: titleOf(parameter) }, symbol(parameter.symbol), " ", label),
    field, h("span", { className: "unit" }, unit),
    h("div", { className: "track" }, parts.interval, slider, parts.baseline),
    h("div", { className: "after" }, parts.spread, parts.reset));
  return parts.element;
}

/** A typed number that is not taken: the value from before the typing comes back. */
function refuse({ name, label, display_factor: factor, display_unit: unit }, before, why) {
  set({ values: { ...get("values"), [name]: before } });
  rows.get(name).field.value = units.short(before * factor);
  notice("warning", `${label} stays ${units.withUnit(units.plain(before * factor), unit)}`, why);
}

/** Why a number that no car can have is not taken; what is no number at all has no text. */
function unaccepted({ lower, upper, apart, display_factor: factor, display_unit: unit }, text) {
  const range = (from, to) =>
    units.withUnit(`${units.plain(from * factor)} to ${units.plain(to * factor)}`, unit);
  const said = text ? `${units.withUnit(text, unit)} is not accepted` : "What was typed is no number";
  return apart ? `${said}; give ${range(apart, upper)} or ${range(lower, -apart)}.`
    : `${said}; give ${range(lower, upper)}.`;
}

/** What the service says of the car with the number typed last: one it refuses is undone. */
function judge() {
  if (!entered) return;
  const { parameter, before } = entered;
  const [trouble, vehicle, values] = [get("trouble"), get("vehicleNow"), get("values")];
  const refused = trouble?.values === values;
  const simulated = vehicle && valueAt(vehicle, parameter.name) === values[parameter.name];
  if (!refused && !simulated) return;
  entered = null;
  if (refused && trouble.code === "vehicle") refuse(parameter, before, trouble.message);
  else tellBeyond(parameter);
}

/** A typed number beyond the slider is taken, since cars differ, but not without a word. */
function tellBeyond(parameter) {
  const { name, label, display_factor: factor, display_unit: unit } = parameter;
  const { slider_lower: from, slider_upper: to } = parameter;
  const value = get("values")[name];
  if (value >= from && value <= to) return;
  const [shown, lower, upper] = [value, from, to].map((x) => units.plain(x * factor));
  notice("warning", `${label} is now ${units.withUnit(shown, unit)}`,
    `That is beyond its slider, ${units.withUnit(`${lower} to ${upper}`, unit)}; the arrow beside it ` +
    "brings the baseline back.");
}

/** The whole label, and what it leaves open. */
export const titleOf = ({ label, meaning }) => (meaning ? `${label}: ${meaning}` : label);

/** "Front stabilizer bar stiffness" under "Front axle" is "Bar stiffness"; the title says it all. */
function plainLabel(parameter, side) {
  const text = parameter.label.replace(new RegExp(`^${side}\\s+|,?\\s*${side}$`, "i"), "");
  return capital(text.replace("stabilizer bar", "bar"));
}

function nudge(event, slider, step, lower, upper, change) {
  const steps = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: 10,
    PageDown: -10 }[event.key];
  if (!steps) return;
  event.preventDefault();
  event.stopPropagation();
  const shown = Math.round(Number(slider.value) / step) * step + steps * step;
  change(Math.min(Math.max(shown, lower), upper));
}

function show() {
  const values = get("values");
  const baseline = get("baseline");
  twoSlope.checked = bent();
  const fit = isOfThisCar(get("fit")) ? get("fit") : null;
  const estimates = new Map((fit?.parameters ?? []).map((p) => [p.name, p]));
  let changed = 0;
  let beyond = 0;
  for (const [name, parts] of rows) {
    const { parameter, slider, field, lower, upper } = parts;
    parts.element.hidden = !(name in values);
    if (parts.element.hidden) continue;
    const factor = parameter.display_factor;
    const shown = values[name] * factor;
    const compared = valueAt(baseline, name);
    const start = (compared ?? values[name]) * factor;
    const at = (x) => {
      const share = Math.min(Math.max((x - lower) / (upper - lower), 0), 1);
      return `calc(${THUMB / 2}px + ${share} * (100% - ${THUMB}px))`;
    };
    slider.value = shown;
    const said = (text) => units.withUnit(text, parameter.display_unit);
    slider.setAttribute("aria-valuetext", said(units.number(shown)));
    if (document.activeElement !== field) field.value = units.short(shown);
    const outside = shown < lower || shown > upper;
    beyond += outside;
    field.title = outside
      ? said(`Beyond the slider, which goes from ${units.number(lower)} to ${units.number(upper)}`)
      : "";
    const moved = Math.abs(shown - start) > 1e-9 * Math.max(1, Math.abs(start));
    changed += moved;
    parts.element.classList.toggle("moved", moved);
    parts.element.classList.toggle("outside", outside);
    parts.reset.title = said(`Back to the baseline, ${units.number(start)}`);
    parts.reset.disabled = !moved;
    parts.baseline.style.left = at(start);
    parts.baseline.hidden = compared === undefined;
    band(parts, estimates.get(name), factor, at, shown);
  }
  $("#interval-legend").hidden = estimates.size === 0;
  $("#outside-legend").hidden = beyond === 0;
  const same = changed === 0 && Object.keys(valuesOf(baseline)).length === Object.keys(values).length;
  $("#reset-all").disabled = same;
  $("#set-baseline").disabled = same;
}

/**
 * The fit's interval on the track, as far as the track goes where an end is open; beside it ± where
 * the slider holds the fit, else its value.
 */
function band(parts, estimate, factor, at, shown) {
  const { interval, spread, parameter, lower, upper } = parts;
  const said = estimate?.confidence_interval;
  interval.hidden = !isKnown(said);
  if (interval.hidden) {
    spread.textContent = estimate ? "± ∞" : "";
    spread.className = "spread no";
    spread.title = estimate ? "The runs say nothing about this parameter" : "";
    return;
  }
  const open = said.map((end) => !Number.isFinite(end));
  const [low, high] = said.map((end, side) => (open[side] ? [lower, upper][side] : end * factor));
  interval.style.left = at(low);
  interval.style.right = `calc(100% - ${at(high).slice(4)}`;
  interval.className = `interval ${estimate.determined}`;
  const held = condition(estimate.name, get("fit"));
  interval.classList.toggle("open-below", open[0]);
  interval.classList.toggle("open-above", open[1]);
  const half = (high - low) / 2;
  const value = estimate.value * factor;
  spread.textContent = !holds(estimate) ? `fit ${units.number(value, 3)}`
    : open[0] ? `≤ ${units.number(high)}`
      : open[1] ? `≥ ${units.number(low)}`
        : half > Math.abs(value) ? "± >100 %" : `± ${units.number(half, 2)}`;
  spread.className = `spread ${estimate.determined}${held ? " conditional" : ""}`;
  spread.title =
    `Identified ${units.withUnit(units.number(value), parameter.display_unit)}, 95 % interval ` +
    `${span(said, factor)}; ${DETERMINED[estimate.determined]}${held ? `, ${held}` : ""}`;
}

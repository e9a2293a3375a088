// Which parameters an identification is free to move, from where and between which bounds.

import { damperNames, holdDampers } from "../car/car.js";
import { holds, ofBentDamper, titleOf } from "../car/controls.js";
import * as api from "../common/api.js";
import { h, symbol } from "../common/dom.js";
import { get, on, set } from "../common/store.js";
import * as units from "../common/units.js";
import * as priors from "./priors.js";
import * as sensors from "./sensors_form.js";

const COLUMNS = ["Free", "Parameter", "Start", "Lower", "Upper", "Unit"];
/** What brings each row up to date with sliders and bounds. */
let rows = [];
let note = null;
let body = null;
let bentDampers = null;
let known = null;

/** Keep the table's numbers in step with sliders and default bounds. */
export function build() {
  on("values defaultBounds fit fixed bounds", () => { if (note) show(); });
  on("fixed", () => { if (note) knowns(); });
}

const knowns = () => known.replaceChildren(priors.view(shown().map(({ name }) => name), isFree));

function show() {
  if (body.childElementCount !== shown().length) fill();
  rows.forEach((update) => update());
  bentDampers.checked = damperNames().some(isFree);
  const held = names().some(heldBounds);
  note.textContent = held ? "start at the sliders; yellow: bounds of the applied fit"
    : "start at the sliders; bounds not typed follow";
  note.title = held ? "An applied value that ended at a bound keeps the bounds of its fit; following " +
    "the start, they would let it run on with every fit. Type others, or fix the parameter." : "";
}

/** The table's rows. */
function fill() {
  const within = body.contains(document.activeElement);
  rows = [];
  body.replaceChildren(...shown().map(freeRow));
  if (within) bentDampers.focus({ preventScroll: true });
  knowns();
}

/** Parameters that the sliders' car has, and those of two-slope dampers where any of them is to be found. */
function shown() {
  const sought = damperNames().some(isFree);
  return get("parameters").filter((row) => row.name in get("values") || (sought && ofBentDamper(row)));
}

/** Where the search begins: at the sliders, for two-slope dampers that the car has not where they are usual. */
const starts = () => ({
  ...Object.fromEntries(get("parameters").filter(ofBentDamper).map(({ name, linear_start: start }) => [name, start])),
  ...get("values"),
});

function dampers() {
  bentDampers = h("input", {
    type: "checkbox", id: "two-slope", on: { change: () => {
      if (bentDampers.checked) set({ fixed: get("fixed").filter((name) => !damperNames().includes(name)) });
      else holdDampers();
    } },
  });
  return h("label", {
    className: "inline", title: "Another slope in rebound than in jounce, and a speed at which the " +
      "force has fallen to half: four more parameters to find. The car on show stays as it is until the " +
      "fit is applied; where it has such dampers, they are known until they are freed.",
  }, bentDampers, " Find two-slope dampers");
}

export function view() {
  askBounds();
  note = h("span", { className: "hint plain", id: "free-note" });
  body = h("tbody");
  known = h("div");
  const section = h("section", {},
    h("h3", {}, "Free parameters ", note),
    dampers(),
    h("table", { className: "free" },
      h("thead", {}, h("tr", {}, COLUMNS.map((text) =>
        h("th", { scope: "col", className: text === "Unit" ? "unit" : "" }, text)))),
      body),
    h("p", { className: "hint" }, h("span", { className: "mark-own" }, "typed"), " ",
      h("span", { className: "mark-outside" }, "from the applied fit")),
    sensors.view(),
    known);
  show();
  return section;
}

/** Names of the free parameters. */
export const names = () =>
  shown().map(({ name }) => name).filter(isFree);

const isFree = (name) => !get("fixed").includes(name);

/** {name: [lower, upper]} of the free parameters whose bounds are not the default. */
export async function bounds() {
  await askBounds();
  return Object.fromEntries(names()
    .filter((name) => heldBounds(name) || get("bounds")[name]?.some((bound) => bound !== null))
    .map((name) => [name, boundsOf(name)]));
}

let asking = null;
/** Default bounds for the sliders as they are, from the service; one question at a time. */
export function askBounds() {
  asking ??= (async () => {
    while (get("defaultBounds")?.start !== get("values")) {
      const start = get("values");
      set({ defaultBounds: { start, bounds: await api.defaultBounds(starts()) } });
    }
  })().catch((error) => {
    if (!error.lost) throw error;
    set({ online: false });
  }).finally(() => { asking = null; });
  return asking;
}

function freeRow(parameter) {
  const { name, display_factor: factor, display_unit: unit } = parameter;
  const free = h("input", {
    type: "checkbox", "aria-label": `${parameter.label} is free`,
    on: { change: () => {
      const others = get("fixed").filter((one) => one !== name);
      set({ fixed: free.checked ? others : [...others, name] });
    } },
  });
  const fields = ["Lower", "Upper"].map((word, side) => {
    const field = h("input", {
      type: "number", step: "any", "aria-label": units.withUnit(`${word} bound of ${parameter.label}`, unit, ", "),
      on: { change: () => {
        const both = [...get("bounds")[name] ?? [null, null]];
        both[side] = field.value === "" ? null : Number(field.value) / factor;
        set({ bounds: { ...get("bounds"), [name]: both } });
        update({ typing: false });
      } },
    });
    return field;
  });
  const begins = h("td");
  const row = h("tr", {},
    h("td", {}, free),
    h("th", { scope: "row", title: titleOf(parameter) }, symbol(parameter.symbol), " ",
      h("span", { className: "soft long" }, parameter.label)),
    begins, fields.map((field) => h("td", {}, field)),
    h("td", { className: "unit" }, unit));
  const update = ({ typing = true } = {}) => {
    const start = starts()[name];
    const both = boundsOf(name);
    const held = heldBounds(name);
    const usual = usualBounds(name);
    free.checked = isFree(name);
    fields.forEach((field, side) => {
      const own = (get("bounds")[name]?.[side] ?? null) !== null;
      if (!typing || field !== document.activeElement) field.value = units.short(both[side] * factor);
      field.disabled = !free.checked;
      field.classList.toggle("own", own);
      field.classList.toggle("held", Boolean(held) && !own);
      field.title = own
        ? units.withUnit(`Typed; empty the field for ${units.number(usual[side] * factor)}`, unit)
        : held ? "From the applied fit, which ended at a bound; type another to search further"
          : `Default, ${parameter.bounds_rule}; type a bound to hold it`;
    });
    const doubt = doubtOf(start, both);
    begins.textContent = units.number(start * factor);
    begins.className = doubt && free.checked ? "worse" : "";
    begins.title = doubt;
    row.className = free.checked ? "" : "off";
  };
  rows.push(update);
  return row;
}

/** Why a search cannot begin at a start, or nothing. */
function doubtOf(start, [lower, upper]) {
  if (!get("defaultBounds")) return "";
  if (Number.isNaN(lower + upper)) {
    return "No default bounds follow from this start: type both, fix it or move the slider";
  }
  return start >= lower && start <= upper ? ""
    : "The start lies outside its bounds: move the slider or a bound";
}

/** Between which values a parameter is searched, SI: as typed, else as usual. */
function boundsOf(name) {
  return usualBounds(name).map((value, side) => get("bounds")[name]?.[side] ?? value);
}

/** Bounds where none is typed; NaN until the service has told them, and where none follow. */
const usualBounds = (name) =>
  heldBounds(name) ?? get("defaultBounds")?.bounds[name] ?? [NaN, NaN];

/**
 * The bounds of the applied fit, for a parameter that ended at one of them and was not moved since.
 * Defaults would follow it eightfold beyond, fit after fit, wherever the runs do not hold it.
 */
function heldBounds(name) {
  const estimate = get("fit")?.parameters.find((found) => found.name === name);
  return estimate?.at_bound && holds(estimate) ? [estimate.lower, estimate.upper] : null;
}

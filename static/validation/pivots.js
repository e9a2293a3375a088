// Where the pivots lie by drawing or bench, typed to be held against where a fit puts them.

import { h } from "../common/dom.js";
import { symbolOf } from "../common/formula.js";
import * as units from "../common/units.js";

const AXLES = { front: "Front", rear: "Rear" };
const NUMBERS = ["distance", "angle"];
/** Typed numbers by parameter, SI; none where a field is empty. */
const typed = {};
let fields = [];

export function view() {
  fields = [];
  return h("div", { className: "pivots", role: "group", "aria-label": "Pivots by geometry",
    title: "Where the pivots lie by drawing or bench, to stand beside the identified ones; empty: not given" },
  h("span", { className: "soft" }, "Pivots by geometry"),
  Object.entries(AXLES).map(([axle, word]) => h("span", { className: "pivot" }, word,
    NUMBERS.flatMap((number) => field(`${axle}.pivot.${number}`, axle)))));
}

/** {axle: {distance, angle}} in SI of the axles that are given, else null. */
export function geometry() {
  const given = Object.keys(AXLES).filter((axle) => `${axle}.pivot.distance` in typed);
  if (!given.length) return null;
  return Object.fromEntries(given.map((axle) => [axle,
    Object.fromEntries(NUMBERS.map((number) => [number, typed[`${axle}.pivot.${number}`]]))]));
}

/** Whether all that is typed can be used; the browser tells of a field that cannot. */
export function ready() {
  for (const { input, name, axle } of fields) {
    const others = NUMBERS.some((number) => `${axle}.pivot.${number}` in typed);
    input.setCustomValidity(others && !(name in typed) && !input.validity.badInput
      ? `Give distance and angle of the ${axle} pivot, or neither.` : "");
  }
  return fields.every(({ input }) => input.reportValidity());
}

/** One number with its unit, between what a vehicle accepts. */
function field(name, axle) {
  const { label, display_factor: factor, display_unit: unit, lower, upper } = units.parameter(name);
  const input = h("input", {
    type: "number", step: "any", min: units.plain(lower * factor), max: units.plain(upper * factor),
    value: name in typed ? units.plain(typed[name] * factor) : "",
    "aria-label": `${label} by geometry, ${unit}; empty for not given`,
    on: { input: () => {
      input.setCustomValidity("");
      if (input.value === "") delete typed[name];
      else typed[name] = Number(input.value) / factor;
    } },
  });
  fields.push({ input, name, axle });
  return [symbolOf(name), input, h("span", { className: "unit" }, unit)];
}

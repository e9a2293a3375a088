// What an identification is told: which runs, which parameters are free, between which bounds.

import { breakable, h, symbol } from "./dom.js";
import { nameOf } from "./names.js";
import * as preparation from "./preparation.js";
import { get } from "./store.js";
import * as units from "./units.js";

const ROLES = { fit: "fit", holdout: "hold out", no: "leave out" };
/** What is chosen: the role of each run, fixed parameters, typed bounds as {name: [SI or null]}. */
export const choice = { roles: {}, fixed: new Set(), bounds: {} };

/** How a run is used: unless chosen, the ride on show (or the first) is fitted, others held out. */
function roleOf(run) {
  if (!run.usable_for_identification) return "no";
  if (choice.roles[run.id]) return choice.roles[run.id];
  const usable = get("measurements").filter((m) => m.usable_for_identification);
  const { kind, id } = get("ride");
  const shown = usable.find((m) => kind === "measurement" && m.id === id) ?? usable[0];
  return run === shown ? "fit" : "holdout";
}

export const runsAs = (role) => get("measurements").filter((run) => roleOf(run) === role);

/** {name: [lower, upper]} of the parameters of which a bound is typed. */
export const bounds = () => Object.fromEntries(get("parameters")
  .filter(({ name }) => choice.bounds[name]?.some((typed) => typed !== null))
  .map((parameter) => [parameter.name, boundsOf(parameter)]));

export function view() {
  const runs = get("measurements");
  return h("div", { className: "setup scrolls" },
    h("section", {},
      h("h3", {}, "Runs"),
      runs.length
        ? h("ul", { className: "runs" }, runs.map(runRow))
        : h("p", { className: "empty" }, "No measurement yet; add one under Measurements."),
      h("p", { className: "hint" },
        "Unless you choose, the ride on show is fitted. A run held out is not: it shows how well " +
        "the car predicts what it has not seen."),
      preparation.view()),
    h("section", {},
      h("h3", {}, "Free parameters ", h("span", { className: "hint plain" },
        "start at the sliders; bounds not typed follow")),
      h("table", { className: "free" },
        h("thead", {}, h("tr", {}, ["Free", "Parameter", "Start", "Lower", "Upper", "Unit"].map((text) =>
          h("th", { scope: "col", className: text === "Unit" ? "unit" : "" }, text)))),
        h("tbody", {}, get("parameters").map(freeRow)))));
}

function runRow(run) {
  const role = roleOf(run);
  return h("li", {},
    h("span", { className: "run-name", title: nameOf(run.id) }, breakable(nameOf(run.id))),
    run.usable_for_identification
      ? h("span", { className: "run-use" },
          select(ROLES, role, (value) => { choice.roles[run.id] = value; },
            { "aria-label": `Use of ${nameOf(run.id)}` }),
          h("label", {}, "brakes", preparation.brakingField(run)))
      : h("span", { className: "badge", title: `It lacks ${run.missing.join(", ")}.` },
        "not for fitting"));
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
  const free = h("input", {
    type: "checkbox", checked: !choice.fixed.has(name), "aria-label": `${parameter.label} is free`,
    on: { change: () => {
      if (free.checked) choice.fixed.delete(name);
      else choice.fixed.add(name);
      show();
    } },
  });
  const fields = ["Lower", "Upper"].map((word, side) => {
    const field = h("input", {
      type: "number", step: "any", "aria-label": `${word} bound of ${parameter.label}, ${unit}`,
      on: { change: () => {
        const typed = [...(choice.bounds[name] ?? [null, null])];
        typed[side] = field.value === "" ? null : Number(field.value) / factor;
        choice.bounds[name] = typed;
        show();
      } },
    });
    return field;
  });
  const begins = h("td", {}, units.number(start * factor));
  const row = h("tr", {},
    h("td", {}, free),
    h("th", { scope: "row", title: parameter.label }, symbol(parameter.symbol), " ",
      h("span", { className: "soft long" }, parameter.label)),
    begins, fields.map((field) => h("td", {}, field)),
    h("td", { className: "unit" }, unit));
  const show = () => {
    const both = boundsOf(parameter);
    const usual = defaultBounds(parameter, start);
    fields.forEach((field, side) => {
      const own = (choice.bounds[name]?.[side] ?? null) !== null;
      field.value = units.short(both[side] * factor);
      field.disabled = !free.checked;
      field.classList.toggle("own", own);
      field.title = own
        ? `Typed; empty the field for the default, ${units.number(usual[side] * factor)} ${unit}`
        : `${defaultRule(parameter)}; type a bound to hold it`;
    });
    const within = start >= both[0] && start <= both[1];
    begins.className = within || !free.checked ? "" : "more";
    begins.title = within ? "" : "The start lies outside its bounds: move the slider or a bound";
    row.className = free.checked ? "" : "off";
  };
  show();
  return row;
}

/** Between which values a parameter is searched, SI: as typed, else by default. */
function boundsOf(parameter) {
  const usual = defaultBounds(parameter, get("values")[parameter.name]);
  return usual.map((value, side) => choice.bounds[parameter.name]?.[side] ?? value);
}

const defaultRule = ({ name }) =>
  name.includes(".pivot.") ? "The same for every car" : "0.05 to 8 times the start";

/** The service's default bounds, shown before the fit; it applies its own when none is changed. */
function defaultBounds(parameter, start) {
  const [lower, upper] = parameter.name.endsWith("pivot.angle") ? [-0.3, 1.3]
    : parameter.name.endsWith("pivot.distance") ? (start < 0 ? [-10, -0.1] : [0.1, 10])
      : [0.05 * start, 8 * start];
  return [Math.max(lower, parameter.lower), Math.min(upper, parameter.upper)];
}

// What an identification is told: which runs, which parameters are free, between which bounds.

import { breakable, h, symbol } from "./dom.js";
import * as preparation from "./preparation.js";
import { get } from "./store.js";
import * as units from "./units.js";

const ROLES = { fit: "fit", holdout: "hold out", no: "leave out" };
/** What is chosen: the role of each run, free parameters, bounds that differ from the default. */
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

/** The set-up view; `redraw` shows it again after a choice that changes it. */
export function view(redraw) {
  const runs = get("measurements");
  return h("div", { className: "setup scrolls" },
    h("section", {},
      h("h3", {}, "Runs"),
      runs.length
        ? h("ul", { className: "runs" }, runs.map((run) => runRow(run, redraw)))
        : h("p", { className: "empty" }, "No measurement yet; add one under Measurements."),
      h("p", { className: "hint" },
        "Unless you choose, the ride on show is fitted. A run held out is not: it shows how well " +
        "the car predicts what it has not seen."),
      preparation.view(redraw)),
    h("section", {},
      h("h3", {}, "Free parameters"),
      h("table", { className: "free" },
        h("thead", {}, h("tr", {}, ["Free", "Parameter", "Start", "Lower", "Upper", "Unit"].map((text) =>
          h("th", { scope: "col" }, text)))),
        h("tbody", {}, get("parameters").map((parameter) => freeRow(parameter, redraw)))),
      h("p", { className: "hint" },
        "The fit starts from the sliders and searches between the bounds. Bounds you do not type " +
        "follow the start: 0.05 to 8 times a stiffness or damping.")));
}

function runRow(run, redraw) {
  const role = roleOf(run);
  return h("li", {},
    h("span", { className: "run-name", title: run.name }, breakable(run.name)),
    run.usable_for_identification
      ? h("span", { className: "run-use" },
          select(ROLES, role, (value) => { choice.roles[run.id] = value; },
            { "aria-label": `Use of ${run.name}` }),
          h("label", {}, "brakes", preparation.brakingField(run, redraw)))
      : h("span", { className: "badge", title: `It lacks ${run.missing.join(", ")}.` },
        "not for fitting"));
}

function select(options, value, change, properties) {
  const element = h("select", { ...properties, on: { change: () => change(element.value) } },
    Object.entries(options).map(([key, text]) =>
      h("option", { value: key, selected: key === value }, text)));
  return element;
}

function freeRow(parameter, redraw) {
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
          redraw();
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
        redraw();
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
  const [lower, upper] = parameter.name.endsWith("pivot.angle") ? [-0.3, 1.3]
    : parameter.name.endsWith("pivot.distance") ? (start < 0 ? [-10, -0.1] : [0.1, 10])
      : [0.05 * start, 8 * start];
  return [Math.max(lower, parameter.lower), Math.min(upper, parameter.upper)];
}

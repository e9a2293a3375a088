// What an identification is told: how each run is used, and how recordings drive the model.

import { breakable, h } from "../common/dom.js";
import { dataOf, drivenBy, lacks, nameOf, ofAnotherCar, ofAnotherPlant, original } from "../common/names.js";
import { get, set } from "../common/store.js";
import * as noise from "../recordings/noise.js";
import * as preparation from "../ride/preparation.js";
import * as free from "./free.js";
import * as search from "./search_form.js";

const USES = { fit: "fit", hold_out: "hold out", leave_out: "leave out" };

/**
 * How a run is used: unless chosen, the ride on show (or the first) is fitted and others held out, but
 * those of another car than the one of that name, or than the virtual one that drove `like` (untold: the run fitted).
 */
function useOf(run, car = get("vehicle").name, like = null) {
  if (!run.usable_for_identification) return "leave_out";
  if (get("use")[run.id]) return get("use")[run.id];
  const usable = get("measurements").filter((m) => m.usable_for_identification);
  const { kind, id } = get("ride");
  const shown = usable.find((m) => kind === "measurement" && m.id === id) ?? usable[0];
  if (run === shown) return "fit";
  const { plant } = like ?? shown;
  const stranger = ofAnotherCar(run, car) || (run.plant && plant && run.plant !== plant);
  return dataOf(run) === dataOf(shown) || original(run) || stranger ? "leave_out" : "hold_out";
}

export const fitted = () => get("measurements").filter((run) => useOf(run) === "fit");

/** Runs to score beside those fitted: what was fitted under another name is not unseen. */
export const heldOut = (seen, car) => unseen(seen).filter((run) => useOf(run, car, seen[0]) !== "leave_out");

/** Fit some runs beside those that are fitted now. */
export const fitToo = (runs) =>
  set({ use: { ...get("use"), ...Object.fromEntries([...fitted(), ...runs].map(({ id }) => [id, "fit"])) } });

/** Usable runs with other data than these. */
export function unseen(seen) {
  const data = new Set(seen.map(dataOf));
  return get("measurements").filter((run) => run.usable_for_identification && !data.has(dataOf(run)));
}

/** The set-up; `used()` is called when the use of a run has changed. */
export function view(used) {
  const runs = get("measurements");
  return h("div", { className: "setup scrolls" },
    h("section", {},
      h("h3", {}, "Runs"),
      runs.length
        ? h("ul", { className: "runs" }, runs.map((run) => runRow(run, used)))
        : h("p", { className: "empty" }, "No measurement yet; add one under Measurements."),
      h("p", { className: "hint" },
        "Unless you choose, the recording on show is fitted, or the first. A run held out shows how " +
        "well the car predicts what it has not seen."),
      preparation.view(),
      noise.view(fitted()),
      search.view()),
    free.view());
}

function runRow(run, used) {
  const choose = (value) => {
    set({ use: { ...get("use"), [run.id]: value } });
    used();
  };
  return h("li", {},
    h("span", { className: "run-name", title: nameOf(run.id) }, breakable(nameOf(run.id))),
    run.usable_for_identification
      ? h("span", { className: "run-use" },
          select(USES, useOf(run), choose, { "aria-label": `Use of ${nameOf(run.id)}` }),
          h("label", {}, "brakes", preparation.brakingField(run)),
          copied(run), ofAnother(run))
      : h("span", { className: "badge", title: `${lacks(run)}.` }, "not for fitting"));
}

function copied(run) {
  const first = original(run);
  if (!first) return null;
  const twice = useOf(first) === "fit" && useOf(run) === "fit";
  return h("span", { className: twice ? "worse" : "hint" }, "the same data as ", breakable(nameOf(first.id)),
    twice ? ", which so counts twice" : "");
}

function ofAnother(run) {
  if (ofAnotherCar(run, get("vehicle").name)) {
    return h("span", { className: "hint" }, "recorded with another car: ", run.vehicle);
  }
  const [first] = fitted();
  if (!first || !ofAnotherPlant(run, first)) return null;
  const sure = run.plant && first.plant ? "" : "perhaps ";
  return h("span", { className: "hint" }, `${sure}another car than that fitted: ${drivenBy(run)}`);
}

function select(options, value, change, properties) {
  const element = h("select", { ...properties, on: { change: () => change(element.value) } },
    Object.entries(options).map(([key, text]) =>
      h("option", { value: key, selected: key === value }, text)));
  return element;
}

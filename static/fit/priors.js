// What is known of parameters before the runs: a mean and a standard deviation each.

import { fold, h, symbol } from "../common/dom.js";
import { get, set } from "../common/store.js";
import * as units from "../common/units.js";

const memory = { open: false };

/** {parameter: [mean, deviation]}, SI, of those that were typed as a whole. */
export const whole = () => Object.fromEntries(Object.entries(get("priors"))
  .filter(([, [mean, deviation]]) => mean !== null && deviation > 0));

/** The same of the free parameters given. */
export const typed = (free) => Object.fromEntries(Object.entries(whole()).filter(([name]) => free.includes(name)));

/** The folded table of the parameters given; `isFree(name)` tells whose prior counts. */
export function view(names, isFree) {
  const summary = h("summary");
  const follow = () => {
    const known = names.filter((name) => name in whole() && isFree(name));
    summary.replaceChildren("Known before: ", ...(known.length
      ? known.flatMap((name, i) => [i ? ", " : "", symbol(units.parameter(name).symbol)]) : ["nothing"]));
  };
  const part = fold(memory, summary,
    h("table", { className: "priors filters" },
      h("thead", {}, h("tr", {}, h("th", { scope: "col" }, "Parameter"), h("th", { scope: "col" }, "Mean"), h("th"),
        h("th", { scope: "col" }, "Std. dev."), h("th", { scope: "col", className: "unit" }, "Unit"))),
      h("tbody", {}, names.map((name) => row(name, follow)))),
    h("p", { className: "hint" }, "From a data sheet, a scale or a bench. Empty: nothing is known. The prior of a " +
      "parameter that is not free does not count."));
  follow();
  return part;
}

function row(name, follow) {
  const { label, symbol: text, display_unit: unit, display_factor: factor } = units.parameter(name);
  const shown = (value) => (value === null || value === undefined ? "" : units.plain(value * factor, 12));
  const fields = ["Mean", "Standard deviation"].map((word, k) => h("input", {
    type: "number", step: "any", min: k ? "0" : undefined, value: shown(get("priors")[name]?.[k]),
    placeholder: k ? "" : name in get("values") ? units.plain(get("values")[name] * factor, 3) : "",
    "aria-label": units.withUnit(`${word} of ${label} known before`, unit, ", "),
    on: { change: () => {
      const { [name]: [...both] = [null, null], ...others } = get("priors");
      both[k] = fields[k].value === "" ? null : Number(fields[k].value) / factor;
      set({ priors: both.every((one) => one === null) ? others : { ...others, [name]: both } });
      check();
      fields.find((one) => !one.validity.valid && one.value !== "")?.reportValidity();
      follow();
    } },
  }));
  /** One without the other, or a deviation of 0, is no prior. */
  function check() {
    const [mean, deviation] = fields;
    const half = (mean.value === "") !== (deviation.value === "");
    deviation.setCustomValidity(half ? "Give mean and standard deviation, or neither."
      : deviation.value !== "" && !(Number(deviation.value) > 0) ? "A standard deviation is positive." : "");
  }
  check();
  return h("tr", {}, h("th", { scope: "row", title: label }, symbol(text)), h("td", {}, fields[0]),
    h("td", { className: "soft" }, "±"), h("td", {}, fields[1]), h("td", { className: "unit" }, unit));
}

/** Whether every prior is whole; the first that is not says so. */
export function ready() {
  const wrong = document.querySelector(".priors input:invalid");
  if (wrong) wrong.closest("details").open = true;
  wrong?.reportValidity();
  return !wrong;
}

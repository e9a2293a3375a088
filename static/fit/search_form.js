// How a fit searches: from how many starts, and how much outliers count.

import { fold, h } from "../common/dom.js";
import { get, set } from "../common/store.js";
import * as units from "../common/units.js";

const LOSSES = {
  linear: "least squares", soft_l1: "soft L1", huber: "Huber", cauchy: "Cauchy", arctan: "arctan",
};
export const USUAL = { starts: 1, seed: 0, loss: "linear", loss_scale: 3 };
/** What the service takes. */
const LIMITS = { starts: { min: "1", max: "1024" }, seed: { min: "0", max: String(2 ** 53) }, loss_scale: { min: "0.01", max: "1e6" } };
const memory = { open: false };

const ask = (change) => set({ search: { ...get("search"), ...change } });

export function view() {
  const summary = h("summary");
  const scale = number("loss_scale", "From so many noises on", { step: "any" },
    "Residuals beyond this many noises count as outliers");
  const follow = () => {
    scale.field.disabled = get("search").loss === "linear";
    summary.textContent = `Search: ${said()}`;
  };
  const loss = h("select", { id: "loss", title: "How residuals far beyond the noise count: squared, or less",
    on: { change: () => { ask({ loss: loss.value }); follow(); } } },
  Object.entries(LOSSES).map(([key, text]) => h("option", { value: key, selected: key === get("search").loss }, text)));
  function number(key, label, properties, title) {
    const field = h("input", { type: "number", id: `search-${key}`, title, ...LIMITS[key], ...properties, value: get("search")[key],
      on: { change: () => {
        if (field.value === "") field.value = USUAL[key];
        if (field.reportValidity()) ask({ [key]: Number(field.value) });
        follow();
      } } });
    return { field, label: h("label", { className: "block" }, label, field) };
  }
  const part = fold(memory, summary, h("div", { className: "search-fields" },
    number("starts", "Starts", { step: "1" },
      "1: the sliders' values alone. 64: further points between the bounds, the best of which are searched from, " +
      "to find other minima").label,
    number("seed", "Seed of the starts", { step: "1" }, "Another whole number draws other starts").label,
    h("label", { className: "block" }, "Outliers count by", loss), scale.label));
  follow();
  return part;
}

/** What differs from what is usual. */
function said() {
  const asked = get("search");
  const parts = [
    asked.starts !== USUAL.starts && `${asked.starts} starts`,
    asked.seed !== USUAL.seed && `seed ${asked.seed}`,
    asked.loss !== USUAL.loss && `${LOSSES[asked.loss]} from ${units.plain(asked.loss_scale)} noises`,
  ].filter(Boolean);
  return parts.length ? parts.join(", ") : "one start, least squares";
}

/** Whether every field can be read; the first that cannot says so. */
export function ready() {
  const wrong = document.querySelector(".search-fields input:invalid");
  if (wrong) wrong.closest("details").open = true;
  wrong?.reportValidity();
  return !wrong;
}

// The error band: 95 % of what the errors of the fit leave open in the prediction on show.
//
// Wanted since a fit was applied or by its box, it is asked for whenever the sliders rest, beside the
// simulations, which do not wait for it: half a second against some tens of ms.

import { isOfThisCar } from "../car/controls.js";
import * as api from "../common/api.js";
import { $, debounced, h } from "../common/dom.js";
import { get, on, set } from "../common/store.js";
import { request } from "./simulation.js";

const REST = 350;

let wanted = false;
let asking = false;
let again = false;
let why = "";
const parts = {};

export function build() {
  parts.box = h("input", { type: "checkbox", "aria-label": "Error band", on: { change: () => {
    wanted = parts.box.checked;
    why = "";
    if (wanted) ask();
    else set({ bands: null });
    show();
  } } });
  parts.word = h("span", { className: "key band", id: "band-word" });
  parts.label = h("label", { className: "inline", id: "band-toggle", hidden: true }, parts.box,
    parts.word);
  $("#band-place").replaceWith(parts.label);
  on("now", follow);
  on("values ride road liftOff traction rimsSettings braking vehicle fitJob", drop);
  on("fitJob", follow);
  on("fit vehicle values bands", show);
  show();
}

/** A fit has been applied: its band comes by itself. */
export function applied() {
  wanted = true;
  show();
}

/** What was drawn belongs to another car or ride. */
function drop() {
  why = "";
  if (get("bands")) set({ bands: null });
}

/** A new curve is there. */
function follow() {
  if (!get("now")) drop();
  else if (get("fit") && wanted) later();
}
const later = debounced(ask, REST);

async function ask() {
  if (asking) {
    again = true;
    return;
  }
  if (!wanted || !get("now") || !get("fitJob") || !get("online") || !isOfThisCar(get("fit"))) return;
  asking = true;
  again = false;
  show();
  const [now, values] = [get("now"), get("valuesNow")];
  try {
    const run = await api.simulate({ ...request({ vehicle: get("vehicle"), values }),
      bands: { identification: get("fitJob").id } });
    // Else another curve is there, or on its way, and asks for its own.
    if (now === get("now") && values === get("values") && wanted) {
      why = run.head.warnings.filter((text) => !now.head.warnings?.includes(text)).join(" ");
      set({ bands: run });
    }
  } catch (error) {
    if (!(error instanceof api.Refusal)) throw error;
    if (error.lost) set({ online: false });
    else if (error.code === "busy") again = true;
    else why = error.message;
  } finally {
    asking = false;
    show();
  }
  if (again) later();
}

function show() {
  const fit = get("fit");
  parts.label.hidden = !fit?.covariance || !isOfThisCar(fit);
  parts.box.checked = wanted;
  const late = wanted && Boolean(get("now")) && !get("bands");
  parts.word.textContent = !late ? "Error band" : why && !asking ? "none here" : "follows …";
  parts.label.classList.toggle("waiting", late || asking);
  parts.label.title = why || "95 % of what the errors of the fit leave open in the prediction of the car on show";
}

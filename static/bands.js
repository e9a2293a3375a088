// The error band: 95 % of what the errors of the fit leave open in the prediction on show.
//
// Asked for once the sliders rest, beside the simulations, which it never holds up. It comes by itself
// when a fit is applied, and follows the sliders by itself only where that is quick.

import * as api from "./api.js";
import { isOfThisCar } from "./controls.js";
import { $, debounced, h } from "./dom.js";
import { request } from "./simulation.js";
import { get, on, set } from "./store.js";

const REST = 350;
/** A band that takes longer is not asked for at every move, s. */
const QUICK = 0.2;

/**
 * Whether it is wanted: "on" and "off" as somebody chose, "auto" since a fit was applied, "once" where
 * it came by itself and is too slow to follow the sliders.
 */
let wanted = "off";
let asking = false;
let again = false;
let why = "";
const parts = {};

export function build() {
  parts.box = h("input", { type: "checkbox", on: { change: () => {
    wanted = parts.box.checked ? "on" : "off";
    why = "";
    if (wanted === "off") set({ bands: null });
    else ask();
    show();
  } } });
  parts.label = h("label", { className: "inline", id: "band-toggle", hidden: true }, parts.box,
    h("span", { className: "key band" }, "Error band"));
  $("#band-place").replaceWith(parts.label);
  on("now", follow);
  on("values ride road liftOff traction rimsSettings braking vehicle fitJob", drop);
  on("fit vehicle values bands", show);
  show();
}

/** A fit has been applied: its band comes by itself. */
export function applied() {
  if (wanted !== "on") wanted = "auto";
  show();
}

/** What was drawn belongs to another car or ride. */
function drop() {
  if (get("bands")) set({ bands: null });
}

/** A new curve is there. */
function follow() {
  if (!get("now")) drop();
  else if (get("fit") && (["on", "auto"].includes(wanted) || get("bands"))) later();
}
const later = debounced(ask, REST);

async function ask() {
  if (asking) {
    again = true;
    return;
  }
  if (wanted === "off" || !get("now") || !get("fitJob") || !get("online") || !isOfThisCar(get("fit"))) return;
  asking = true;
  again = false;
  show();
  const [now, values] = [get("now"), get("valuesNow")];
  try {
    const run = await api.simulate({ ...request({ vehicle: get("vehicle"), values }),
      bands: { identification: get("fitJob").id } });
    // Else another curve is there, or on its way, and asks for its own.
    if (now === get("now") && values === get("values") && wanted !== "off") {
      why = run.head.warnings.filter((text) => !now.head.warnings?.includes(text)).join(" ");
      set({ bands: run });
      if (wanted === "auto" && run.head.seconds > QUICK) wanted = "once";
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
  parts.box.checked = wanted === "on" || wanted === "auto" || Boolean(get("bands"));
  parts.label.classList.toggle("waiting", asking);
  parts.label.title = why || "95 % of what the errors of the fit leave open in the prediction of the car on show";
}

// What the engineer has set, kept by the service: soon after each change, and when the page goes.

import * as api from "./api.js";
import { withValues } from "./controls.js";
import { debounced } from "./dom.js";
import { damperNames } from "./free.js";
import * as priors from "./priors.js";
import { USUAL } from "./search_form.js";
import { get, on, set } from "./store.js";

const SAVE_AFTER = 400;

const ofSession = [
  keeper("values", () => api.saveVehicle(withValues(get("vehicle"), get("values")))),
  keeper("ride use fixed bounds noise priors search sensors fitNoise traction rimsSettings braking",
    () => api.saveSetup(setup())),
];

/** Something that was set may not have reached the service yet. */
export const unsaved = () => ofSession.some(({ pending }) => pending());
export const save = () => Promise.all(ofSession.map((one) => one.save()));

/** Keep what changes from now on. */
export const follow = () => ofSession.forEach((one) => one.follow());

function keeper(keys, send) {
  let changed = false;
  let saving = false;
  async function keep() {
    if (!changed) return;
    changed = false;
    saving = true;
    try {
      await send();
    } catch (error) {
      // What is refused is told where it acts, on the ride or on the fit, and sent again once mended.
      changed = true;
      if (error.lost) set({ online: false });
    }
    saving = false;
  }
  const soon = debounced(keep, SAVE_AFTER);
  window.addEventListener("pagehide", keep);
  return {
    save: keep, pending: () => changed || saving,
    follow: () => on(keys, () => { changed = true; soon(); }),
  };
}

/** What the next identification is told, in the words of its request. */
function setup() {
  const here = new Set(get("measurements").map(({ id }) => id));
  const ofRuns = (by) => Object.fromEntries(Object.entries(by).filter(([id]) => here.has(id)));
  const { kind, id = null, key = null } = get("ride");
  return {
    ride: { kind, id, key }, use: ofRuns(get("use")), fixed: get("fixed"), bounds: get("bounds"), noise: get("noise"),
    priors: priors.whole(), ...get("search"), sensors: get("sensors"), fit_noise: get("fitNoise"),
    traction: get("traction"), settings: get("rimsSettings"), braking: ofRuns(get("braking")),
  };
}

/** The store's part of a session's set-up; of one that has none, what is usual. */
export function taken(kept, rimsSettings) {
  const usual = { use: {}, fixed: damperNames(), bounds: {}, noise: {}, priors: {}, sensors: {}, fitNoise: false,
    search: USUAL, traction: "exact", rimsSettings, braking: {} };
  if (!kept) return usual;
  const { use, fixed, bounds, noise, priors: known, sensors, traction, settings, braking } = kept;
  const search = Object.fromEntries(Object.keys(USUAL).map((name) => [name, kept[name]]));
  return { use, fixed: fixed ?? usual.fixed, bounds, noise, priors: known, sensors, fitNoise: kept.fit_noise, search, traction,
    rimsSettings: settings, braking };
}

/** What a session had on show, or null where that is no more. */
export function rideOf(kept, measurements, manoeuvres) {
  const ride = kept?.ride;
  if (!ride) return null;
  const { kind, id, key } = ride;
  if (kind === "manoeuvre") return manoeuvres.some((one) => one.key === key) ? { kind, key } : null;
  return measurements.some((one) => one.id === id && one.usable_for_identification) ? { kind, id } : null;
}

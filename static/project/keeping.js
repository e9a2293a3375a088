// What the engineer has set, kept by the service: soon after each change, and when the page goes.
//
// The set-up is kept in parts, each by itself: only those that changed here are sent, so that another
// page of the session keeps its own, and one that is refused holds no other back.

import { damperNames } from "../car/car.js";
import { withValues } from "../car/controls.js";
import * as api from "../common/api.js";
import { debounced } from "../common/dom.js";
import { nameOf } from "../common/names.js";
import { notice } from "../common/notices.js";
import { get, on, set } from "../common/store.js";
import * as units from "../common/units.js";
import * as priors from "../fit/priors.js";
import { USUAL } from "../fit/search_form.js";

const SAVE_AFTER = 400;
/** What the service has of a part that is on its way, or was when the connection went. */
const UNKNOWN = "";

const ofSession = [
  // A car that is refused is told on its ride.
  keeper("values", () => new Map([["", withValues(get("vehicle"), get("values"))]]),
    (_, vehicle, leaving) => api.saveVehicle(vehicle, leaving), () => () => {}),
  keeper("ride use fixed bounds noise priors search sensors fitNoise traction rimsSettings braking",
    parts, (key, value, leaving) => api.changeSetup(change(key, value), leaving),
    (key, error) => notice("error", `${told(key)} is not kept`, error.message)),
];

/** Something that was set may not have reached the service yet. */
export const unsaved = () => ofSession.some(({ pending }) => pending());
export const save = () => Promise.all(ofSession.map((one) => one.save()));

/** Keep what changes from now on. */
export const follow = () => ofSession.forEach((one) => one.follow());

/**
 * Keeps `parts()`, a value (null for none) by key, one after the other: the newest is sent last.
 * `refused(key, error)` tells of one that is not kept, and gives what takes that back.
 */
function keeper(keys, parts, send, refused) {
  /** What the service has, as text; nothing is sent before it is known. */
  let kept = null;
  const refusals = new Map();
  let last = Promise.resolve();
  let saving = 0;

  const texts = () => new Map([...parts()].map(([key, value]) => [key, JSON.stringify(value)]));
  function changed() {
    if (!kept) return [];
    const now = texts();
    return [...new Set([...kept.keys(), ...now.keys()])]
      .map((key) => [key, now.get(key) ?? "null"])
      .filter(([key, text]) => text !== (kept.get(key) ?? "null"));
  }
  /** What was refused is sent again once it is mended, or where the service failed. */
  function sendable() {
    const all = changed();
    const now = new Map(all);
    for (const [key, { text, status, takeBack }] of refusals) {
      if (now.get(key) === text && status < 500) continue;
      takeBack();
      refusals.delete(key);
    }
    return all.filter(([key]) => !refusals.has(key));
  }

  async function keep([key, text], leaving) {
    const before = kept.get(key);
    kept.set(key, UNKNOWN);
    try {
      await send(key, JSON.parse(text), leaving);
      kept.set(key, text);
    } catch (error) {
      if (error.lost) {
        set({ online: false });
        return;
      }
      if (error.code === undefined) throw error;
      kept.set(key, before);
      refusals.set(key, { text, status: error.status, takeBack: refused(key, error) });
    }
  }
  async function keepAll() {
    saving += 1;
    try {
      for (const part of sendable()) await keep(part, false);
    } finally {
      saving -= 1;
    }
  }
  const save = () => (last = last.catch(() => {}).then(keepAll));
  const soon = debounced(save, SAVE_AFTER);
  window.addEventListener("pagehide", () => sendable().forEach((part) => keep(part, true)));
  return {
    save, pending: () => saving > 0 || changed().length > 0,
    follow: () => { kept = texts(); on(keys, soon); },
  };
}


/** What the next identification is told, in the words of its request: {"part": value, "part entry": value}. */
function parts() {
  const { kind, id = null, key = null } = get("ride");
  const whole = {
    ride: { kind, id, key }, fixed: get("fixed"), ...get("search"), fit_noise: get("fitNoise"), traction: get("traction"),
  };
  const byEntry = {
    use: get("use"), bounds: get("bounds"), noise: get("noise"), priors: priors.whole(), sensors: get("sensors"),
    settings: get("rimsSettings"), braking: get("braking"),
  };
  return new Map([...Object.entries(whole), ...Object.entries(byEntry).flatMap(([part, entries]) =>
    Object.entries(entries).map(([entry, value]) => [`${part} ${entry}`, value]))]);
}

/** The request that changes one part. */
function change(key, value) {
  const [part, entry] = key.split(" ");
  return entry === undefined ? { [part]: value } : { [part]: { [entry]: value } };
}

/** What a person calls a part. */
function told(key) {
  const [part, entry] = key.split(" ");
  const parameter = () => units.parameter(entry).label.toLowerCase();
  const channel = () => units.channel(entry).label.toLowerCase();
  return {
    ride: () => "The ride on show",
    fixed: () => "Which parameters are free",
    starts: () => "The number of starts",
    seed: () => "The seed of the starts",
    loss: () => "How outliers count",
    loss_scale: () => "From where on outliers count less",
    fit_noise: () => "Whether noise is found",
    traction: () => "The traction",
    settings: () => `How recordings drive the model (${entry})`,
    use: () => `The use of ${nameOf(entry)}`,
    braking: () => `When ${nameOf(entry)} brakes`,
    bounds: () => `The range of ${parameter()}`,
    noise: () => `The noise of ${channel()}`,
    priors: () => `What is known before of ${parameter()}`,
    sensors: () => `The sensor of ${channel()}`,
  }[part]();
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

// The form of a campaign: which car drives what, on which roads, and what records it.

import { withValues } from "../car/controls.js";
import * as api from "../common/api.js";
import { fold, h, inPlace } from "../common/dom.js";
import { get, on, set } from "../common/store.js";
import * as units from "../common/units.js";

/** Chosen until somebody chooses: the paper's manoeuvres. */
const USUAL = ["1", "2"];
/** Multiples of the noise that an identification assumes where none is stated. */
const NOISES = { usual: 1, none: 0, "5 × usual": 5 };
const NOISY = { "chassis.z": "z", "chassis.pitch": "pitch", "chassis.roll": "roll" };
/** Estimates of a shorter time than this are not told, s. */
const SHORT = 5;
const memory = { open: false };
const fields = {};
const parts = {};

let changed = () => {};
/** The file of sensors in place of the usual ones: {name, sensors, channels, rate_hz}, or null. */
let chosenSensors = null;
/** Why a file of sensors was not taken, a sentence. */
let failure = "";

/** The form; `tools` stand below it. `onChange()` when what it asks for has changed. */
export function build({ onChange, onSubmit, tools }) {
  changed = onChange;
  parts.noise = h("p", { className: "hint" });
  parts.driver = h("p", { className: "hint", id: "campaign-driver" });
  parts.sensors = h("div", { className: "campaign-sensors" });
  parts.more = h("summary");
  parts.manoeuvres = h("fieldset", { className: "campaign-manoeuvres" });
  list(USUAL);
  on("manoeuvres", () => list(chosen()));
  const form = h("form", { className: "campaign", "aria-label": "Drive a campaign",
    on: { submit: (event) => { event.preventDefault(); onSubmit(); }, change: follow } },
  parts.manoeuvres,
  h("div", { className: "campaign-fields" },
    select("car", "Car", [],
      "The car that drives and is measured: the concept model with the sliders' or the fitted parameters, " +
      "or the detailed multibody car, which takes a minute or so a drive"),
    number("class_factor", "Road class factor", { min: "0", step: "any", placeholder: "as it is" },
      "Times the power of every random road at the mean of its class: 1 is the mean, 0.5 the lower " +
      "limit, 2 the upper; empty: as the manoeuvre has it"),
    select("noise", "Noise", Object.keys(NOISES).map((key) => ({ key, name: key })),
      "Standard deviation of white noise on z, pitch and roll"),
    number("seed", "Seed of the noise", { min: "0", step: "1", value: "0", required: true },
      "Another whole number draws other noise")),
  parts.driver, parts.noise, missing("plants"), more(), tools);
  // A field that the browser refuses must be in sight to be told of.
  form.addEventListener("invalid", ({ target }) => { target.closest("details").open = true; }, true);
  listCars(get("plants")[0].key);
  on("fitJob", () => { listCars(fields.car.value); follow(); });
  on("vehicle", follow);
  showSensors();
  follow();
  return form;
}

/**
 * The cars that can be driven: {key, plant, fitted, label, vehicle(), said()}. A plant that takes a vehicle drives
 * that of the sliders and, once there is a fit, the fitted one.
 */
function cars() {
  return get("plants").flatMap((plant) => {
    const { key, name, missing: why } = plant;
    if (!plant.takes_vehicle) {
      return [{ key, plant, label: name, missing: why, vehicle: () => null, said: () => `The ${name.toLowerCase()} drives.` }];
    }
    const onSliders = () => withValues(get("vehicle"), get("values"));
    const fitted = get("fit") && { key: `${key}-fitted`, plant, fitted: true, label: "Fitted car", missing: why,
      vehicle: () => get("fit").vehicle, said: () => drivenBy("fitted car", get("fit").vehicle) };
    return [{ key, plant, label: "Sliders' car", missing: why, vehicle: onSliders,
      said: () => drivenBy("car on the sliders", get("vehicle")) }, fitted].filter(Boolean);
  });
}

/** What a run of the concept car is, and is not. */
const drivenBy = (which, { name }) => `The ${which}, “${name}”, drives: what the model says of it, not a measured car.`;

const car = () => cars().find(({ key }) => key === fields.car.value);

function listCars(chosenKey) {
  fields.car.replaceChildren(...cars().map(({ key, label, missing: why }) => option(key, label, why)));
  fields.car.value = chosenKey;
  if (!car()) fields.car.value = get("plants")[0].key;
}

/** What can be driven, with these keys chosen. */
function list(keys) {
  parts.manoeuvres.replaceChildren(h("legend", {}, "Manoeuvres"),
    ...get("manoeuvres").filter(({ kind }) => kind === "road").map((one) => manoeuvre(one, keys)));
}

/**
 * Choose one manoeuvre, and no other, for the car that a fit is about: that which drove its runs where it
 * brings its own data, else the fitted one.
 */
export function choose(key) {
  list([key]);
  const of = get("measurements").filter(({ id }) => get("fitJob").runs.some((run) => run.id === id));
  const drove = ({ plant, missing: why }) =>
    !why && !plant.takes_vehicle && of.some((run) => run.plant === plant.key);
  listCars((cars().find(drove) ?? cars().find(({ fitted }) => fitted)).key);
  follow();
  parts.manoeuvres.querySelector("input:checked")?.scrollIntoView({ block: "nearest" });
}

function more() {
  const low = number("band_low", "Roads from, cycle/m", { min: "0", step: "any", placeholder: "as it is" },
    "Lowest spatial frequency of every random road, cycle/m; empty: as the manoeuvre has it");
  const high = number("band_high", "to, cycle/m", { min: "0", step: "any", placeholder: "as it is" },
    "Highest spatial frequency of every random road, cycle/m; empty: as the manoeuvre has it");
  return fold(memory, parts.more,
    h("div", { className: "campaign-fields" }, low, high,
      number("road_seed", "Seed of the roads", { min: "0", step: "1", placeholder: "as it is" },
        "Another whole number draws other random roads; empty: as the manoeuvre has it"),
      select("format", "Recordings as", get("formats"),
        "CSV becomes measurements here; MDF4 can be downloaded, and added like any recording")),
    missing("formats"), parts.sensors);
}

function manoeuvre({ key, name, duration }, keys) {
  const box = h("input", { type: "checkbox", value: key, checked: keys.includes(key) });
  return h("label", { title: name }, box, h("span", { className: "name" }, name),
    h("span", { className: "soft" }, `${units.plain(duration, 3)} s`));
}

/** Of {key, name, missing}; what is missing cannot be chosen. */
function select(key, label, options, title) {
  fields[key] = h("select", { id: `campaign-${key}`, title },
    options.map(({ key: value, name, missing: why }) => option(value, name, why)));
  return h("label", { className: "block" }, label, fields[key]);
}

const option = (value, name, why) =>
  h("option", { value, disabled: Boolean(why), title: why }, why ? `${name}: not installed` : name);

function number(key, label, properties, title) {
  fields[key] = h("input", { type: "number", id: `campaign-${key}`, title, ...properties });
  return h("label", { className: "block" }, label, fields[key]);
}

/** Why some of the choices in a list of the service cannot be made. */
const missing = (list) => get(list).filter((one) => one.missing)
  .map((one) => h("p", { className: "hint" }, one.missing));

/** {channel: SI} of the chosen noise. */
const noise = () => Object.fromEntries(Object.keys(NOISY).map((name) =>
  [name, NOISES[fields.noise.value] * units.channel(name).default_noise]));

function noiseSaid() {
  if (chosenSensors) return `Noise as ${chosenSensors.name} states it.`;
  const said = Object.entries(noise()).filter(([, value]) => value > 0).map(([name, value]) => {
    const { display_factor: factor, display_unit: unit } = units.channel(name);
    return `${NOISY[name]} ${units.plain(value * factor, 3)} ${unit}`;
  });
  return said.length ? `Noise: ${said.join(", ")}.` : "The sensors are ideal.";
}

const chosen = () => [...parts.manoeuvres.querySelectorAll("input:checked")].map(({ value }) => value);
/** Keys of known manoeuvres; by the recordings' names where one is given as an object. */
function driven() {
  const rows = get("manoeuvres").filter(({ key }) => chosen().includes(key));
  return rows.some(({ given }) => given)
    ? Object.fromEntries(rows.map(({ key, given }) => [key.replace(/[^\w-]/g, "_"), given ?? key]))
    : rows.map(({ key }) => key);
}

const typed = (key) => (fields[key].value === "" ? null : Number(fields[key].value));

function band() {
  const ends = [typed("band_low"), typed("band_high")];
  return ends.includes(null) ? null : ends;
}

/** What the service is asked for. */
export const request = () => ({
  plant: car().plant.key,
  vehicle: car().vehicle(),
  manoeuvres: driven(),
  class_factor: typed("class_factor"),
  band: band(),
  road_seed: typed("road_seed"),
  ...(chosenSensors ? { sensors: chosenSensors.sensors } : { noise: noise() }),
  seed: typed("seed"),
  format: fields.format.value,
});

/** Whether there is anything to drive. */
export const isEmpty = () => chosen().length === 0;

/** How much is asked for, and about how long it takes. */
export function extent() {
  const keys = chosen();
  if (!keys.length) return "Choose a manoeuvre at least.";
  const lasting = get("manoeuvres").filter(({ key }) => keys.includes(key))
    .reduce((sum, { duration }) => sum + duration, 0);
  return `${keys.length} ${keys.length > 1 ? "drives" : "drive"}, ${units.plain(lasting, 4)} s` +
    taking(lasting * car().plant.effort, "to compute");
}

/** ", about 2 min" and a word; nothing for a short time. */
export function taking(seconds, word) {
  if (seconds < SHORT) return "";
  const time = seconds < 90 ? `${10 * Math.ceil(seconds / 10)} s` : `${Math.round(seconds / 60)} min`;
  return `, about ${time} ${word}`;
}

/** What follows from a field. It builds nothing anew: a press on a button is what ends the typing. */
function follow() {
  const half = (typed("band_low") === null) !== (typed("band_high") === null);
  fields.band_high.setCustomValidity(half ? "Give both ends of the band, or neither." : "");
  fields.noise.disabled = chosenSensors !== null;
  parts.driver.textContent = car().said();
  parts.noise.textContent = noiseSaid();
  parts.more.textContent = `Roads, sensors, format: ${moreSaid()}`;
  changed();
}

function showSensors() {
  inPlace(parts.sensors, () => parts.sensors.replaceChildren(...sensorsRow().filter(Boolean)), "button");
}

/** What differs in the fold from what is usual. */
function moreSaid() {
  const said = [
    band() && `${band().join(" to ")} cycle/m`,
    typed("road_seed") !== null && `road seed ${typed("road_seed")}`,
    chosenSensors?.name,
    fields.format.value !== get("formats")[0].key && fields.format.selectedOptions[0].text,
  ].filter(Boolean);
  return said.length ? said.join(", ") : "as usual";
}

function sensorsRow() {
  const file = h("input", { type: "file", id: "campaign-sensors", accept: ".toml,.json", className: "hidden-file",
    "aria-label": "File of sensors", on: { change: () => { if (file.files[0]) read(file.files[0]); } } });
  return [
    h("button", { type: "button", title: "TOML or JSON: what is recorded, how often, with what noise and errors",
      on: { click: () => file.click() } }, "Sensors from a file …"), file,
    chosenSensors ? h("button", { type: "button", on: { click: () => useSensors(null) } }, "Usual sensors") : null,
    h("span", { className: "hint" }, chosenSensors ? sensorsSaid(chosenSensors) : "the usual sensors"),
    failure ? h("div", { className: "problem", role: "alert" }, h("p", {}, failure)) : null,
  ];
}

const sensorsSaid = ({ name, channels, rate_hz: rate }) =>
  `${name}: ${channels.length} channel${channels.length > 1 ? "s" : ""} at ${units.plain(rate)} Hz`;

async function read(file) {
  try {
    useSensors({ name: file.name, ...await api.readSensors(file) });
  } catch (error) {
    if (error.code === undefined) throw error;
    if (error.lost) set({ online: false });
    failure = error.message;
    showSensors();
  }
}

function useSensors(sensors) {
  chosenSensors = sensors;
  failure = "";
  showSensors();
  follow();
}

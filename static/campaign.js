// A campaign: let a car that is known drive manoeuvres, follow the job, take its recordings over.

import * as api from "./api.js";
import { withValues } from "./controls.js";
import { fold, h, inPlace } from "./dom.js";
import { jobs } from "./job.js";
import { notice, refused } from "./notices.js";
import { get, on, set } from "./store.js";
import * as units from "./units.js";

/** Chosen until somebody chooses: the paper's manoeuvres. */
const USUAL = ["1", "2"];
/** Multiples of the noise that an identification assumes where none is stated. */
const NOISES = { usual: 1, none: 0, "5 × usual": 5 };
const NOISY = { "chassis.z": "z", "chassis.pitch": "pitch", "chassis.roll": "roll" };
const STATES = { whole: "whole", partial: "broke off", missing: "missing" };
const memory = { open: false };
const fields = {};
const parts = {};

/** What was wrong with the last request, a sentence. */
let problem = "";
const { now: current, busy, start: send, resume: takeUp, cancel } =
  jobs("campaigns", "campaign", { changed: show, ended });

export { current };

/** The form, folded, with what became of the newest campaign below it. */
export function build() {
  parts.tools = h("div", { className: "row-tools" });
  parts.noise = h("p", { className: "hint" });
  parts.outcome = h("div", { className: "campaign-outcome" });
  parts.manoeuvres = h("fieldset", { className: "campaign-manoeuvres" }, h("legend", {}, "Manoeuvres"),
    get("manoeuvres").filter(({ kind }) => kind === "road").map(manoeuvre));
  const form = h("form", { className: "campaign", "aria-label": "Drive a campaign",
    on: { submit: (event) => { event.preventDefault(); start(); } } },
  parts.manoeuvres,
  h("div", { className: "campaign-fields" },
    select("plant", "Car", Object.fromEntries(get("plants").map(({ key, name }) => [key, name])),
      "The car that drives and is measured; the concept car is the sliders'"),
    number("class_factor", "Road class factor", { min: "0", step: "any", placeholder: "as it is" },
      "Times the power of every random road at the mean of its class: 1 is the mean, 0.5 the lower " +
      "limit, 2 the upper; empty: as the manoeuvre has it"),
    select("noise", "Noise", Object.fromEntries(Object.keys(NOISES).map((key) => [key, key])),
      "Standard deviation of white noise on z, pitch and roll"),
    number("seed", "Seed of the noise", { min: "0", step: "1", value: "0", required: true },
      "Another whole number draws other noise")),
  parts.noise, parts.tools);
  fields.noise.addEventListener("change", () => { parts.noise.textContent = noiseSaid(); });
  parts.noise.textContent = noiseSaid();
  on("measurements", show);
  show();
  return fold(memory, h("summary", {}, "Drive a campaign with virtual sensors"),
    form, parts.outcome);
}

function manoeuvre({ key, name, duration }) {
  const box = h("input", { type: "checkbox", value: key, checked: USUAL.includes(key), on: { change: show } });
  return h("label", { title: name }, box, h("span", { className: "name" }, name),
    h("span", { className: "soft" }, `${units.plain(duration, 3)} s`));
}

function select(key, label, options, title) {
  fields[key] = h("select", { id: `campaign-${key}`, title },
    Object.entries(options).map(([value, text]) => h("option", { value }, text)));
  return h("label", { className: "block" }, label, fields[key]);
}

function number(key, label, properties, title) {
  fields[key] = h("input", { type: "number", id: `campaign-${key}`, title, ...properties });
  return h("label", { className: "block" }, label, fields[key]);
}

/** {channel: SI} of the chosen noise. */
const noise = () => Object.fromEntries(Object.keys(NOISY).map((name) =>
  [name, NOISES[fields.noise.value] * units.channel(name).default_noise]));

function noiseSaid() {
  const said = Object.entries(noise()).filter(([, value]) => value > 0).map(([name, value]) => {
    const { display_factor: factor, display_unit: unit } = units.channel(name);
    return `${NOISY[name]} ${units.plain(value * factor, 3)} ${unit}`;
  });
  return said.length ? `Noise: ${said.join(", ")}.` : "The sensors are ideal.";
}

const chosen = () => [...parts.manoeuvres.querySelectorAll("input:checked")].map(({ value }) => value);

function request() {
  const { takes_vehicle: takes } = get("plants").find(({ key }) => key === fields.plant.value);
  const factor = fields.class_factor.value;
  return {
    plant: fields.plant.value,
    vehicle: takes ? withValues(get("vehicle"), get("values")) : null,
    manoeuvres: chosen(),
    class_factor: factor === "" ? null : Number(factor),
    noise: noise(),
    seed: Number(fields.seed.value),
  };
}

function start() {
  problem = "";
  send(request, (error) => {
    if (error.code === undefined) throw error;
    if (!error.lost) problem = error.message;
  });
}

/** Take up the newest campaign of a session that is opened again. */
export async function resume() {
  await takeUp();
  show();
}

async function ended() {
  if (whole().length) await takeOver();
}

const whole = () => (current()?.result?.recordings ?? []).filter(({ state }) => state === "whole");

/** Whether a recording of the campaign is not among the measurements. */
function absent() {
  const held = new Set(get("measurements").map(({ sha256 }) => sha256));
  return whole().some(({ sha256 }) => !held.has(sha256));
}

async function takeOver() {
  try {
    const rows = await api.takeOver(current().id);
    const held = new Set(get("measurements").map(({ id }) => id));
    const added = rows.filter(({ id }) => !held.has(id));
    set({ measurements: [...get("measurements"), ...added] });
    const count = added.length;
    if (count) notice("info", `${count} ${count > 1 ? "recordings are" : "recording is"} in`, "The campaign drove them.");
  } catch (error) {
    refused(error, "Adding the recordings");
  }
}

function show() {
  const keys = chosen();
  inPlace(parts.tools, () => parts.tools.replaceChildren(
    busy()
      ? h("button", { type: "button", id: "cancel-campaign", className: "danger", on: { click: cancel } }, "Cancel")
      : h("button", { type: "submit", id: "drive", className: "primary", disabled: !keys.length }, "Drive"),
    ...(busy() ? [bar()] : []),
    h("span", { className: "hint", id: "campaign-state" }, busy() ? progress() : extent(keys)),
  ), "#drive, #cancel-campaign");
  inPlace(parts.outcome, () => parts.outcome.replaceChildren(...outcome()));
}

function bar() {
  const { driven = 0, duration = 1 } = current().progress ?? {};
  return h("progress", { max: duration, value: driven, "aria-label": "Seconds driven" });
}

function progress() {
  const { runs, of, driven, duration } = current().progress ?? {};
  if (current().state === "queued" || of === undefined) return "Waiting for a worker …";
  return `${runs} of ${of} drives, ${units.fixed(driven, 1)} of ${units.plain(duration, 4)} s`;
}

function extent(keys) {
  if (!keys.length) return "Choose a manoeuvre at least.";
  const lasting = get("manoeuvres").filter(({ key }) => keys.includes(key))
    .reduce((sum, { duration }) => sum + duration, 0);
  return `${keys.length} ${keys.length > 1 ? "drives" : "drive"}, ${units.plain(lasting, 4)} s`;
}

/** What became of the newest campaign. */
function outcome() {
  const job = current();
  const alarm = (text) => h("div", { className: "problem", role: "alert" }, h("p", {}, text));
  if (problem) return [alarm(problem)];
  if (job?.error) return [alarm(job.error.detail)];
  if (!job || busy()) return [];
  if (!job.result) return [h("p", { className: "hint" }, "The campaign was cancelled before a drive ended.")];
  return [
    h("ul", { className: "campaign-recordings" }, job.result.recordings.map((one) =>
      h("li", {}, one.file
        ? h("a", { href: api.campaignFileUrl(job.id, one.file), download: one.file }, one.file) : one.name,
      h("span", { className: "badge", title: one.failure }, STATES[one.state]),
      one.failure ? h("span", { className: "hint" }, one.failure) : null))),
    h("div", { className: "row-tools" },
      h("a", { className: "button", id: "campaign-zip", download: "campaign.zip",
        href: api.campaignUrl(job.id) }, "Download all, with the truth"),
      absent() ? h("button", { type: "button", id: "take-over", on: { click: takeOver } },
        "Add to the measurements") : null),
  ];
}

// The car's known data: another reference car, a file, or single numbers.

import * as api from "./api.js";
import { valueAt, valuesOf, withValues } from "./controls.js";
import { $, fileName, h, saveFile } from "./dom.js";
import { notice, refused } from "./notices.js";
import { get, on, set } from "./store.js";
import * as units from "./units.js";

const GROUPS = [["chassis", "Sprung mass"], ["front", "Front axle"], ["rear", "Rear axle"],
  ["brakes", "Brakes"]];

/** A field of the panel is being changed: it must not be built anew under the hand. */
let own = false;

export function build() {
  on("vehicle", () => own || show());
  show();
}

/** Another car: sliders and baseline become its own. */
async function take(vehicle, what) {
  try {
    const saved = (await api.saveVehicle(vehicle)) ?? vehicle;
    await api.saveBaseline(saved);
    set({ vehicle: saved, baseline: saved, values: valuesOf(saved), fit: null });
    notice("info", what, `Sliders and baseline now hold “${saved.name}”.`);
  } catch (error) {
    if (error.lost) set({ online: false });
    refused(error, "Changing the car");
    show();
  }
}

function show() {
  const vehicle = get("vehicle");
  const file = h("input", {
    type: "file", accept: ".json,application/json", className: "hidden-file",
    "aria-label": "Vehicle file",
    on: { change: async () => { if (file.files[0]) await load(file.files[0]); file.value = ""; } },
  });
  const others = h("select", {
    "aria-label": "Reference cars",
    on: {
      change: async () => {
        const row = get("vehicles").find(({ key }) => key === others.value);
        if (row) take(await api.referenceVehicle(row.key), `${row.name} is loaded`);
      },
    },
  }, h("option", { value: "" }, "Load a reference car …"),
  get("vehicles").map((row) => h("option", { value: row.key, title: row.source ?? "" }, row.name)));
  const sliders = new Set(get("parameters").map(({ name }) => name));
  $("#car").replaceChildren(
    h("p", {}, h("strong", {}, vehicle.name)),
    h("div", { className: "row-tools" }, others,
      h("button", { type: "button", on: { click: () => file.click() } }, "Open file …"), file,
      h("button", { type: "button", on: { click: download } }, "Save file")),
    h("p", { className: "hint" }, "What is known of the car, in SI units. Unlike the sliders, " +
      "these numbers are never identified: a wrong mass ends up in the stiffnesses."),
    h("div", { className: "known" }, GROUPS.filter(([key]) => vehicle[key]).map(([key, title]) =>
      h("fieldset", {}, h("legend", {}, title),
        leaves(vehicle[key], key).filter((path) => !sliders.has(path)).map((path) =>
          entry(vehicle, path))))));
}

function leaves(part, path) {
  return Object.entries(part).flatMap(([key, value]) => {
    const here = `${path}.${key}`;
    if (value && typeof value === "object" && !Array.isArray(value)) return leaves(value, here);
    return typeof value === "number" ? [here] : [];
  });
}

function entry(vehicle, path) {
  const { unit, label } = units.known(path);
  const field = h("input", {
    type: "number", step: "any", value: units.plain(valueAt(vehicle, path), 6),
    on: { change: () => change(path, field) },
  });
  return h("label", { className: "known-row", title: path },
    h("span", {}, label), field,
    h("span", { className: "unit" }, unit));
}

async function change(path, field) {
  const value = field.value === "" ? NaN : Number(field.value);
  if (!Number.isFinite(value)) {
    field.value = units.plain(valueAt(get("vehicle"), path), 6);
    return;
  }
  const vehicle = withValues(get("vehicle"), { ...get("values"), [path]: value });
  const baseline = withValues(get("baseline"), { [path]: value });
  try {
    await api.saveVehicle(vehicle);
    await api.saveBaseline(baseline);
    own = true;
    set({ vehicle, baseline });
    own = false;
  } catch (error) {
    if (error.lost) set({ online: false });
    refused(error, "Changing the car");
    field.value = units.plain(valueAt(get("vehicle"), path), 6);
  }
}

/** A vehicle file, or the vehicle of a fit. */
export async function load(file) {
  let data;
  try {
    data = JSON.parse(await file.text());
  } catch {
    notice("error", `${file.name} was not taken`,
      "It is not JSON; a vehicle file begins with { and names chassis, front and rear.");
    return;
  }
  await take(data.vehicle ?? data, `${file.name} is loaded`);
}

function download() {
  const vehicle = withValues(get("vehicle"), get("values"));
  saveFile(vehicle, `${fileName(vehicle.name)}.json`);
}

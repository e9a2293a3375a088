// The car's known data: another reference car, a file, or single numbers.

import * as api from "../common/api.js";
import { $, fileName, h, saveFile } from "../common/dom.js";
import { notice, refused } from "../common/notices.js";
import { get, on, set } from "../common/store.js";
import * as units from "../common/units.js";
import { ofBentDamper, valueAt, valuesOf, withValues } from "./controls.js";

const GROUPS = [["chassis", "Sprung mass"], ["front", "Front axle"], ["rear", "Rear axle"],
  ["brakes", "Brakes"]];

/** What is chosen rather than measured, by the last word of its path: its label, value and word. */
const CHOICES = {
  driven: ["driven", [[true, "yes"], [false, "no"]]],
  torque_reaction: ["drive torque reacts on", [["chassis", "chassis"], ["arm", "arm"]]],
  reaction: ["torque reacts on", [["arm", "arm"], ["chassis", "chassis"]]],
};
const USUAL_BRAKES = { front_share: 0.65, reaction: "arm" };

/** A field of the panel is being changed: it must not be built anew under the hand. */
let own = false;

export function build() {
  on("vehicle", () => own || show());
  show();
}

/** Paths of what makes a damper a two-slope one. */
export const damperNames = () => get("parameters").filter(ofBentDamper).map(({ name }) => name);

/** The dampers that a car brings along are known, as its masses are, until they are freed for a fit. */
export function holdDampers() {
  set({ fixed: [...new Set([...get("fixed"), ...damperNames()])] });
}

/** Another car: sliders and baseline become its own. */
export async function take(vehicle, what) {
  try {
    const saved = (await api.saveVehicle(vehicle)) ?? vehicle;
    await api.saveBaseline(saved);
    holdDampers();
    set({ vehicle: saved, baseline: saved, values: valuesOf(saved) });
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
    h("div", { className: "known" }, GROUPS.map(([key, title]) =>
      h("fieldset", {}, h("legend", {}, title),
        vehicle[key]
          ? leaves(vehicle[key], key).filter((path) => !sliders.has(path)).map((path) =>
              lastWord(path) in CHOICES ? choice(vehicle, path) : entry(vehicle, path))
          : h("p", { className: "hint" }, "None, so nothing is learnt of a run that brakes. ",
              h("button", { type: "button", on: { click: addBrakes } }, "Add brakes"))))));
}

const lastWord = (path) => path.split(".").at(-1);

function choice(vehicle, path) {
  const [label, values] = CHOICES[lastWord(path)];
  const chosen = () => ({ [path]: values[select.selectedIndex][0] });
  const select = h("select", {
    on: { change: () => keep((car) => withValues(car, chosen()), show) },
  }, values.map(([value, word]) =>
    h("option", { selected: value === valueAt(vehicle, path) }, word)));
  return h("label", { className: "known-row", title: path }, h("span", {}, label), select);
}

async function addBrakes() {
  await keep((car) => ({ ...car, brakes: USUAL_BRAKES }), show);
  show();
}

function leaves(part, path) {
  return Object.entries(part).flatMap(([key, value]) => {
    const here = `${path}.${key}`;
    if (value && typeof value === "object" && !Array.isArray(value)) return leaves(value, here);
    return typeof value === "number" || key in CHOICES ? [here] : [];
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
  const restore = () => { field.value = units.plain(valueAt(get("vehicle"), path), 6); };
  if (Number.isFinite(value)) await keep((car) => withValues(car, { [path]: value }), restore);
  else restore();
}

let edits = Promise.resolve();
/** Edit the car of the sliders and the baseline alike; `restore` what is shown if it is refused. */
function keep(edit, restore) {
  edits = edits.then(() => save(edit, restore));
  return edits;
}

async function save(edit, restore) {
  const vehicle = edit(withValues(get("vehicle"), get("values")));
  const baseline = edit(get("baseline"));
  try {
    await api.saveVehicle(vehicle);
    await api.saveBaseline(baseline);
    own = true;
    set({ vehicle, baseline });
    own = false;
  } catch (error) {
    if (error.lost) set({ online: false });
    refused(error, "Changing the car");
    restore();
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

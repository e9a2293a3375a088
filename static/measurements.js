// Measured rides: add by button or by dropping files, with notes on their noise and with what was
// driven; look, delete.

import * as api from "./api.js";
import { $, breakable, h, inPlace } from "./dom.js";
import { lacks, nameOf, original } from "./names.js";
import { sentence } from "./noise.js";
import { notice } from "./notices.js";
import { AXIS, COLOURS, fitWidth } from "./plots.js";
import { choose } from "./ride.js";
import { settled } from "./simulation.js";
import { get, on, set } from "./store.js";
import * as units from "./units.js";

/** Names of what the service reads, as in engine/formats/readers.py; the content decides. */
const RECORDINGS = ".csv,.txt,.tsv,.dat,.asc,.mf4,.mdf,.mf3,.mat,.h5,.hdf5,.hdf,.tdms,.uff,.unv,.uf58,"
  + ".rsp,.rpc,.tim,.drv,.parquet,.erg,.zip,text/csv";

const PREVIEW_SAMPLES = 1500;

let selected = null;
let failures = [];
let plot = null;
let hooks = {};
const parts = {};

export function build(callbacks) {
  hooks = callbacks;
  parts.list = h("div");
  parts.detail = h("div", { className: "measurement-detail scrolls" });
  parts.file = h("input", {
    type: "file", id: "file", multiple: true, accept: RECORDINGS + ",.toml,.json", className: "hidden-file",
    "aria-label": "Measurement files",
    on: { change: () => { sort([...parts.file.files]); parts.file.value = ""; } },
  });
  $("#measurements").append(h("div", { className: "measurements" },
    h("div", { className: "measurement-list scrolls" }, parts.list, hooks.campaign), parts.detail));
  const drop = $("#drop");
  let depth = 0;
  const carriesFiles = (event) => event.dataTransfer?.types.includes("Files");
  const over = (change) => (event) => {
    if (!carriesFiles(event)) return;
    event.preventDefault();
    depth = Math.max(0, depth + change);
    drop.hidden = depth === 0;
  };
  document.addEventListener("dragenter", over(1));
  document.addEventListener("dragleave", over(-1));
  document.addEventListener("dragover", over(0));
  document.addEventListener("drop", (event) => {
    if (!carriesFiles(event)) return;
    event.preventDefault();
    depth = 0;
    drop.hidden = true;
    sort([...event.dataTransfer.files]);
  });
  on("measurements", show);
  show();
}

/** What tells of a recording lies beside it: NAME.toml and NAME.manoeuvre.json. */
const BESIDE = {
  notes: { end: /\.toml$/i, attach: api.attachNotes, told: "noise", say: sentence },
  manoeuvre: { end: /\.manoeuvre\.json$/i, attach: api.attachManoeuvre, told: "manoeuvre", say: driven },
};
const beside = ({ name }) => Object.values(BESIDE).find(({ end }) => end.test(name));

/** Another JSON file is a vehicle; all else belongs here. */
function sort(files) {
  const isVehicle = (file) => /\.json$/i.test(file.name) && !beside(file);
  files.filter(isVehicle).forEach(hooks.takeVehicle);
  const ours = files.filter((file) => !isVehicle(file));
  if (!ours.length) return;
  hooks.open();
  add(ours);
}

async function add(files) {
  failures = [];
  // What lies beside recordings comes after those that it may belong to.
  for (const file of [...files].sort((one, other) => Boolean(beside(one)) - Boolean(beside(other)))) {
    parts.busy = file.name;
    show();
    try {
      await (beside(file) ? attach(file, beside(file)) : take(file));
    } catch (error) {
      failures.push({ name: file.name, error });
      if (error.lost) set({ online: false });
    }
  }
  parts.busy = null;
  show();
  $(".problem", parts.list)?.scrollIntoView({ block: "nearest" });
}

async function take(file) {
  const row = await api.upload(file);
  const twin = get("measurements").find(({ sha256 }) => sha256 === row.sha256);
  if (twin) {
    await api.deleteMeasurement(row.id);
    selected = twin.id;
    notice("info", `${file.name} is already here`,
      `It holds the same data as ${nameOf(twin.id)}, byte for byte, and was not added again.`);
    return;
  }
  set({ measurements: [...get("measurements"), row] });
  selected = row.id;
  const { length } = row.warnings;
  const fit = row.usable_for_identification
    ? `${units.number(row.duration, 3)} s, with all that an identification needs`
    : lacks(row);
  notice(length || !row.usable_for_identification ? "warning" : "info", `${nameOf(row.id)} is in`,
    length ? `${fit}; but what was found in it raises doubts.` : `${fit}.`,
    length ? { label: `See ${warned(length)}`, run: () => showWarnings(row.id) } : null);
}

const warned = (count) => `${count} warning${count > 1 ? "s" : ""}`;

/** Lead to what is doubtful about a recording. */
function showWarnings(id) {
  hooks.open();
  selected = id;
  show();
  const list = $(".warnings", parts.detail);
  list.scrollIntoView({ block: "nearest" });
  list.focus({ preventScroll: true });
}

/** It tells of NAME.csv, of the newest where several are called so. */
async function attach(file, { end, attach: send, told, say }) {
  const stem = file.name.replace(end, "");
  const row = get("measurements").findLast(({ name }) => name.replace(/\.\w+$/, "") === stem);
  if (!row) {
    throw new Error(`No recording here is called ${stem}.csv, whose ${told} it could ` +
      "state; add the recording first, or with it.");
  }
  const noted = await send(row.id, file);
  changed(noted);
  selected = row.id;
  notice("info", `${file.name} belongs to ${nameOf(row.id)}`, say(noted));
}

function changed(row) {
  set({ measurements: get("measurements").map((one) => (one.id === row.id ? row : one)) });
}

/** What was driven in a recording. */
function driven({ manoeuvre }) {
  return manoeuvre ? `Driven: ${manoeuvre.name}.`
    : "What was driven is not known; add the NAME.manoeuvre.json beside its NAME.csv to tell.";
}

async function forget(row) {
  try {
    changed(await api.forgetManoeuvre(row.id));
  } catch (error) {
    if (error.lost) set({ online: false });
    else notice("error", `${row.name} keeps its manoeuvre`, error.message);
  }
}

function show() {
  const rows = get("measurements");
  if (!rows.some(({ id }) => id === selected)) selected = rows[0]?.id ?? null;
  inPlace(parts.list, () => parts.list.replaceChildren(
    h("div", { className: "row-tools" },
      h("button", { type: "button", id: "upload", on: { click: () => parts.file.click() } },
        "Add files …"),
      parts.file,
      h("span", { className: "hint" }, parts.busy ? `Reading ${parts.busy} …` : "or drop them here")),
    ...failures.map(({ name, error }) =>
      h("div", { className: "problem", role: "alert" },
        h("strong", {}, `${name} was not taken`), h("p", {}, error.message))),
    ...(rows.length ? [table(rows)] : [h("p", { className: "empty" },
      "No measurement yet. Add a CSV file whose header names channels and units, such as " +
      "“time [s],chassis.z [mm],wheel.fl.z [mm]”.")]),
  ));
  detail(rows.find(({ id }) => id === selected));
}

function table(rows) {
  return h("ul", { className: "pick" }, rows.map((row) => {
    const channels = row.channels.filter(({ name }) => name !== "time").length;
    return h("li", {}, h("button", {
      type: "button", "aria-pressed": row.id === selected,
      on: { click: () => { selected = row.id; show(); } },
    },
    h("span", { className: "name" }, breakable(nameOf(row.id))),
    h("span", { className: "soft" }, `${units.number(row.duration, 3)} s, every ` +
      `${units.number(1000 * row.sample_step, 3)} ms, ${channels} channels, ${origin(row)} `, badges(row))));
  }));
}

/** Where a recording is from; it tells those of one name apart. */
function origin(row) {
  const first = original(row);
  if (first) return `the same data as ${nameOf(first.id)}`;
  return row.sample ? "sample"
    : `added ${new Date(row.created).toLocaleString([], { dateStyle: "short", timeStyle: "short" })}`;
}

function badges(row) {
  const out = [];
  if (row.warnings.length) {
    out.push(h("span", { className: "badge warn", title: row.warnings.join("\n") },
      warned(row.warnings.length)));
  }
  if (!row.usable_for_identification) {
    out.push(h("span", { className: "badge", title: `${lacks(row)}.` },
      "not for fitting"));
  }
  return out;
}

function detail(row) {
  plot?.destroy();
  plot = null;
  if (!row) {
    parts.detail.replaceChildren();
    return;
  }
  const names = row.channels.map(({ name }) => name).filter((name) => name !== "time");
  const choice = h("select", { "aria-label": "Channel to look at" },
    names.map((name) => h("option", { value: name }, units.channel(name).label)));
  const drawing = h("div", { className: "preview" });
  const facts = h("p", { className: "hint" });
  choice.addEventListener("change", () => look(row, choice.value, drawing, facts));
  parts.detail.replaceChildren(
    h("div", { className: "row-tools" },
      h("strong", { className: "name" }, breakable(nameOf(row.id))),
      row.usable_for_identification
        ? h("button", { type: "button", on: { click: () => choose(`measurement ${row.id}`) } },
            "Use as ride")
        : null,
      h("a", { className: "button", href: api.originalUrl(row.id), download: row.name }, "Download"),
      h("button", { type: "button", className: "danger", on: { click: (event) => remove(row, event) } },
        "Delete")),
    h("div", { className: "row-tools" }, choice, facts),
    drawing,
    h("p", { className: "hint" }, sentence(row)),
    h("p", { className: "hint" }, driven(row), row.manoeuvre
      ? [" ", h("button", { type: "button", title: "It was another road, or another drive",
        on: { click: () => forget(row) } }, "Forget")] : null),
    ...(row.warnings.length
      ? [h("ul", { className: "warnings", tabIndex: -1 }, row.warnings.map((text) => h("li", {}, text)))] : []),
    ...(row.usable_for_identification ? [] : [h("p", { className: "hint" }, `${lacks(row)}.`)]),
  );
  if (names.length) look(row, choice.value, drawing, facts);
}

/** The last preview asked for; a file is not deleted under its reader. */
let looking = Promise.resolve();
function look(...what) {
  looking = preview(...what);
}

async function preview(row, name, drawing, facts) {
  const { display_factor: factor, display_unit: unit } = units.channel(name);
  const stated = row.channels.find((channel) => channel.name === name);
  facts.textContent = `${units.number(stated.minimum * factor, 3)} to ` +
    `${units.number(stated.maximum * factor, 3)} ${unit}`;
  let run;
  try {
    run = await api.measurement(row.id, [name], PREVIEW_SAMPLES, "extremes");
  } catch (error) {
    facts.textContent = error.message;
    return;
  }
  if (row.id !== selected || !drawing.isConnected) return;
  plot?.destroy();
  plot = new window.uPlot({
    width: Math.max(drawing.clientWidth, 200), height: 132, legend: { show: false },
    scales: { x: { time: false } }, cursor: { show: false }, padding: [6, 10, 0, 0],
    axes: [{ ...AXIS, size: 26, gap: 3 }, { ...AXIS, size: 46, gap: 4 }],
    series: [{}, { stroke: COLOURS.measured, width: 1.2, points: { show: false } }],
  }, [Array.from(run.time), Array.from(run.values[name], (v) =>
    (Number.isFinite(v) ? v * factor : null))], drawing);
  fitWidth(plot, drawing);
}

/** Deleting asks once, in place. */
async function remove(row, event) {
  const button = event.currentTarget;
  if (button.dataset.sure !== "yes") {
    button.dataset.sure = "yes";
    button.textContent = "Really delete?";
    button.addEventListener("blur", () => { button.dataset.sure = ""; button.textContent = "Delete"; });
    return;
  }
  // The page lets go of the file first: nothing may still be asking for it when it is deleted.
  set({ measurements: get("measurements").filter(({ id }) => id !== row.id) });
  ($(".pick [aria-pressed=true]", parts.list) ?? $("#upload")).focus();
  await looking;
  await settled();
  try {
    await api.deleteMeasurement(row.id);
  } catch (error) {
    set({ measurements: [...get("measurements"), row] });
    if (error.lost) set({ online: false });
    else notice("error", `${row.name} stays`, error.message);
  }
}

// Measured rides: add by button or by dropping files, with notes on their noise and with what was
// driven; see how far each is on its way from file to run; look, delete.

import * as api from "../common/api.js";
import { $, breakable, capital, h, inPlace, when } from "../common/dom.js";
import { Misplaced, RECORDINGS, kindOfJson, requireNotes } from "../common/file_kinds.js";
import { dataOf, drivenBy, lacks, nameOf, original } from "../common/names.js";
import { notice } from "../common/notices.js";
import { AXIS, COLOURS, fitWidth } from "../common/plots.js";
import { get, on, set } from "../common/store.js";
import * as units from "../common/units.js";
import { choose } from "../ride/ride.js";
import { settled } from "../ride/simulation.js";
import * as intake from "./intake.js";
import { sentence } from "./noise.js";
import { nextStage, stagesOf, stepper } from "./stages.js";

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

/** A vehicle is for the car; all else belongs here. */
async function sort(files) {
  const ours = [], refusals = [];
  for (const file of files) {
    if (!/\.json$/i.test(file.name) || beside(file)) {
      ours.push(file);
      continue;
    }
    try {
      const { kind, data } = await kindOfJson(file);
      if (kind === "vehicle") hooks.takeVehicle(file);
      else await keepMapping(file, data);
    } catch (error) {
      refuse(refusals, file, error);
    }
  }
  if (!ours.length && !refusals.length) return;
  hooks.open();
  add(ours, refusals);
}

/** Note why a file was not taken; what went wrong in the page itself is no reason of the file's. */
function refuse(refusals, { name }, error) {
  if (error.lost) set({ online: false });
  if (error instanceof api.Refusal || error instanceof Misplaced) refusals.push({ name, error });
  else reportError(error);
}

/** A mapping file becomes a template. */
async function keepMapping({ name }, data) {
  const stem = name.replace(/\.json$/i, "");
  await api.keepMapping(stem, data);
  notice("info", `${name} is kept as the mapping ${stem}`, "It is proposed for files with its columns.");
}

async function add(files, refusals) {
  failures = refusals;
  // What lies beside recordings comes after those that it may belong to.
  for (const file of [...files].sort((one, other) => Boolean(beside(one)) - Boolean(beside(other)))) {
    parts.busy = file.name;
    show();
    try {
      await (beside(file) ? attach(file, beside(file)) : take(file));
    } catch (error) {
      refuse(failures, file, error);
    }
  }
  parts.busy = null;
  show();
  $(".problem", parts.list)?.scrollIntoView({ block: "nearest" });
}

async function take(file) {
  const row = await api.upload(file);
  const twin = get("measurements").find((one) => one.sha256 === row.sha256 && dataOf(one) === dataOf(row));
  if (twin) {
    await api.deleteMeasurement(row.id);
    selected = twin.id;
    notice("info", `${file.name} is already here`,
      `It holds the same data as ${nameOf(twin.id)}, byte for byte, and was not added again.`);
    return;
  }
  set({ measurements: [...get("measurements"), row] });
  selected = row.id;
  const stage = nextStage(row);
  const first = original(row);
  const copied = first ? [`It holds the same data as ${nameOf(first.id)} and is left out of fits until its use is ` +
    "chosen; fitted beside the other it would count twice."] : [];
  if (stage !== "ready") {
    parts.dismiss = notice("warning", `${nameOf(row.id)} is in`, [stageTold(row, stage), ...copied].join(" "),
      { label: toDo(row, stage), run: () => { hooks.open(); show(); intake.open(row.id, stage); } });
    return;
  }
  const { length } = row.warnings;
  const fit = `${units.number(row.duration, 3)} s, with all that an identification needs`;
  const said = length ? `${fit}; but what was found in it raises doubts.` : `${fit}.`;
  notice(length || first ? "warning" : "info", `${nameOf(row.id)} is in`, [said, ...copied].join(" "),
    length ? { label: `See ${warned(length)}`, run: () => showWarnings(row.id) } : null);
}

/** The next thing to do at a stage. */
const toDo = ({ needs_mapping: unmapped }, stage) =>
  stage === "conditioning" ? "Condition" : unmapped ? "Map columns" : "Check signs";

/** What is told of a recording's stage. */
const stageTold = (row, stage) => stagesOf(row).find(({ key }) => key === stage).told;

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
  if (told === "noise") await requireNotes(file);
  const stem = file.name.replace(end, "");
  const row = get("measurements").findLast(({ name }) => name.replace(/\.\w+$/, "") === stem);
  if (!row) {
    throw new Misplaced(`No recording here is called ${stem}.csv, whose ${told} it could ` +
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
      "No measurement yet. Add a recording: CSV, MDF, MAT, HDF5, TDMS, UFF58, RPC III, Parquet or " +
      "CarMaker ERG. Its columns may have any names; the page helps to map them to channels.")]),
  ));
  detail(rows.find(({ id }) => id === selected));
}

function table(rows) {
  return h("ul", { className: "pick" }, rows.map((row) => {
    const channels = row.channels.filter(({ name }) => name !== "time").length;
    const size = row.needs_mapping ? `${row.samples.toLocaleString("en")} sample${row.samples === 1 ? "" : "s"}`
      : `${units.number(row.duration, 3)} s, every ${units.number(1000 * row.sample_step, 3)} ms, ${channels} channels`;
    return h("li", {}, h("button", {
      type: "button", "aria-pressed": row.id === selected,
      on: { click: () => { selected = row.id; show(); } },
    },
    h("span", { className: "name" }, breakable(nameOf(row.id))),
    h("span", { className: "soft" }, `${size}, ${origin(row)} `, badges(row))));
  }));
}

/** Where a recording is from; it tells those of one name apart. */
function origin(row) {
  const first = original(row);
  if (first) return `the same data as ${nameOf(first.id)}`;
  return row.sample ? "sample"
    : `added ${when(row.created)}`;
}

/** What is doubtful in a file; that its columns are not mapped is no doubt, and comes first. */
const doubtsOf = ({ needs_mapping: unmapped, warnings }) => (unmapped ? warnings.slice(1) : warnings);

function badges(row) {
  const out = [];
  const doubts = doubtsOf(row);
  if (doubts.length) {
    out.push(h("span", { className: "badge warn", title: doubts.join("\n") }, warned(doubts.length)));
  }
  if (row.needs_mapping) {
    out.push(h("span", { className: "badge to-do", title: `${lacks(row)}.` }, "needs mapping"));
  } else if (!row.usable_for_identification) {
    out.push(h("span", { className: "badge", title: `${lacks(row)}.` }, "not for fitting"));
  }
  const signs = row.sign_suggestions.length;
  if (signs) {
    out.push(h("span", { className: "badge to-do", title: row.sign_suggestions.map(({ sentence }) => sentence).join("\n") },
      `check ${signs} sign${signs > 1 ? "s" : ""}`));
  }
  const steps = [...(row.conditioned ?? []).map(({ step }) => step), ...(row.conditioning ?? [])];
  if (steps.length) {
    out.push(h("span", { className: "badge", title: steps.map(({ kind }) => kind).join(", ") }, "conditioned"));
  }
  return out.flatMap((badge) => [badge, " "]);
}

function detail(row) {
  plot?.destroy();
  plot = null;
  if (!row) {
    parts.detail.replaceChildren();
    return;
  }
  const names = row.channels.map(({ name }) => name).filter((name) => name !== "time");
  const stage = nextStage(row);
  const work = (key) => {
    parts.dismiss?.();
    intake.open(row.id, key);
  };
  const choice = h("select", { "aria-label": "Channel to look at" },
    names.map((name) => h("option", { value: name }, units.channel(name).label)));
  const drawing = h("div", { className: "preview" });
  const facts = h("p", { className: "hint" });
  choice.addEventListener("change", () => look(row, choice.value, drawing, facts));
  parts.detail.replaceChildren(...[
    h("div", { className: "row-tools" },
      h("strong", { className: "name" }, breakable(nameOf(row.id))),
      stage === "ready" ? null : h("button", { type: "button", className: "primary", id: "next-stage",
        on: { click: () => work(stage) } }, toDo(row, stage)),
      row.usable_for_identification
        ? h("button", { type: "button", className: stage === "ready" ? "primary" : "",
            on: { click: () => choose(`measurement ${row.id}`) } }, "Use as ride")
        : null,
      row.needs_mapping || stage === "channels" ? null
        : h("button", { type: "button", on: { click: () => work("channels") } }, "Mapping"),
      row.needs_mapping || stage === "conditioning" ? null
        : h("button", { type: "button", on: { click: () => work("conditioning") } }, "Conditioning"),
      h("button", { type: "button", className: "danger", on: { click: (event) => remove(row, event) } },
        "Delete")),
    stepper(row, work),
    downloads(row),
    stage === "ready" ? null
      : h("p", { className: "hint" }, stageTold(row, stage)),
    ...(names.length ? [h("div", { className: "row-tools" }, choice, facts), drawing] : []),
    h("p", { className: "hint" }, sentence(row)),
    row.plant ? h("p", { className: "hint" }, capital(`${drivenBy(row)}.`)) : null,
    h("p", { className: "hint" }, driven(row), row.manoeuvre
      ? [" ", h("button", { type: "button", title: "It was another road, or another drive",
        on: { click: () => forget(row) } }, "Forget")] : null),
    ...(doubtsOf(row).length
      ? [h("ul", { className: "warnings", tabIndex: -1 }, doubtsOf(row).map((text) => h("li", {}, text)))] : []),
  ].filter(Boolean));
  if (names.length) look(row, choice.value, drawing, facts);
}

/** The file as it came, and what was made of it, for the command line and other programs. */
function downloads(row) {
  const link = (text, href, title) => [" ", h("a", { href, download: "", title, "aria-label": `Download ${text}` }, text)];
  return h("p", { className: "hint", id: "downloads" }, "Download",
    link("original", api.originalUrl(row.id), "The file as it was added, byte for byte"),
    row.needs_mapping ? null : [
      link("CSV", api.runUrl(row.id), "The recording as it is used, conditioned if it is, in SI"),
      link("notes", api.notesUrl(row.id), "Its noise and what was done to it, to lie beside the CSV"),
    ].flat(),
    row.mapping ? link("mapping", api.mappingUrl(row.id),
      "Which columns are which channels, for --mapping on the command line") : null);
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
    width: Math.max(drawing.clientWidth, 200), height: 144, legend: { show: false },
    scales: { x: { time: false } }, cursor: { show: false }, padding: [6, 10, 0, 0],
    axes: [{ ...AXIS, size: 22, gap: 2, label: "time, s", labelFont: AXIS.font, labelSize: 14, labelGap: 0 },
      { ...AXIS, size: 46, gap: 4 }],
    series: [{}, { stroke: COLOURS.measured, width: 1.2, points: { show: false } }],
  }, [Array.from(run.time), Array.from(run.values[name], (v) =>
    (Number.isFinite(v) ? v * factor : null))], drawing);
  fitWidth(plot, drawing);
}

/** Once nothing is asked of the service for what is on show. */
export async function atRest() {
  await looking;
  await settled();
}

let deleting = Promise.resolve();
/** Once the service has deleted what the page has let go of. */
export const deleted = () => deleting;

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
  deleting = letGo(row);
  await deleting;
}

async function letGo(row) {
  await atRest();
  try {
    await api.deleteMeasurement(row.id);
  } catch (error) {
    set({ measurements: [...get("measurements"), row] });
    if (error.lost) set({ online: false });
    else notice("error", `${row.name} stays`, error.message);
  }
}

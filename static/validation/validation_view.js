// A validation as the page and the report show it: tables and the figures of the paper, redrawn.

import { h, symbol } from "../common/dom.js";
import { span } from "../common/intervals.js";
import { COLOURS } from "../common/plots.js";
import * as units from "../common/units.js";
import { worded } from "../common/wording.js";
import { figure } from "./figure.js";

const OUTPUTS = ["chassis.z", "chassis.pitch", "chassis.roll"];
const CORNERS = ["fl", "fr", "rl", "rr"];
const MODELS = { "8dof": "8-DOF", "7dof": "7-DOF" };
const MODES = { rims: "recorded rims", road: "road and torque" };
const ROLES = { fit: "fitted", "hold-out": "held out" };
const LOOK = {
  "8dof": { stroke: COLOURS.now, width: 1.5 },
  "7dof": { stroke: COLOURS.reference, width: 1.3, dash: [6, 4] },
};
/** Okabe and Ito's colours, and dashes for the rear, so that not the colour alone tells them. */
const WHEELS = {
  fl: { stroke: "#0072b2" }, fr: { stroke: "#d55e00" },
  rl: { stroke: "#009e73", dash: [5, 3] }, rr: { stroke: "#cc79a7", dash: [5, 3] },
};
const ROAD_COLOURS = ["#0072b2", "#d55e00"];
/** How recordings were prepared, as the set-up of an identification calls it. */
const SETTINGS = {
  a_x_cutoff_hz: "Low-pass of aₓ, Hz", rim_cutoff_hz: "Low-pass of wheels, Hz",
  output_cutoff_hz: "Low-pass of z, pitch, roll, Hz",
  output_highpass_hz: "High-pass of z, pitch, roll, Hz", initial_state: "Initial state",
  step: "Longest step, s",
};
const WELL = { yes: "well", weakly: "weakly", no: "not" };

/** Sections of a validation's document; `width` of the figures in px, null to follow their box. */
export function sections(document, width = null) {
  return [
    section("summary", "How well the car predicts", scores(document), leftOut(document), covered(document),
      squats(document)),
    section("parameters", "Identified parameters", h("p", {}, document.fit.outcome),
      estimates(document)),
    warnings(document),
    ...document.runs.map((run) => section("run", `${run.name}, ${ROLES[run.role]}`,
      h("p", { className: "soft" }, described(run)), figures(run, document, width))),
    section("made", "How this was made", made(document)),
  ].filter(Boolean);
}

const section = (className, title, ...content) =>
  h("section", { className }, h("h2", {}, title), content.flat());

const described = (run) => `${units.number(run.duration, 4)} s, ${run.samples} samples. ` +
  (run.manoeuvre ? `Manoeuvre: ${run.manoeuvre.name}.`
    : "Its manoeuvre is not known, so it is predicted from the recorded rims alone.");

const shown = (name, value, digits = 3) =>
  units.number(value === null ? NaN : value * units.channel(name).display_factor, digits);

/** Why a run says little of the car; documents of earlier versions do not tell. */
const findingsOf = ({ findings = [] }) => findings;

/** Fit percent, rms error and rating of every prediction. */
function scores({ runs }) {
  const heads = OUTPUTS.map((name) => units.channel(name));
  const short = (name) => name.replace("chassis.", "");
  return h("div", { className: "wide-table" }, h("table", { className: "validation-scores" },
    h("thead", {},
      h("tr", {}, h("th", { rowSpan: 2, scope: "col" }, "Run, driven by"),
        h("th", { rowSpan: 2, scope: "col" }, "Model"),
        OUTPUTS.map((name) => h("th", { colSpan: 3, scope: "colgroup" }, short(name)))),
      h("tr", {}, heads.flatMap(({ display_unit: unit }) => [
        h("th", { scope: "col" }, "fit %"), h("th", { scope: "col" }, `rms, ${unit}`),
        h("th", { scope: "col", title: "ISO/TS 18571, 1 is identical" }, "rating")]))),
    runs.map((run) => h("tbody", {},
      h("tr", {}, h("th", { colSpan: 2 + 3 * OUTPUTS.length, scope: "rowgroup" },
        `${run.name}, ${ROLES[run.role]}`)),
      findingsOf(run).map((text) => h("tr", {},
        h("td", { colSpan: 2 + 3 * OUTPUTS.length, className: "said doubt" }, worded(text)))),
      run.predictions.map((one) => scoreRow(one))))));
}

function scoreRow(one) {
  const cells = one.failure
    ? h("td", { colSpan: 3 * OUTPUTS.length, className: "said" }, worded(one.failure))
    : OUTPUTS.flatMap((name) => {
      const score = one.scores[name];
      if (!score) return ["–", "–", "–"].map((text) => h("td", {}, text));
      return [
        h("td", { className: "strong" }, score.fit_percent === null ? "–" : units.fixed(score.fit_percent, 1)),
        h("td", {}, shown(name, score.rms_error)),
        h("td", {}, score.rating ? units.fixed(score.rating.overall, 2) : "–"),
      ];
    });
  return h("tr", { className: one.model === "7dof" ? "soft" : "" },
    h("td", {}, MODES[one.mode]), h("td", {}, MODELS[one.model]), cells);
}

/** How much of each output lies within the error band of its prediction, widened by the noise. */
function covered({ runs }) {
  const rows = runs.flatMap((run) => run.predictions
    .filter(({ scores: of }) => OUTPUTS.some((name) => (of[name]?.coverage ?? null) !== null))
    .map((one) => [run, one]));
  if (!rows.length) return null;
  const share = (score) => ((score?.coverage ?? null) === null ? "–" : units.fixed(100 * score.coverage, 1));
  return [
    h("h3", {}, "Within the error band"),
    h("table", { className: "coverage" },
      h("thead", {}, h("tr", {}, h("th", { scope: "col" }, "Samples within, %"), h("th", { scope: "col" }, "driven by"),
        OUTPUTS.map((name) => h("th", { scope: "col" }, name.replace("chassis.", ""))))),
      h("tbody", {}, rows.map(([run, one]) => h("tr", {},
        h("th", { scope: "row" }, `${run.name}, ${ROLES[run.role]}`), h("td", {}, MODES[one.mode]),
        OUTPUTS.map((name) => h("td", {}, share(one.scores[name]))))))),
    h("p", { className: "hint" }, "Share of the samples that lie within the 95 % band of the 8-DOF prediction by the " +
      "errors of the fit, widened by 1.96 times what the output filter leaves of the channel’s noise, were it white. " +
      "It is about 95 % where model, errors and noise are right, less where the model misses something or filtered " +
      "noise is slow, and more where the noise is stated too large."),
  ];
}

function leftOut({ made: { left_out: names = [] } }) {
  return names.length ? h("p", { className: "hint" }, `Neither fitted nor held out: ${names.join(", ")}.`) : null;
}

/** The step of the pitch while the car accelerates: what the 7-DOF model cannot give on a road. */
function squats({ runs }) {
  const squatting = runs.filter(({ squat }) => squat);
  if (!squatting.length) return null;
  const degrees = (value) =>
    (value === null ? "–" : units.fixed(value * units.channel("chassis.pitch").display_factor, 3));
  const kinds = [["rims", "8dof"], ["rims", "7dof"], ["road", "8dof"], ["road", "7dof"]]
    .filter(([mode, model]) => squatting.some((run) => find(run, mode, model)));
  return [
    h("h3", {}, "Squat"),
    h("table", { className: "squats" },
      h("thead", {}, h("tr", {}, h("th", { scope: "col" }, "Pitch step, deg"), h("th", { scope: "col" }, "measured"),
        kinds.map(([mode, model]) => h("th", { scope: "col" }, `${MODELS[model]}, ${mode}`)))),
      h("tbody", {}, squatting.map((run) => h("tr", {}, h("th", { scope: "row" }, run.name),
        h("td", { className: "strong" }, degrees(run.squat.step)),
        kinds.map(([mode, model]) => h("td", {}, degrees(find(run, mode, model)?.squat ?? null))))))),
    h("p", { className: "hint" }, "Mean pitch in the later half of the acceleration less that at rest " +
      "before it; negative with the nose up. Driven by the recorded rims, the 7-DOF model sees the " +
      "axles' share of it; on a road it has no longitudinal motion and does not squat."),
  ];
}

const find = (run, mode, model) =>
  run.predictions.find((one) => one.mode === mode && one.model === model);

/** The parameters with their error bars, beside where the pivots lie by geometry. */
function estimates({ fit, geometry }) {
  const measured = Object.keys(geometry).length > 0;
  const head = ["Parameter", "Value", "± (95 %)", "Unit", ...(measured ? ["By geometry"] : []),
    "Searched between", "Determined"];
  return h("div", { className: "wide-table" }, h("table", { className: "validation-estimates" },
    h("thead", {}, h("tr", {}, head.map((text) =>
      h("th", { scope: "col", className: text === "Unit" ? "unit" : "" }, text)))),
    h("tbody", {}, fit.parameters.map((one) => {
      const row = units.parameter(one.name);
      const number = (value, digits) => units.number(value === null ? NaN : value * row.display_factor, digits);
      const [lower, upper] = one.confidence_interval;
      const open = lower === null || upper === null;
      return h("tr", {},
        h("th", { scope: "row", title: row.label }, symbol(row.symbol), " ",
          h("span", { className: "long" }, row.label)),
        h("td", { className: "strong" }, number(one.value)),
        h("td", {}, open ? span([lower, upper], row.display_factor) : number((upper - lower) / 2, 2)),
        h("td", { className: "unit" }, row.display_unit),
        measured ? h("td", {}, one.name in geometry ? number(geometry[one.name]) : "") : null,
        h("td", { className: "soft" }, `${number(one.lower, 3)} … ${number(one.upper, 3)}`),
        h("td", {}, h("span", { className: `determined ${one.determined}` },
          one.at_bound ? "at its bound" : WELL[one.determined])));
    }))));
}

/** What is doubtful, but for what stands beside the scores. */
function warnings({ fit, runs }) {
  const said = [...fit.warnings, ...runs.flatMap(({ name, predictions, ...run }) =>
    predictions.flatMap((one) => one.warnings.filter((text) => !findingsOf(run).includes(text)).map((text) =>
      (text.includes(name) ? text : `${name}: ${text}`))))];
  const texts = [...new Set(said)];
  if (!texts.length) return null;
  return section("found", "Warnings",
    h("ul", { className: "warnings" }, texts.map((text) => h("li", {}, worded(text)))));
}

/** Figs. 8 to 10 and 12 of the paper from one run's data. */
function figures(run, document, width) {
  const { time, measured, predictions } = run;
  const drawn = [];
  const add = (wanted) => drawn.push(figure({ x: time, xLabel: "time, s", width, ...wanted }));
  if (run.road.length) drawn.push(roadFigure(run, document.road_classes, width));
  const torques = predictions.filter(({ model }) => model === "8dof").map((one) => ({
    label: one.mode === "rims" ? "as the rims' model infers" : "of the manoeuvre",
    y: total(one.values), ...LOOK[one.mode === "rims" ? "8dof" : "7dof"],
  })).filter(({ y }) => y);
  if (torques.length) add({ title: "Drive torque of all wheels", unit: "N m", lines: torques });
  const along = measured["chassis.v_x"] ? "chassis.v_x" : "chassis.a_x";
  add(channelFigure(along, [measuredLine(along, measured)]));
  add({ title: "Rim centres, vertical", unit: units.channel("wheel.fl.z").display_unit,
    lines: CORNERS.map((corner) => ({ label: corner, width: 1,
      y: display(`wheel.${corner}.z`, measured[`wheel.${corner}.z`]), ...WHEELS[corner] })) });
  for (const name of OUTPUTS.filter((output) => measured[output])) {
    for (const mode of Object.keys(MODES)) {
      const driven = predictions.filter((one) => one.mode === mode);
      if (!driven.length) continue;
      add(channelFigure(name, [measuredLine(name, measured),
        ...[...driven].reverse().filter(({ values }) => values[name]).map((one) => ({
          label: `${MODELS[one.model]}, ${percent(one.scores[name])}`, y: display(name, one.values[name]),
          ...LOOK[one.model] }))], ` from ${MODES[mode]}`, bandOf(name, driven)));
    }
  }
  return h("div", { className: "figures" }, drawn);
}

const percent = (score) =>
  (score?.fit_percent === null || !score ? "–" : `${units.fixed(score.fit_percent, 1)} %`);

const display = (name, values) => {
  const { display_factor: factor } = units.channel(name);
  return values.map((value) => (value === null ? null : value * factor));
};

const measuredLine = (name, measured) =>
  ({ label: "measured", y: display(name, measured[name]), stroke: COLOURS.measured, width: 1 });

function channelFigure(name, lines, more = "", band = null) {
  const { label, display_unit: unit } = units.channel(name);
  return { title: `${label}${more}`, unit, lines, band };
}

/** The error band of an output by whichever model has one, or null. */
function bandOf(name, predictions) {
  const values = predictions.map((one) => one.values).find((of) => of[`${name}.lower`]);
  return values ? { label: "95 % error band", lower: display(name, values[`${name}.lower`]),
    upper: display(name, values[`${name}.upper`]) } : null;
}

/** Sum of the drive torques, N m; null where the model gives none. */
function total(values) {
  const wheels = CORNERS.map((corner) => values[`drive.${corner}.torque`]).filter(Boolean);
  return wheels.length ? wheels[0].map((_, i) => wheels.reduce((sum, wheel) => sum + wheel[i], 0)) : null;
}

/** The road's spectrum with the limits between ISO 8608's classes. */
function roadFigure(run, { reference_frequency: n0, upper_limits: limits }, width) {
  const tracks = run.road.flatMap(({ begin, end, frequency, left, right }, i) =>
    [["left", left, []], ["right", right, [5, 3]]].map(([side, y, dash]) => ({
      label: `${side}, ${units.number(begin, 3)} to ${units.number(end, 3)} m`,
      x: frequency, y, stroke: ROAD_COLOURS[i % 2], dash, width: 1.4 })));
  const all = tracks.flatMap(({ y }) => y).filter((v) => v > 0);
  const x = [0.01, 10];
  const y = [10 ** Math.floor(Math.log10(Math.min(...all))), 10 ** Math.ceil(Math.log10(Math.max(...all)))];
  const bounds = Object.values(limits).map((limit) => ({
    x, y: x.map((n) => limit * (n / n0) ** -2), stroke: COLOURS.measured, width: 0.6 }));
  const drawn = figure({ title: "Road, spectral density of the height by distance", unit: "m³",
    xLabel: "spatial frequency, cycle/m", lines: [...tracks, ...bounds], log: true,
    range: { x: () => x, y: () => y }, width });
  drawn.append(h("p", { className: "hint" }, "Thin lines: limits between the classes of ISO 8608, " +
    "the lowest between A and B."));
  return drawn;
}

/** Vehicle, runs, settings, versions and date. */
function made({ made: how, fit, settings, traction }) {
  const facts = [
    ["Vehicle", fit.vehicle.name],
    ["Date", how.date],
    ["Versions", Object.entries(how.versions).map(([name, version]) => `${name} ${version}`).join(", ")],
    ["Traction", traction],
    ...Object.entries(SETTINGS).map(([name, text]) => [text, String(settings[name] ?? "none")]),
    ["Identification", `${fit.simulations} simulations, cost ${units.number(fit.cost)}`],
  ];
  return [
    h("table", { className: "facts" }, h("tbody", {}, facts.map(([name, value]) =>
      h("tr", {}, h("th", { scope: "row" }, name), h("td", {}, value))))),
    h("table", { className: "facts" },
      h("thead", {}, h("tr", {}, h("th", { scope: "col" }, "Recording"), h("th", { scope: "col" }, "SHA-256"))),
      h("tbody", {}, how.recordings.map(({ name, sha256 }) =>
        h("tr", {}, h("th", { scope: "row" }, name), h("td", { className: "hash" }, sha256))))),
  ];
}

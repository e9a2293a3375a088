// One figure of a validation: a titled plot of lines over time or frequency, with its legend.

import { h } from "../common/dom.js";
import { AXIS, COLOURS, decadeLabels, decades, fitWidth, room } from "../common/plots.js";

const HEIGHT = 140;
const LOG_HEIGHT = 240;

/**
 * An element with a plot. lines: {label, x, y, stroke, width, dash}; all share `x` unless they bring
 * their own. band: {label, lower, upper}, filled, or null. `log` is for both axes. `width` in px, or null to
 * follow the element's box.
 */
export function figure({ title, unit, xLabel, x, lines, band = null, log = false, range = null, width }) {
  const element = h("figure", { className: "figure" },
    h("figcaption", {}, h("span", {}, `${title} `, h("span", { className: "unit" }, unit)),
      h("span", { className: "legend-line" }, lines.filter(({ label }) => label).map(legendKey), band ? bandKey(band) : null)));
  const height = log ? LOG_HEIGHT : HEIGHT;
  const plot = new window.uPlot({
    width: width ?? 300, height, legend: { show: false }, cursor: { show: false },
    padding: [8, 14, 0, 0],
    scales: log ? { x: { time: false, distr: 3, range: range.x }, y: { distr: 3, range: range.y } }
      : { x: { time: false }, y: { range: room } },
    axes: [
      { ...AXIS, size: 22, gap: 2, label: xLabel, labelFont: AXIS.font, labelSize: 14, labelGap: 0,
        ...(log ? decadeAxis((splits) => splits) : {}) },
      { ...AXIS, size: 50, gap: 4, space: 22, ...(log ? decadeAxis(decadeLabels) : {}) },
    ],
    series: [{}, ...lines.map(({ label, stroke, width: thick, dash }) => ({
      label, stroke, width: thick ?? 1.2, dash: dash ?? [], points: { show: false }, spanGaps: true,
    })), ...(band ? ["lower", "upper"].map((label) => ({ label, width: 0, points: { show: false } })) : [])],
    bands: band ? [{ series: [lines.length + 2, lines.length + 1], fill: COLOURS.band }] : [],
  }, [...joined(x, lines), ...(band ? [band.lower, band.upper] : [])], element);
  plot.root.setAttribute("role", "img");
  plot.root.setAttribute("aria-label", `${title}, ${unit}, over ${xLabel}`);
  if (!width) fitWidth(plot, element);
  return element;
}

const decadeAxis = (values) => ({
  filter: (_, splits) => splits,
  splits: (_, _axis, low, high) => decades(low, high),
  values: values === decadeLabels ? decadeLabels : (_, splits) => splits.map((v) => String(v)),
});

function legendKey({ label, stroke, dash }) {
  const line = h("span", { className: "swatch" });
  line.style.borderTop = `2px ${dash?.length ? "dashed" : "solid"} ${stroke}`;
  return h("span", { className: "key-line" }, line, label);
}

function bandKey({ label }) {
  const field = h("span", { className: "swatch" });
  field.style.borderTop = `8px solid ${COLOURS.band}`;
  field.style.verticalAlign = "baseline";
  return h("span", { className: "key-line" }, field, label);
}

/** uPlot's columns: one x for all; lines that bring their own get gaps at the others' places. */
function joined(x, lines) {
  if (x) return [x, ...lines.map(({ y }) => y)];
  return window.uPlot.join(lines.map((line) => [line.x, line.y]));
}

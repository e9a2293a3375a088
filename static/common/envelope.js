// Small plots of a history: least and greatest value in stretches, or two histories over each other.

import { h } from "./dom.js";
import { AXIS, COLOURS, fitWidth } from "./plots.js";

const LABEL = { labelSize: 15, labelFont: AXIS.font, labelGap: 0 };

const axes = (xLabel, yLabel) => [
  { ...AXIS, ...LABEL, size: 24, gap: 2, label: xLabel },
  { ...AXIS, ...LABEL, size: 50, gap: 4, label: yLabel },
];

function draw(box, height, series, data, labels, more = {}) {
  const plot = new window.uPlot({
    width: Math.max(box.clientWidth, 200), height, legend: { show: false },
    scales: { x: { time: false } }, cursor: { show: false }, padding: [8, 12, 0, 0],
    axes: axes(...labels), series: [{}, ...series], ...more,
  }, data, box);
  fitWidth(plot, box);
  return plot;
}

/** Between least and greatest value; `factor` turns the file's numbers into those shown. */
export function envelope(box, { time, minimum, maximum }, factor, labels, height = 180) {
  const scaled = (values) => values.map((value) => (value === null ? null : value * factor));
  const [low, high] = factor < 0 ? [maximum, minimum] : [minimum, maximum];
  const line = { stroke: COLOURS.measured, width: 1.2, points: { show: false } };
  return draw(box, height, [line, line], [time, scaled(low), scaled(high)], labels,
    { bands: [{ series: [2, 1], fill: `${COLOURS.measured}40` }] });
}

/** Two runs of one channel, each on its own times: as recorded, and conditioned. */
export function beforeAndAfter(box, before, after, factor, labels, height = 260) {
  const table = ({ time, values }) => [Array.from(time),
    Array.from(values, (value) => (Number.isFinite(value) ? value * factor : null))];
  const there = [before, after].filter(Boolean);
  const series = [
    before && { stroke: COLOURS.measured, width: after ? 2.4 : 1.2, points: { show: false } },
    after && { stroke: COLOURS.now, width: 1.2, points: { show: false } },
  ].filter(Boolean);
  const data = there.length > 1 ? window.uPlot.join(there.map(table)) : table(there[0]);
  return draw(box, height, series, data, labels);
}

/** The legend of `beforeAndAfter`. */
export const legend = (before, after) => h("p", { className: "legend-line" },
  before ? h("span", { className: "key measured" }, "as recorded") : null,
  after ? h("span", { className: "key now" }, "conditioned") : null);

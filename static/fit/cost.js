// The cost over the steps of a fit, on a logarithmic scale.

import { h } from "../common/dom.js";
import { AXIS, decadeLabels, decades, fitWidth } from "../common/plots.js";

/** {element, show(history)}. */
export function costChart(height) {
  const element = h("div", { className: "cost", role: "img", "aria-label": "Cost over the steps" });
  element.style.minHeight = `${height}px`;
  let plot = null;
  const show = (history) => {
    if (!element.isConnected || !history.length) return;
    const data = [history.map((_, i) => i + 1), history];
    if (plot) {
      plot.setData(data);
      return;
    }
    plot = new window.uPlot({
      width: Math.max(element.clientWidth, 120), height, legend: { show: false },
      cursor: { show: false }, padding: [6, 10, 0, 0],
      scales: { x: { time: false }, y: { distr: 3 } },
      axes: [
        { ...AXIS, size: 22, gap: 2, incrs: [1, 2, 5, 10, 20, 50, 100, 200, 500] },
        { ...AXIS, size: 40, gap: 2, filter: (_, splits) => splits,
          splits: (_, _axis, low, high) => decades(low, high),
          values: decadeLabels },
      ],
      series: [{}, { stroke: AXIS.stroke, width: 1.5, points: { show: true, size: 4 } }],
    }, data, element);
    fitWidth(plot, element);
  };
  return { element, show };
}

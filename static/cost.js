// The cost over the steps of a fit, on a logarithmic scale.

import { h } from "./dom.js";

const HEIGHT = 92;

/** {element, show(history)}. */
export function costChart() {
  const element = h("div", { className: "cost", role: "img", "aria-label": "Cost over the steps" });
  const axis = { stroke: "#93a0ae", font: "10px system-ui, sans-serif",
    grid: { stroke: "#2a323c", width: 1 }, ticks: { show: false } };
  let plot = null;
  const show = (history) => {
    if (!element.isConnected || !history.length) return;
    const data = [history.map((_, i) => i), history];
    if (plot) {
      plot.setData(data);
      return;
    }
    plot = new window.uPlot({
      width: Math.max(element.clientWidth, 120), height: HEIGHT, legend: { show: false },
      cursor: { show: false }, padding: [6, 6, 0, 0],
      scales: { x: { time: false }, y: { distr: 3 } },
      axes: [{ ...axis, size: 18, gap: 2 }, { ...axis, size: 40, gap: 2,
        values: (_, splits) => splits.map((v) =>
          (Math.abs(Math.log10(v) % 1) < 1e-9 ? v.toExponential(0) : "")) }],
      series: [{}, { stroke: "#e69f00", width: 1.5, points: { show: history.length < 60, size: 4 } }],
    }, data, element);
  };
  return { element, show };
}

// What all plots share: the runs' colours, their axes' look, powers of ten, and a size that follows their box.

const style = getComputedStyle(document.documentElement);

/** Colours of the runs, as style.css has them for legends and numbers. */
export const COLOURS = Object.fromEntries(["measured", "reference", "now"].map((run) =>
  [run, style.getPropertyValue(`--${run}`).trim()]));

COLOURS.band = `${COLOURS.now}40`;

const GRID = style.getPropertyValue("--grid").trim();

export const AXIS = {
  stroke: style.getPropertyValue("--axis").trim(),
  font: "11px system-ui, sans-serif",
  grid: { stroke: GRID, width: 1 },
  ticks: { stroke: GRID, width: 1, size: 4 },
};

const MOST_LINES = 6;
/** Half the least height of a chart, in display units and as a share: rounding errors are no motion. */
const LEAST_ROOM = 5e-3;
const LEAST_SHARE = 1e-3;

/** Range of a chart: a little air above and below; a flat line lies in the middle. */
export function room(_, low, high) {
  if (low === null || high === null) return [-1, 1];
  const air = Math.max((high - low) * 0.08, LEAST_ROOM, LEAST_SHARE * Math.max(-low, high));
  return [low - air, high + air];
}

/** Keep a plot as wide as its box for as long as it is on the page. */
export function fitWidth(plot, box) {
  const watch = new ResizeObserver(() => {
    if (!box.isConnected) watch.disconnect();
    else if (box.clientWidth > 0 && box.clientWidth !== plot.width) {
      plot.setSize({ width: box.clientWidth, height: plot.height });
    }
  });
  watch.observe(box);
}

/** A logarithmic axis with lines at powers of ten only, at most MOST_LINES of them. */
export function decades(low, high) {
  const first = Math.floor(Math.log10(low) + 1e-9);
  const last = Math.ceil(Math.log10(high) - 1e-9);
  const step = Math.ceil((last - first + 1) / MOST_LINES);
  return Array.from({ length: Math.floor((last - first) / step) + 1 }, (_, i) => 10 ** (first + i * step));
}

/** Labels of decades; the lowest would run into the other axis. */
export const decadeLabels = (_, splits) => splits.map((v, i) => (i ? powerOfTen(v) : ""));

/** 0.01 to 1000 as they are, other powers of ten with their exponent. */
function powerOfTen(value) {
  const power = Math.round(Math.log10(value));
  if (power >= -2 && power <= 3) return String(Number((10 ** power).toPrecision(1)));
  const raised = String(power).replace(/./g, (c) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(c)]);
  return `10${raised}`;
}

// What the fit left: residuals by run and channel, how close to noise they are, and other minima.

import { h } from "../common/dom.js";
import { symbolOf } from "../common/formula.js";
import { distinct, nameOf } from "../common/names.js";
import * as units from "../common/units.js";
import { short } from "../ride/comfort.js";

/** p below which residuals are not white beyond doubt, and the share of samples they must be worth. */
const SURE = 1e-6;
const WORTH = 0.5;
const DOUBT = 0.01;
const MOST_APART = 4;

/** Whiteness, run by run. */
export function view({ runs, result }) {
  const inFit = distinct(runs.map(({ name }) => name));
  const shownAs = (name) => nameOf(runs[inFit.indexOf(name)]?.id) ?? name;
  const robust = result.loss !== "linear";
  const heads = ["Channel", "Residuals are", "Worth, samples", "rms, noises", "Noise", "Fit, %",
    ...(robust ? ["Outliers"] : [])];
  return h("div", { className: "fit-one scrolls", tabIndex: 0, role: "region", "aria-label": "Residuals" },
    h("table", { className: "whiteness" },
      h("thead", {}, h("tr", {}, heads.map((text) => h("th", { scope: "col" }, text)))),
      result.runs.map((run) => h("tbody", {},
        h("tr", {}, h("th", { scope: "rowgroup", colSpan: heads.length }, shownAs(run.name))),
        result.whiteness.filter((one) => one.run === run.name).map((one) => row(one, run, result, robust))))),
    h("p", { className: "hint" }, "White residuals are noise, which is all a right model leaves. Slow ones are what the " +
      "model misses, or noise of wheels and aₓ; the error bars count them for as many samples as they are worth." +
      (robust ? ` Outliers: samples beyond ${units.plain(result.loss_scale)} noises, which the loss discounts.` : "")));
}

/** The noise in force, and where it is from. */
function noise(channel, { noise: held, noise_source: source }) {
  const { display_factor: factor, display_unit: unit } = units.channel(channel);
  const text = `${units.plain(held[channel] * factor, 2)} ${unit}`;
  return source?.[channel] ? `${text}, ${source[channel]}` : text;
}

function row(one, run, result, robust) {
  const [word, text] = judged(one);
  return h("tr", { className: "channel" },
    h("td", {}, short(one.channel)),
    h("td", {}, h("span", { className: `determined ${word}`, title: `p ${units.plain(one.p, 2) || "0"}` }, text)),
    h("td", {}, `${units.number(one.effective_samples, 3)} of ${one.samples}`),
    h("td", {}, units.number(one.rms, 3)),
    h("td", { className: "span" }, noise(one.channel, run)),
    h("td", {}, units.number(result.fit_percent[run.name]?.[one.channel], 3)),
    robust ? h("td", {}, String(run.discounted[one.channel] ?? 0)) : null);
}

/** A class for the dot, and words. */
function judged({ p, effective_samples: worth, samples }) {
  if (p < SURE && worth < WORTH * samples) return ["no", "slow, not noise"];
  return p < DOUBT ? ["weakly", "not quite white"] : ["yes", "white, like noise"];
}

/** The minima that many starts ended in, the best first. */
export function minima({ result }) {
  if (!(result.starts > 1)) {
    return h("p", { className: "empty" }, "This fit searched from one start, so other minima are not known. Give more " +
      "“Starts” under Set-up, Search, and identify again to see them.");
  }
  const [best] = result.minima;
  const run = Object.keys(best.fit_percent)[0];
  const channels = Object.keys(best.fit_percent[run] ?? {});
  return h("div", { className: "fit-one scrolls", tabIndex: 0, role: "region", "aria-label": "Minima" },
    h("p", { className: "outcome" }, result.minima.length > 1
      ? `${result.starts} starts ended in ${result.minima.length} minima; the lowest is the fit.`
      : `${result.starts} starts: every search ended in the same minimum.`),
    h("table", { className: "minima" },
      h("thead", {}, h("tr", {}, ["", "Cost", "Searches", `Fit, % (${channels.map(short).join(", ")})`, "At a bound",
        "Furthest from the fit"].map((text) => h("th", { scope: "col" }, text)))),
      h("tbody", {}, result.minima.map((one, i) => h("tr", { title: one.outcome },
        h("th", { scope: "row" }, i ? String(i + 1) : "fit"),
        h("td", { className: "strong" }, units.number(one.cost, 5)),
        h("td", { title: one.cut_short ? `${one.cut_short} of them cut short, being clearly in this basin` : "" },
          `${one.starts}${one.from_start ? ", from the start values" : ""}`),
        h("td", {}, channels.map((channel) => units.number(one.fit_percent[run][channel], 3)).join(", ")),
        h("td", {}, one.at_bound.length ? one.at_bound.flatMap((name, k) => [k ? ", " : null, symbolOf(name)]).filter(Boolean) : "–"),
        h("td", {}, i ? apart(one, best) : ""))))),
    h("p", { className: "hint" }, "Searches are begun from the start values and the best of the other starts."));
}

/** The parameters that differ most, with their values. */
function apart(one, best) {
  const far = (name) => {
    const [a, b] = [one.parameters[name], best.parameters[name]];
    return Math.abs(a - b) / (Math.abs(a) + Math.abs(b) || 1);
  };
  return Object.keys(one.parameters).sort((a, b) => far(b) - far(a)).slice(0, MOST_APART)
    .filter((name) => far(name) > 1e-3)
    .flatMap((name, k) => {
      const { display_factor: factor, display_unit: unit } = units.parameter(name);
      return [k ? ", " : null, symbolOf(name), " ", units.withUnit(units.number(one.parameters[name] * factor, 3), unit)];
    }).filter(Boolean);
}

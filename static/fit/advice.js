// What to drive next: manoeuvres ranked by what a run of each would do to the errors of a fit.

import * as api from "../common/api.js";
import { h } from "../common/dom.js";
import { formula, symbolOf } from "../common/formula.js";
import { get, set } from "../common/store.js";
import * as units from "../common/units.js";

/** Ends of the bars' scale, standard error over value. */
const LEAST = 1e-3;
const MOST = 10;
const TICKS = [0.01, 0.1, 1];
const LABELLED = [0.01, 1];
const RANK = { no: 0, weakly: 1, yes: 2 };
/** Shown first; the rest on demand. */
const FIRST = 6;

let advice = null;
/** The identification that it is about. */
let about = null;
/** Why there is none, a refusal. */
let problem = null;
let asking = false;
let chosen = null;
let all = false;
let show = () => {};

/** `changed()` draws the view anew. */
export function build(changed) {
  show = changed;
}

/** For the browser tests. */
export const given = () => advice;

async function ask(job) {
  about = job.id;
  [advice, problem, chosen, all, asking] = [null, null, null, false, true];
  show();
  try {
    const found = await api.advise({ identification: job.id });
    if (about !== job.id) return;
    advice = found;
    chosen = found.candidates[0]?.key ?? null;
  } catch (error) {
    if (error.code === undefined) throw error;
    if (error.lost) set({ online: false });
    if (about === job.id) problem = error;
  } finally {
    if (about === job.id) asking = false;
  }
  show();
}

/** The view of a fit; `drive(candidate)` and `see(candidate)` take one further. */
export function view(job, hooks) {
  if (about !== job.id && !asking) setTimeout(() => ask(job));
  if (problem && about === job.id) {
    return h("div", { className: "problem", role: "alert" }, h("p", {}, problem.message),
      problem.code === "deleted" ? null
        : h("button", { type: "button", on: { click: () => ask(job) } }, "Try again"));
  }
  if (!advice || about !== job.id) {
    return h("p", { className: "empty", role: "status" },
      "Simulating what each manoeuvre would tell about the parameters …  This takes some seconds.");
  }
  if (!advice.candidates.length) {
    return h("p", { className: "empty" }, "No manoeuvre could be looked at. ", excluded());
  }
  const one = advice.candidates.find(({ key }) => key === chosen) ?? advice.candidates[0];
  return h("div", { className: "advice" },
    h("div", { className: "fit-main scrolls", role: "region", "aria-label": "Manoeuvres, the best first" },
      list(), excluded()),
    h("div", { className: "advice-detail scrolls" }, detail(one, hooks)));
}

function list() {
  const shown = all ? advice.candidates : advice.candidates.slice(0, FIRST);
  const more = advice.candidates.length - shown.length;
  return [
    advice.warnings.length ? h("ul", { className: "warnings" }, advice.warnings.map((text) => h("li", {}, text))) : null,
    h("ol", { className: "candidates" }, shown.map((one) => h("li", {},
      h("button", { type: "button", "aria-pressed": one.key === chosen, id: `candidate-${one.key}`,
        on: { click: () => { chosen = one.key; show(); } } },
      h("span", { className: "candidate-said" }, formula(one.sentence)), gained(one))))),
    more ? h("button", { type: "button", className: "link", id: "all-candidates",
      on: { click: () => { all = true; show(); } } }, `${more} more, which tell less`) : null,
    together(),
  ];
}

function gained({ promoted, gain }) {
  const text = promoted ? `+${promoted} ${promoted > 1 ? "classes" : "class"}` : "no class";
  return h("span", { className: `badge ${promoted ? "gain" : ""}`,
    title: `Classes (not, weakly, well) that the parameters rise together; ${units.number(gain, 2)} bits of information` }, text);
}

/** The best few to drive on one day. */
function together() {
  if (advice.together.length < 2) return null;
  return h("p", { className: "hint" }, "To drive together: ",
    advice.together.map(({ name }) => name).join("; then "), ".");
}

function excluded() {
  if (!advice.excluded.length) return null;
  return h("details", { className: "fold" }, h("summary", {}, `${advice.excluded.length} could not be looked at`),
    h("ul", { className: "warnings" }, advice.excluded.map(({ key, why }) => h("li", {}, `${key}: ${why}`))));
}

function detail(one, { drive, see }) {
  return [
    h("h3", {}, one.name, h("span", { className: "soft" }, ` ${units.plain(one.duration, 3)} s`)),
    h("div", { className: "row-tools" },
      h("button", { type: "button", id: "drive-candidate", className: "primary", on: { click: () => drive(one) },
        title: "Choose it in the form of a virtual campaign" }, "Into the campaign"),
      h("button", { type: "button", id: "see-candidate", on: { click: () => see(one) },
        title: "Make it the ride of charts and 3D view" }, "See the ride")),
    one.remark ? h("ul", { className: "warnings" }, h("li", {}, one.remark)) : null,
    bars(one),
  ];
}

/** Standard errors now and after a run of the candidate, on a logarithmic scale. */
function bars({ parameters: after }) {
  const { parameters: now } = advice.now;
  return h("table", { className: "before-after" },
    h("thead", {}, h("tr", {}, h("th", { scope: "col" }, ""), h("th", { scope: "col", title: "Standard error over value; the scale beside is logarithmic" }, "Error now"),
      h("th", { scope: "col" }, "then"), h("th", { scope: "col", className: "axis" },
        LABELLED.map((at) => place(h("span", {}, `${100 * at} %`), at))))),
    h("tbody", {}, now.map((one, i) => {
      const then = after.find(({ name }) => name === one.name) ?? after[i];
      const [before, later] = [relative(one), relative(then)];
      const rises = RANK[then.determined] > RANK[one.determined];
      const track = h("span", { className: "error-track" },
        TICKS.map((at) => place(h("i", { className: "grid-line" }), at)),
        lengthy(h("span", { className: "error now" }), before),
        lengthy(h("span", { className: `error then ${then.determined}` }), later));
      return h("tr", { title: units.parameter(one.name).label },
        h("th", { scope: "row" }, symbolOf(one.name)),
        h("td", {}, h("span", { className: `determined ${one.determined}` }, percent(before))),
        h("td", { className: rises ? "strong" : "" },
          h("span", { className: `determined ${then.determined}` }, percent(later), rises ? " ↑" : "")),
        h("td", {}, track));
    })));
}

const relative = ({ value, std_error: error }) => (error === null ? Infinity : error / Math.abs(value));
const percent = (share) => (share === Infinity ? "∞"
  : share > 9.99 ? ">999 %" : share < 1e-4 ? "<0.01 %" : `${units.plain(100 * share, 2)} %`);
const along = (share) =>
  100 * Math.min(Math.max(Math.log(share / LEAST) / Math.log(MOST / LEAST), 0.01), 1);

function place(element, share) {
  element.style.left = `${share <= LEAST ? 0 : along(share)}%`;
  return element;
}

function lengthy(element, share) {
  element.style.width = `${along(share)}%`;
  return element;
}

/** The key under which the page keeps a candidate among the manoeuvres, which it joins if it is new. */
export function known(candidate) {
  const { key, name, duration, manoeuvre } = candidate;
  const rows = get("manoeuvres");
  const same = rows.find((one) => one.key === key);
  if (same && !same.given) return key;
  const row = { key, name, duration, kind: manoeuvre.kind, description: "advised", given: manoeuvre };
  set({ manoeuvres: [...rows.filter((one) => one.key !== key), row] });
  return key;
}

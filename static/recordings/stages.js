// From a file to a run: what has been done to a recording and what comes next.

import { h } from "../common/dom.js";
import { lacks } from "../common/names.js";

/**
 * The four stages of a recording: key, label, state and what is told of it.
 * `state` is "done", "next" (what to do now), "look" (done, with something to look at), "needless" or "later".
 */
export function stagesOf(row) {
  const usable = row.usable_for_identification;
  const signs = row.sign_suggestions.length;
  return [
    { key: "file", label: "File", state: "done", told: "The file is kept byte for byte." },
    row.needs_mapping
      ? { key: "channels", label: "Channels", state: "next", told: `${lacks(row)}.` }
      : { key: "channels", label: "Channels", state: signs ? "look" : "done",
          told: signs ? `${signs} sign${signs > 1 ? "s" : ""} may be turned over.`
            : row.mapping ? "Its columns are mapped to channels."
            : "Its columns have the names of channels." },
    row.needs_mapping
      ? { key: "conditioning", label: "Conditioning", state: "later",
          told: "Comes once its columns are channels." }
      : row.conditioning
        ? { key: "conditioning", label: "Conditioning", state: usable ? "done" : "next",
            told: `${row.conditioning.length} step${row.conditioning.length > 1 ? "s" : ""} done.` }
        : { key: "conditioning", label: "Conditioning", state: usable ? "needless" : "next",
            told: usable ? "Nothing has to be done to it." : `${lacks(row)}; steps may make it.` },
    { key: "ready", label: "Ready", state: usable ? "done" : "later",
      told: usable ? "It has all that an identification needs." : `${lacks(row)}.` },
  ];
}

/** What to do next: "channels", "conditioning" or "ready". */
export const nextStage = (row) =>
  (stagesOf(row).find(({ state }) => state === "next" || state === "look") ?? { key: "ready" }).key;

const MARKS = { done: "✓", next: "→", look: "!", needless: "–", later: "·" };
const WORDS = { done: "done", next: "to do next", look: "to look at", needless: "not needed", later: "later" };

/** The stages in a row; `open(key)` for those that can be worked on, `current` is on show. */
export function stepper(row, open, current = null) {
  return h("ol", { className: "stages", "aria-label": "From file to run" }, stagesOf(row).map(({ key, label, state, told }) => {
    const inside = [h("span", { className: "stage-mark", "aria-hidden": "true" }, MARKS[state]),
      h("span", {}, label, key === "ready" ? h("span", { className: "long" }, " for fitting") : null),
      h("span", { className: "unseen" }, `, ${WORDS[state]}`)];
    const workable = ["channels", "conditioning"].includes(key) && state !== "later";
    return h("li", { className: `stage ${state}`, "aria-current": key === current ? "step" : undefined },
      workable
        ? h("button", { type: "button", title: told, on: { click: () => open(key) } }, inside)
        : h("span", { title: told }, inside));
  }));
}

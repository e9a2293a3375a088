// The dialog in which a file becomes a run: its columns channels, its raw sensors what a fit needs.

import * as api from "../common/api.js";
import { $, breakable, h } from "../common/dom.js";
import { nameOf } from "../common/names.js";
import { get, set } from "../common/store.js";
import { choose } from "../ride/ride.js";
import * as conditioning from "./conditioning.js";
import * as mapping from "./mapping.js";
import { nextStage, stepper } from "./stages.js";

const VIEWS = { channels: mapping, conditioning };
const TITLES = { channels: "Columns to channels", conditioning: "Conditioning" };

const parts = {};
let at = null;

export function build() {
  parts.title = h("h2", { id: "intake-title", tabIndex: -1 });
  parts.stages = h("div");
  parts.close = h("button", { type: "button", id: "intake-close", on: { click: () => close() } }, "Close");
  parts.body = h("div", { className: "intake-body" });
  parts.said = h("div", { className: "intake-said scrolls", role: "status" });
  parts.tools = h("div", { className: "intake-tools" });
  parts.dialog = h("dialog", { id: "intake", className: "intake", "aria-labelledby": "intake-title",
    on: { cancel: (event) => { event.preventDefault(); close(); } } },
  h("header", {}, parts.title, parts.stages, parts.close), parts.body,
  h("footer", {}, parts.said, parts.tools));
  document.body.append(parts.dialog);
}

const row = () => get("measurements").find(({ id }) => id === at.id);

/** Work on a stage of a recording. */
export async function open(id, stage = nextStage(get("measurements").find((one) => one.id === id))) {
  at = { id, stage, changed: false };
  parts.title.replaceChildren(`${TITLES[stage]}: `, ...breakable(nameOf(id)));
  heading();
  parts.body.replaceChildren(h("p", { className: "hint" }, "Looking into the file …"));
  say();
  tools();
  if (!parts.dialog.open) parts.dialog.showModal();
  parts.title.focus();
  const mine = at;
  try {
    const view = await VIEWS[stage].open(row(), host(mine));
    if (at === mine) parts.body.replaceChildren(view);
    VIEWS[stage].shown?.();
  } catch (error) {
    if (at !== mine) return;
    parts.body.replaceChildren();
    say("problem", error.message);
    if (error.lost) set({ online: false });
    else if (error.code === undefined) throw error;
  }
}

function heading() {
  parts.stages.replaceChildren(stepper(row(), (stage) => leave(() => open(at.id, stage)), at.stage));
}

/** What a view may ask of the dialog that it is in. */
const host = (mine) => ({
  say, tools, refused,
  /** Whether there is something that would be lost. */
  changed: (yes) => { Object.assign(mine, { changed: yes, warned: false }); },
  /** The service knows the recording anew. */
  took: (found) => {
    set({ measurements: get("measurements").map((one) => (one.id === found.id ? found : one)) });
    const ride = get("ride");
    if (ride.kind === "measurement" && ride.id === found.id) set({ ride: { ...ride } });
    heading();
  },
  /** The button to the next stage, or to the ride. */
  next: (found) => {
    const stage = nextStage(found);
    if (stage === "ready" || (stage === mine.stage && found.usable_for_identification)) {
      return h("button", { type: "button", className: "primary", id: "intake-ride",
        on: { click: () => { choose(`measurement ${found.id}`); shut(); } } }, "Use as ride");
    }
    return stage === mine.stage ? null
      : h("button", { type: "button", className: "primary", id: "intake-next",
          on: { click: () => leave(() => open(found.id, stage)) } }, `Next: ${TITLES[stage].toLowerCase()}`);
  },
});

/** Sentences in the footer; "problem" is read out at once. */
function say(kind = "", ...sentences) {
  parts.said.className = `intake-said scrolls ${kind}`;
  parts.said.setAttribute("role", kind === "problem" ? "alert" : "status");
  parts.said.replaceChildren(...sentences.map((text) => h("p", {}, text)));
}

function tools(...buttons) {
  parts.tools.replaceChildren(...buttons.filter(Boolean));
}

/** Show a refusal of the service. */
function refused(error) {
  if (error.lost) set({ online: false });
  else if (error.code === undefined) throw error;
  say("problem", error.message);
}

/** Changes that were not applied are given up only when asked twice. */
function leave(then) {
  if (!at.changed || at.warned) {
    then();
    return;
  }
  at.warned = true;
  say("doubt", "What you changed is not applied; press Apply, or do that again to give it up.");
}

function close() {
  leave(shut);
}

function shut() {
  at = null;
  parts.dialog.close();
  parts.body.replaceChildren();
  ($(".measurement-detail .primary") ?? $("#upload"))?.focus();
}


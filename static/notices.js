// Messages for a person: what the service said, word for word, and what can be done.

import { $, h } from "./dom.js";
import { worded } from "./wording.js";

const KEPT = { info: 6000, warning: 15000 };

/** A message in the corner; errors stay until they are dismissed. */
export function notice(kind, title, text = "", action = null) {
  const box = h(
    "div",
    { className: `notice ${kind}`, role: kind === "error" ? "alert" : "status" },
    h("strong", {}, title),
    text ? h("p", {}, worded(text)) : null,
    action
      ? h("button", { type: "button", on: { click: () => { action.run(); box.remove(); } } },
          action.label)
      : null,
    h("button", {
      type: "button", className: "dismiss", title: "Dismiss", "aria-label": "Dismiss",
      on: { click: () => box.remove() },
    }, "×"),
  );
  const all = $("#notices");
  all.append(box);
  while (all.children.length > 4) all.firstChild.remove();
  if (KEPT[kind]) setTimeout(() => box.remove(), KEPT[kind]);
  return box;
}

/** Show a refusal; a lost connection is the banner's business. */
export function refused(error, doing) {
  if (error.lost) return null;
  if (error.code === undefined) throw error;
  return notice("error", `${doing} did not work`, error.message);
}

/** The bar across the page: lost connection, compiling. Empty text takes it away. */
export function banner(text, kind = "") {
  const bar = $("#banner");
  bar.hidden = !text;
  bar.className = `banner ${kind}`;
  if (bar.textContent !== text) bar.textContent = text;
}

// The visitor's projects, each a session: which one is open, its name, and the way to the others.

import * as api from "../common/api.js";
import { $, counted, h, when } from "../common/dom.js";
import { refused } from "../common/notices.js";
import { get, on, set } from "../common/store.js";
import * as measurements from "../recordings/measurements.js";
import * as keeping from "./keeping.js";

const LONGEST = 80;

/** What the list has of each project, those used latest first. */
let rows = [];
/** What is done in a row, in place: {id, what: "rename" or "delete"}. */
let doing = null;
/** Whether it was said that not all is kept. */
let warned = false;
let busy = false;
const parts = {};

export function build() {
  parts.said = h("p", { className: "refusal", role: "alert", hidden: true });
  parts.list = h("ul", { className: "project-list scrolls", "aria-label": "Projects" });
  parts.fresh = h("input", { type: "text", id: "new-name", maxLength: LONGEST, placeholder: "Name, if you like",
    autocomplete: "off", "aria-label": "Name of the new project" });
  parts.dialog = h("dialog", { id: "projects", className: "projects", "aria-labelledby": "projects-title", closedby: "any" },
    h("h2", { id: "projects-title" }, "Projects"), parts.said, parts.list,
    h("form", { on: { submit: asked(() => leave(() => begin(parts.fresh.value.trim()))) } },
      parts.fresh, h("button", { className: "primary", id: "new-project" }, "New project"),
      h("button", { type: "button", id: "projects-close", on: { click: () => parts.dialog.close() } }, "Close")));
  document.body.append(parts.dialog);
  $("#project").addEventListener("click", asked(open));
  on("name", title);
  title();
}

function title() {
  const name = get("name");
  $("#project bdi").textContent = name;
  $("#project").title = `Project ${name}: rename it, open or begin another`;
  document.title = `${name} · ridetune`;
}

/** A listener that does one thing at a time, and shows a refusal where the visitor is. */
function asked(act) {
  return async (event) => {
    event?.preventDefault();
    if (busy) return;
    busy = true;
    say();
    try {
      await act();
    } catch (error) {
      if (error.lost) set({ online: false });
      if (!parts.dialog.open) refused(error, "Listing the projects");
      else if (error.code === undefined) throw error;
      else say(error.message);
    } finally {
      busy = false;
    }
  };
}

function say(text = "") {
  parts.said.textContent = text;
  parts.said.hidden = !text;
}

async function open() {
  rows = await api.sessions();
  parts.fresh.value = "";
  [doing, warned] = [null, false];
  show();
  parts.dialog.showModal();
}

/** Build the list anew; `focus` selects what has the focus then. */
function show(focus = null) {
  parts.list.replaceChildren(...rows.map(row));
  if (focus) ($(focus, parts.list) ?? $("#new-name")).focus();
}

const isOpen = ({ id }) => id === get("session");

function row(one) {
  const doingIt = doing?.id === one.id ? doing.what : null;
  const name = doingIt === "rename" ? renaming(one) : h("bdi", { className: "strong" }, one.name);
  const facts = `${isOpen(one) ? "open here" : `used ${when(one.seen)}`}, ${counted(one.measurement_count, "recording")}`;
  return h("li", { "aria-current": isOpen(one) ? "true" : undefined },
    h("div", { className: "grow" }, name, h("p", { className: "soft" }, facts)),
    ...(doingIt ? [] : tools(one)),
    doingIt === "delete" ? deleting(one) : null);
}

const button = (text, one, act, props = {}) =>
  h("button", { type: "button", "aria-label": `${text} ${one.name}`, on: { click: act }, ...props }, text);

function tools(one) {
  return [
    isOpen(one) ? button("Rename", one, () => turn(one, "rename", "input"), { id: "rename" })
      : h("a", { className: "button", href: addressOf(one.id), "aria-label": `Open ${one.name}`, on: { click: openIt(one) } }, "Open"),
    button("Delete", one, () => turn(one, "delete", ".keep"), { className: "danger" }),
  ];
}

function turn({ id }, what, focus) {
  doing = { id, what };
  say();
  show(focus);
  document.activeElement.select?.();
}

/** Back to the plain list, where the focus goes to the row's first control. */
function turnBack({ id }) {
  doing = null;
  show(`li:nth-child(${rows.findIndex((one) => one.id === id) + 1}) :is(button, a)`);
}

/** Other pages are opened by what the browser has for links, in a new tab or not. */
const openIt = ({ id }) => (event) => {
  if (event.ctrlKey || event.metaKey || event.shiftKey) return;
  asked(() => leave(() => go(addressOf(id))))(event);
};

function renaming(one) {
  const field = h("input", { type: "text", value: one.name, maxLength: LONGEST, required: true, autocomplete: "off",
    "aria-label": "Name of this project",
    on: {
      keydown: (event) => {
        if (event.key !== "Escape") return;
        event.preventDefault();
        turnBack(one);
      },
    } });
  return h("form", { on: { submit: asked(() => rename(one, field.value)) } }, field,
    h("button", { className: "primary" }, "Save"),
    h("button", { type: "button", on: { click: () => turnBack(one) } }, "Cancel"));
}

async function rename(one, name) {
  const named = await api.renameSession(name);
  rows = rows.map((before) => (before.id === named.id ? named : before));
  set({ name: named.name });
  turnBack(one);
}

function deleting(one) {
  const held = one.measurement_count ? `, its ${counted(one.measurement_count, "recording")}` : "";
  return h("div", { className: "going", role: "alert" },
    h("p", {}, `Its car${held} and all that was found from them go for good.`),
    button("Delete for good", one, asked(() => remove(one)), { className: "danger" }),
    button("Keep", one, () => turnBack(one), { className: "keep" }));
}

async function remove(one) {
  if (isOpen(one)) {
    // Nothing may be asking for what is no more.
    await keeping.save();
    await measurements.atRest();
  }
  await api.deleteSession(one.id);
  if (isOpen(one)) {
    $("#view iframe")?.remove();
    go(`/${location.search}`, "replace");
    return;
  }
  rows = rows.filter(({ id }) => id !== one.id);
  doing = null;
  show("li :is(button, a)");
}

async function begin(name) {
  const { id } = await api.newSession(name);
  go(addressOf(id));
}

/** Go to another page; this one is left alone until it is gone. */
function go(address, how = "assign") {
  parts.dialog.close();
  location[how](address);
}

const addressOf = (id) => `/s/${id}/${location.search}`;

/** Leave this project once all that was set is kept; what cannot be is given up only when asked twice. */
async function leave(then) {
  await keeping.save();
  if (!await api.answers()) {
    set({ online: false });
    say("The service does not answer; what you have set stays here, so do that again once it is back.");
  } else if (keeping.unsaved() && !warned) {
    warned = true;
    say("Not all that was set is kept; the messages of the page say why. Do that again to give it up.");
  } else await then();
}

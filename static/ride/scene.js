// The 3D view: viser in a frame of our own origin, posed through its bridge (bridge.js).

import { brokenOff } from "../common/connection.js";
import { $, capital, h } from "../common/dom.js";
import { COLOURS } from "../common/plots.js";
import { get, on, set } from "../common/store.js";
import * as units from "../common/units.js";
import { carMessages, farPivots, ghostMessages, pivotAt, update, visibility } from "./poses.js";
import { surface } from "./road.js";
import { clock, onTime } from "./timeline.js";

const CAMERAS = {
  "three-quarter": [[3.3, -4.1, 1.45], [0, 0, 0.5]],
  side: [[0, -6.4, 0.75], [0, 0, 0.55]],
  front: [[6.2, -0.01, 0.95], [0, 0, 0.55]],
  top: [[0, -0.02, 7.2], [0, 0, 0]],
};
const PATIENCE = 12000;
const SCALE_STEP = 2e-4;
/** What is shown of a ride that cannot be simulated: the car at rest on flat ground. */
const REST = { time: new Float32Array(1), values: {}, head: { mode: "rest" } };

let frame = null;
let parts = new Set();
let shownRoad = null;
let shownGhost = null;
let shownGrips = null;
/** The grip that is being dragged stays where the hand is. */
let held = null;
let waiting = 0;
/** Scale or visibility of each node as it was sent last. */
const sent = new Map();
/** What the browser tests look at. */
export const seen = { connected: false, connections: 0, built: false, poses: 0, last: [] };

/** Open the view of a session. `askForCar` makes the service send the nodes once more. */
export function build(sid, { askForCar }) {
  if (!document.createElement("canvas").getContext("webgl2")) {
    note("The 3D view needs WebGL 2, which this browser does not offer. " +
      "Everything else on the page works without it.");
    return;
  }
  window.addEventListener("viewer", ({ detail }) => {
    if (detail.state === "grip") {
      gripped(detail);
      return;
    }
    clearTimeout(waiting);
    if (detail.state === "scene") {
      parts = new Set(detail.names);
      seen.built = parts.has("/car/body");
      frame.classList.toggle("empty-frame", !seen.built);
      shownRoad = null;
      shownGhost = null;
      shownGrips = null;
      sent.clear();
      if (seen.built) {
        note("");
        refresh();
      } else askForCar();
    } else {
      seen.connected = detail.state === "connected";
      seen.connections += seen.connected;
      seen.built = false;
      if (!seen.connected) {
        note("The 3D view has lost its connection and is trying again.");
        brokenOff();
      }
    }
  });
  const query = new URLSearchParams(location.search).get("fixedDpr");
  frame = h("iframe", {
    className: "empty-frame",
    title: "3D view of the car; drag to turn it",
    src: `/s/${sid}/viewer/${query ? `?fixedDpr=${encodeURIComponent(query)}` : ""}`,
  });
  note("Opening the 3D view …");
  waiting = setTimeout(
    () => note("The 3D view takes long to open. If it stays away, reload the page."), PATIENCE);
  $("#view").prepend(frame);
  for (const button of document.querySelectorAll("[data-camera]")) {
    button.addEventListener("click", () => look(button.dataset.camera));
  }
  $("#ghost").addEventListener("change", refresh);
  const grips = $("#grips");
  grips.addEventListener("click", () => {
    grips.setAttribute("aria-pressed", grips.getAttribute("aria-pressed") !== "true");
    place();
  });
  onTime(place);
  on("now reference measured compare trouble", refresh);
  on("online", (state) => {
    if (state.online && !seen.connected) frame.contentWindow?.bridge?.retry();
  });
}

function note(text) {
  const box = $("#view-note");
  box.hidden = !text;
  box.textContent = text;
}

/** Hand messages to viser; what has not changed in size or sight is not worth a render of its part. */
function inject(all) {
  const messages = all.filter(({ type, name, updates, visible }) => {
    const now = updates?.scale ?? (visible === undefined ? null : [Number(visible)]);
    if (!now) return true;
    const before = sent.get(`${type} ${name}`);
    sent.set(`${type} ${name}`, now);
    return !before || now.some((x, k) => Math.abs(x - before[k]) > SCALE_STEP);
  });
  seen.last = messages;
  seen.poses += 1;
  return frame?.contentWindow?.bridge?.inject(messages) ?? false;
}

/** `#rrggbb` as three bytes. */
const bytes = (colour) => colour.match(/[\da-f]{2}/gi).map((pair) => parseInt(pair, 16));

function look(name) {
  const [eye, target] = CAMERAS[name];
  inject([
    { type: "SetCameraLookAtMessage", look_at: target, initial: false },
    { type: "SetCameraPositionMessage", position: eye, initial: false },
  ]);
}

/** Which run the ghost follows, by the choice in the view. */
function ghostRun() {
  const choice = $("#ghost").value;
  const measured = get("measured");
  const reference = get("compare") === "none" ? null : get("reference");
  if (choice === "none") return [null, null];
  if (choice === "reference" || (choice === "auto" && !measured)) return ["reference", reference];
  return ["measured", measured];
}

/** A dragged pivot moves its two sliders, within their ranges. */
function gripped({ phase, name, position }) {
  held = phase === "DragEnd" ? null : name;
  if (phase !== "Update") {
    place();
    return;
  }
  const axle = name.endsWith("front") ? "front" : "rear";
  const changes = Object.entries(pivotAt(get("vehicle"), axle, position)).map(([key, value]) => {
    const path = `${axle}.pivot.${key}`;
    const row = get("parameters").find((parameter) => parameter.name === path);
    const rounded = Math.round(value / row.step) * row.step;
    return [path, Math.min(Math.max(rounded, row.slider_lower), row.slider_upper)];
  });
  set({ values: { ...get("values"), ...Object.fromEntries(changes) } });
}

/** Everything anew: after another run, another ride or rebuilt nodes. */
function refresh() {
  if (!seen.built) return;
  shapeRoad();
  place();
}

/** The first of these runs that is there. */
const shown = (...names) => names.map(get).find(Boolean) ?? (get("trouble") ? REST : null);

function place() {
  const run = shown("now", "measured");
  if (!seen.built || !run) return;
  const vehicle = get("vehicleNow") ?? get("vehicle");
  const messages = carMessages(vehicle, run, clock.time, clock.magnification);
  const [kind, ghost] = ghostRun();
  const key = ghost ? kind : null;
  if (key !== shownGhost) {
    shownGhost = key;
    for (const name of parts) {
      if (!name.startsWith("/ghost/")) continue;
      messages.push(visibility(name, Boolean(ghost)));
      if (ghost) messages.push(update(name, { colors: new Uint8Array(bytes(COLOURS[kind])) }));
    }
  }
  const grips = $("#grips").getAttribute("aria-pressed") === "true";
  if (grips !== shownGrips) {
    shownGrips = grips;
    for (const name of parts) {
      if (/\/(grip|ray)_/.test(name)) messages.push(visibility(name, grips));
    }
  }
  if (ghost) messages.push(...ghostMessages(vehicle, ghost, clock.time, clock.magnification));
  if (shownRoad && shownRoad.magnification !== clock.magnification) {
    shownRoad.magnification = clock.magnification;
    const scale = [1, 1, clock.magnification];
    messages.push(update("/road/surface", { scale }), update("/road/lines", { scale }));
  }
  inject(messages.filter(({ name }) => name !== held));
  caption(vehicle);
}

/** Where the pivots are that lie beyond the car. */
function caption(vehicle) {
  const text = farPivots(vehicle).map(({ axle, distance, height }) =>
    `${capital(axle)} pivot: ${units.fixed(Math.abs(distance), 2)} m ` +
    `${(axle === "front") === distance > 0 ? "behind" : "ahead of"} its axle, ` +
    `${units.fixed(Math.abs(height), 2)} m ${height < 0 ? "under" : "above"} ground; ` +
    "its arm is drawn as far as the car.").join("\n");
  const box = $("#view-caption");
  if (box.textContent !== text) box.textContent = text;
}

/** The road is shaped once a ride: the sliders move the car, not the ground. */
function shapeRoad() {
  const run = shown("measured", "now");
  if (!run) return;
  const key = `${JSON.stringify(get("ride"))} ${JSON.stringify(get("road"))} ${run.head.mode}`;
  if (shownRoad?.key === key) return;
  shownRoad = { key, magnification: 0 };
  const { vertices, faces, marks } = surface(get("vehicle"), run);
  inject([update("/road/surface", { vertices, faces }), update("/road/lines", { points: marks })]);
}

// Which ride is simulated: a measured one (the rims' motion prescribed) or a manoeuvre on a road.

import { $, h } from "../common/dom.js";
import { nameOf } from "../common/names.js";
import { get, on, set } from "../common/store.js";

/** Where a single bump or hole lies, m ahead of the standing car's CG. */
const SHAPE_AT = 20;

/** Fill the choices of the header and follow them. */
export function build() {
  $("#ride").addEventListener("change", () => choose($("#ride").value));
  $("#road").addEventListener("change", () => {
    const { value } = $("#road");
    begin({ road: value ? JSON.parse(value) : null });
  });
  $("#compare").addEventListener("change", () => set({ compare: $("#compare").value }));
  $("#road").append(
    h("option", { value: "" }, "as the manoeuvre says"),
    ...roadChoices(get("roads")).map(([text, road]) =>
      h("option", { value: JSON.stringify(road) }, text)),
  );
  on("measurements manoeuvres", list);
  on("ride road compare", show);
  list();
  show();
}

/** Roads to choose from, of what the service can build. */
function roadChoices(roads) {
  const kinds = new Set(roads.kinds);
  const shapes = [
    ["flat", { kind: "flat" }],
    ["one bump, 50 mm", { kind: "bump", begin: SHAPE_AT, length: 1, height: 0.05 }],
    ["one pothole, 40 mm, right", { kind: "pothole", begin: SHAPE_AT, length: 0.8, depth: 0.04 }],
  ];
  const classes = kinds.has("iso8608") ? roads.classes.map((name) => [
    `ISO 8608 class ${name}`, { kind: "iso8608", sections: [{ class: name }] }]) : [];
  return [...shapes.filter(([, { kind }]) => kinds.has(kind)), ...classes];
}

/** Choose by key: "measurement ID" or "manoeuvre KEY". */
export function choose(key) {
  const [kind, id] = split(key);
  begin({ ride: kind === "measurement" ? { kind, id } : { kind, key: id }, road: null });
}

/** Another ride begins empty: what is shown is never a run of the one before. */
const begin = (ride) => set({ ...ride, now: null, reference: null, measured: null, trouble: null });

const split = (key) => [key.slice(0, key.indexOf(" ")), key.slice(key.indexOf(" ") + 1)];
const keyOf = (ride) => `${ride.kind} ${ride.id ?? ride.key}`;

function list() {
  const usable = get("measurements").filter((m) => m.usable_for_identification);
  const roads = get("manoeuvres").filter((m) => m.kind !== "posts");
  const posts = get("manoeuvres").filter((m) => m.kind === "posts");
  $("#ride").replaceChildren(...[
    group("Measured: the car follows the recorded rims", usable.map((m) =>
      [`measurement ${m.id}`, nameOf(m.id), ""])),
    group("Manoeuvres on a road", roads.map((m) =>
      [`manoeuvre ${m.key}`, m.name, m.description])),
    group("Four-post rig", posts.map((m) => [`manoeuvre ${m.key}`, m.name, m.description])),
  ].filter(Boolean));
  const ride = get("ride");
  if (ride?.kind === "measurement" && !usable.some(({ id }) => id === ride.id)) {
    choose(usable.length ? `measurement ${usable[0].id}` : `manoeuvre ${roads[0].key}`);
  }
  show();
}

function group(label, rows) {
  if (!rows.length) return null;
  return h("optgroup", { label }, rows.map(([value, text, title]) =>
    h("option", { value, title }, text)));
}

function show() {
  const ride = get("ride");
  if (!ride) return;
  $("#ride").value = keyOf(ride);
  const manoeuvre = get("manoeuvres").find(({ key }) => key === ride.key);
  const onRoad = ride.kind === "manoeuvre" && manoeuvre?.kind !== "posts";
  $("#road-field").hidden = !onRoad;
  $("#road").value = get("road") ? JSON.stringify(get("road")) : "";
  for (const id of ["#ride", "#road", "#compare"]) {
    const chosen = $(id).selectedOptions[0];
    $(id).title = [chosen?.text, chosen?.title].filter(Boolean).join(": ");
  }
}

// The page: reads the session, builds the parts and keeps them together.
//
// Flow: a control changes the store -> simulation.js asks the service -> runs come into the store
// -> charts, 3D and numbers draw them. Nothing else talks to the service but api.js.
//
// For the browser tests `window.ridetune` looks inside: state(key) of the store, timing (ms from a
// slider's move to new charts), scene (connected, built, poses, last messages), drawn() (what each
// chart shows), zoomed(), clock, job(), validation(), campaign(),
// profile(), advice(), idle() (no simulation under way) and unsaved().

import * as campaign from "./campaign/campaign.js";
import * as car from "./car/car.js";
import * as controls from "./car/controls.js";
import * as api from "./common/api.js";
import { $, tabs } from "./common/dom.js";
import { banner, build as buildNotices, notice, refused } from "./common/notices.js";
import { get, on, set } from "./common/store.js";
import * as units from "./common/units.js";
import * as advice from "./fit/advice.js";
import * as identification from "./fit/identification.js";
import * as profile from "./fit/profile.js";
import * as keeping from "./project/keeping.js";
import * as projects from "./project/projects.js";
import * as intake from "./recordings/intake.js";
import * as measurements from "./recordings/measurements.js";
import * as bands from "./ride/bands.js";
import * as charts from "./ride/charts.js";
import * as comfort from "./ride/comfort.js";
import * as ride from "./ride/ride.js";
import * as scene from "./ride/scene.js";
import { idle, timing, want } from "./ride/simulation.js";
import * as timeline from "./ride/timeline.js";
import * as validation from "./validation/validation.js";

const RETRY = 1500;
/** Height in which the twelve rows of a fit are seen at once, px; the 3D view's share by default. */
const FIT_HEIGHT = 432;
const STAGE_SHARE = [38, 54];

/** Where the browser keeps, for a reload, which tab is open. */
const TAB = "tab";

const sid = location.pathname.split("/")[2];

async function start() {
  api.useSession(sid);
  set({ session: sid, online: true, ready: false, compare: "baseline", road: null, liftOff: false, fit: null, fitJob: null,
    now: null, reference: null, measured: null, bands: null });
  const [
    session, parameters, channels, vehicles, manoeuvres, plants, formats, roads, rimsSettings,
  ] = await Promise.all([
    api.session(), api.parameters(), api.channels(), api.vehicles(), api.manoeuvres(), api.plants(),
    api.formats(), api.roads(), api.rimsSettings(),
  ]);
  units.learn(channels, parameters);
  const { vehicle, measurements: rows } = session;
  const baseline = session.baseline ?? vehicle;
  set({ parameters, channels, vehicles, manoeuvres, plants, formats, roads, vehicle, baseline, measurements: rows,
    rimsUsual: rimsSettings, name: session.name });
  const usable = rows.find((row) => row.usable_for_identification);
  set({
    ...keeping.taken(session.setup, rimsSettings),
    values: controls.valuesOf(vehicle),
    ride: keeping.rideOf(session.setup, rows, manoeuvres) ?? (usable ? { kind: "measurement", id: usable.id }
      : { kind: "manoeuvre", key: manoeuvres[0].key }),
  });
  build();
  follow();
  await settle();
  await identification.resume();
  await validation.resume();
  await campaign.resume();
}

function build() {
  const shown = sessionStorage.getItem(TAB);
  const select = tabs($("#workbench [role=tablist]"), (id) => {
    sessionStorage.setItem(TAB, id);
    if (id === "tab-identification") identification.opened();
  });
  timeline.build();
  timeline.listenToKeys();
  buildNotices();
  projects.build();
  controls.build({ onBaseline: setBaseline });
  ride.build();
  charts.build(() => want("now", "reference"));
  bands.build();
  comfort.build();
  intake.build();
  measurements.build({
    open: () => select("tab-measurements"), takeVehicle: car.load, campaign: campaign.build(),
  });
  identification.build({
    open: () => select("tab-identification"), apply: applyFit,
    drive: (candidate) => {
      select("tab-measurements");
      campaign.propose(advice.known(candidate));
    },
    see: (candidate) => ride.choose(`manoeuvre ${advice.known(candidate)}`),
  });
  validation.build();
  car.build();
  scene.build(sid, { askForCar: () => want("scene") });
  splitter();
  help();
  if (document.getElementById(shown)?.getAttribute("role") === "tab") select(shown);
}

/** What follows from a change. */
function follow() {
  keeping.follow();
  on("values", () => want("now", ...(get("compare") === "7dof" ? ["reference"] : [])));
  on("baseline", () => want("reference"));
  on("compare", () => {
    set({ reference: null });
    want("reference");
  });
  on("liftOff traction rimsSettings braking", () => want("now", "reference"));
  on("vehicle", () => want("now", "scene", "reference"));
  on("ride road", () => want("measured", "now", "reference"));
  on("ride", () => charts.showAll());
  on("now measured", (state) => {
    const run = state.now ?? state.measured;
    if (run) timeline.setRange(run.time[0], run.time[run.time.length - 1]);
  });
  on("trouble", (state) => { if (state.trouble?.status === 404) lookAgain(); });
  on("now trouble ready online", status);
  on("ready online", (state) => {
    if (!state.online || !state.ready) settle();
  });
}

/** Wait until the service answers and has compiled, then ask for everything. */
let settling = null;
function settle() {
  settling ??= (async () => {
    for (;;) {
      const state = await api.readiness().catch(() => null);
      if (["ready", "degraded"].includes(state?.state)) break; // jobs may wait, all else goes on
      set({ online: state !== null });
      banner(
        state
          ? state.state === "compiling" ? `${state.message} The page goes on by itself.`
            : state.message
          : "The service does not answer. Your car and files are kept; the page goes on as soon " +
            "as it is back.",
        state?.state === "compiling" ? "calm" : "lost");
      await new Promise((done) => setTimeout(done, RETRY));
    }
    banner("");
  })();
  return settling.then(() => {
    if (!settling) return;
    settling = null;
    set({ online: true, ready: true });
    keeping.save();
    want("measured", "now", "reference", ...(get("now") ? ["scene"] : []));
  });
}

/** Something is gone: a file deleted in another tab, or the whole session. */
async function lookAgain() {
  try {
    set({ measurements: (await api.session()).measurements });
  } catch (error) {
    lost(error);
  }
}

async function setBaseline() {
  const vehicle = controls.withValues(get("vehicle"), get("values"));
  try {
    await api.saveBaseline(vehicle);
    set({ baseline: vehicle });
    notice("info", "Baseline set", "The sliders' values are what changes are now compared with.");
  } catch (error) {
    if (error.lost) set({ online: false });
    refused(error, "Setting the baseline");
  }
}

function applyFit(result) {
  set({ values: { ...get("values"),
    ...Object.fromEntries(result.parameters.map(({ name, value }) => [name, value])) } });
  bands.applied();
  keeping.save();
  notice("info", "The sliders hold the identified car",
    "“Set baseline” makes it the car that later changes are compared with.");
}

function status() {
  const run = get("now");
  $("#status").textContent = !get("online") ? "no connection"
    : !get("ready") ? "getting ready"
    : get("trouble") ? "not simulated"
    : run ? `simulated in ${units.number(1000 * (run.head.seconds ?? 0), 2)} ms` : "simulating …";
}

/** The bar between 3D view and workbench: drag it, or arrows. */
function splitter() {
  const bar = $("#splitter");
  const put = (share) => {
    const bounded = Math.min(Math.max(share, 20), 80);
    document.documentElement.style.setProperty("--stage", `${bounded}fr`);
    document.documentElement.style.setProperty("--bench", `${100 - bounded}fr`);
    bar.setAttribute("aria-valuenow", Math.round(bounded));
  };
  // Until the bar is moved, the rows of a fit go before the view in a low window.
  const watch = new ResizeObserver(() => {
    const share = 100 - (100 * FIT_HEIGHT) / $("main").clientHeight;
    put(Math.min(Math.max(share, STAGE_SHARE[0]), STAGE_SHARE[1]));
  });
  watch.observe($("main"));
  bar.addEventListener("pointerdown", (event) => {
    watch.disconnect();
    bar.setPointerCapture(event.pointerId);
    document.body.classList.add("dragging");
  });
  bar.addEventListener("pointermove", (event) => {
    if (!bar.hasPointerCapture(event.pointerId)) return;
    const box = $("main").getBoundingClientRect();
    put((100 * (event.clientY - box.top)) / box.height);
  });
  bar.addEventListener("pointerup", () => document.body.classList.remove("dragging"));
  bar.addEventListener("keydown", (event) => {
    const step = { ArrowUp: -4, ArrowDown: 4 }[event.key];
    if (!step) return;
    event.preventDefault();
    watch.disconnect();
    put(Number(bar.getAttribute("aria-valuenow")) + step);
  });
}

function help() {
  const dialog = $("#help-dialog");
  $("#help").addEventListener("click", () => dialog.showModal());
  $("#help-close").addEventListener("click", () => dialog.close());
}

/** Without its session the page is nothing: say so, and where to go. */
function lost(error) {
  if (error.lost) {
    banner("The service does not answer; trying again.", "lost");
    setTimeout(() => location.reload(), 2 * RETRY);
    return;
  }
  if (!(error instanceof api.Refusal)) throw error;
  banner(`${error.message} `, "lost");
  $("#banner").append(Object.assign(document.createElement("a"),
    { href: "/", textContent: "Open the start page" }));
}

window.ridetune = {
  state: get, timing, scene: scene.seen, drawn: charts.drawn, zoomed: charts.zoomed,
  clock: timeline.clock, job: identification.current,
  validation: validation.current, campaign: campaign.current, profile: profile.current, advice: advice.given, idle, unsaved: keeping.unsaved,
};

start().catch(lost);

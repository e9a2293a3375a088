// The only module that talks to the service. Everything is SI here.
//
// A run is {time: Float32Array, values: {channel: Float32Array}, head}.

const FRAMES = "application/vnd.ridetune.frames";

/** A refusal of the service (RFC 9457) in words for a person, or a lost connection. */
export class Refusal extends Error {
  constructor(problem, status = 0) {
    super(problem.detail ?? problem.title ?? "The service did not say why.");
    this.title = problem.title ?? "The service refused";
    this.code = problem.code ?? "";
    this.field = problem.field ?? null;
    this.status = status;
    this.lost = status === 0;
  }
}

let base = "";

/** Which session all further calls are about. */
export function useSession(id) {
  base = `/api/sessions/${encodeURIComponent(id)}`;
}

async function call(method, url, { body, accept = "application/json", keepalive = false } = {}) {
  const init = { method, headers: { Accept: accept }, keepalive };
  if (body instanceof FormData) init.body = body;
  else if (body !== undefined) {
    init.body = JSON.stringify(body);
    init.headers["Content-Type"] = "application/json";
  }
  let reply;
  try {
    reply = await fetch(url, init);
  } catch {
    throw new Refusal({ title: "No connection", detail: "The service does not answer." });
  }
  if (!reply.ok) throw await refusal(reply);
  return reply;
}

async function refusal(reply) {
  let problem;
  try {
    problem = await reply.json();
  } catch {
    problem = { title: `HTTP ${reply.status}`, detail: "The service failed without a reason." };
  }
  return new Refusal(problem, reply.status);
}

const json = async (...args) => {
  const reply = await call(...args);
  return reply.status === 204 ? null : reply.json();
};

/** A file as a form sends it. */
function inForm(file) {
  const form = new FormData();
  form.append("file", file, file.name);
  return form;
}

/** Bytes of the frames format as a run. */
export function decode(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const values = {};
  let offset = 4 + length;
  for (const { name } of head.channels) {
    values[name] = new Float32Array(buffer, offset, head.samples);
    offset += 4 * head.samples;
  }
  return { time: values.time, values, head };
}

async function frames(...args) {
  return decode(await (await call(...args)).arrayBuffer());
}

// The service's tables
/** {state, message}; a 503 while compiling is an answer, not a failure. */
export async function readiness() {
  let reply;
  try {
    reply = await fetch("/readyz");
  } catch {
    throw new Refusal({ title: "No connection", detail: "The service does not answer." });
  }
  const answer = await reply.json().catch(() => ({}));
  return { state: answer.state ?? (reply.ok ? "ready" : "compiling"), ...answer };
}
export const parameters = () => json("GET", "/api/parameters");
/** Default bounds of a fit from {name: start value}; null where none follow. */
export const defaultBounds = (start) =>
  json("POST", "/api/parameters/bounds", { body: { start } });
export const channels = () => json("GET", "/api/channels");
export const vehicles = () => json("GET", "/api/vehicles");
export const referenceVehicle = (key) => json("GET", `/api/vehicles/${encodeURIComponent(key)}`);
export const manoeuvres = () => json("GET", "/api/manoeuvres");
export const plants = () => json("GET", "/api/plants");
export const formats = () => json("GET", "/api/formats");
/** {sensors, channels, rate_hz} of a file of sensors, TOML or JSON. */
export const readSensors = (file) => json("POST", "/api/sensors", { body: inForm(file) });
export const roads = () => json("GET", "/api/roads");
export const rimsSettings = () => json("GET", "/api/rims-settings");

// The sessions of the visitor
export const sessions = () => json("GET", "/api/sessions");
/** A fresh one; without a name the service finds one. */
export const newSession = (name) => json("POST", "/api/sessions", name ? { body: { name } } : {});
export const deleteSession = (id) => json("DELETE", `/api/sessions/${encodeURIComponent(id)}`);

// The session
export const session = () => json("GET", base);
/** `leaving`: the request outlives the page, for which browsers take up to 64 KiB. */
export const saveVehicle = (vehicle, leaving = false) =>
  json("PUT", `${base}/vehicle`, { body: vehicle, keepalive: leaving });
export const changeSetup = (changes, leaving = false) =>
  json("PATCH", `${base}/setup`, { body: changes, keepalive: leaving });
export const renameSession = (name) => json("PATCH", base, { body: { name } });
export const saveBaseline = (vehicle) => json("PUT", `${base}/baseline`, { body: vehicle });
export const simulate = (body) =>
  frames("POST", `${base}/simulations`, { body, accept: FRAMES });
/** A websocket on which each message is a body of `simulate`. */
export const simulations = () =>
  new WebSocket(`${location.origin.replace(/^http/, "ws")}${base}/simulations`);
/** Which manoeuvre to drive next, for {identification}. */
export const advise = (body) => json("POST", `${base}/advice`, { body });
export async function simulateFile(body) {
  return (await call("POST", `${base}/simulations`, { body, accept: "text/csv" })).blob();
}

// Measurements
export const upload = (file) => json("POST", `${base}/measurements`, { body: inForm(file) });
export const measurements = () => json("GET", `${base}/measurements`);
export const deleteMeasurement = (id) => json("DELETE", `${base}/measurements/${id}`);
/** Take a measurement's noise from a NAME.toml. */
export const attachNotes = (id, file) => attach(id, "notes", file);
/** Take what was driven from a NAME.manoeuvre.json. */
export const attachManoeuvre = (id, file) => attach(id, "manoeuvre", file);
export const forgetManoeuvre = (id) => json("DELETE", `${base}/measurements/${id}/manoeuvre`);
const attach = (id, what, file) =>
  json("PUT", `${base}/measurements/${id}/${what}`, { body: inForm(file) });
export const originalUrl = (id) => `${base}/measurements/${id}/original`;
/** The recording as it is used, in SI; its notes; which of the file's columns are which channels. */
export const runUrl = (id) => `${base}/measurements/${id}/run.csv`;
export const notesUrl = (id) => `${base}/measurements/${id}/run.toml`;
export const mappingUrl = (id) => `${base}/measurements/${id}/mapping`;
export function measurement(id, channelNames, maxSamples, decimate = "stride", conditioned = true) {
  const query = new URLSearchParams({ max_samples: maxSamples, decimate, conditioned });
  if (channelNames) query.set("channels", channelNames.join(","));
  return frames("GET", `${base}/measurements/${id}/frames?${query}`, { accept: FRAMES });
}

// Columns as channels
export const columns = (id) => json("GET", `${base}/measurements/${id}/columns`);
/** Least and greatest values of one column, in the file's numbers. */
export const columnPreview = async (id, index, points) =>
  (await json("GET", `${base}/measurements/${id}/columns/preview?index=${index}&points=${points}`))[0];
/** One column as a channel that a person chooses for it: unit, sign, reason. */
export const columnAs = (id, index, channel) =>
  json("GET", `${base}/measurements/${id}/columns/candidate?index=${index}&channel=${encodeURIComponent(channel)}`);
export const setMapping = (id, mapping) =>
  json("PUT", `${base}/measurements/${id}/mapping`, { body: mapping });
export const forgetMapping = (id) => json("DELETE", `${base}/measurements/${id}/mapping`);
export const mappings = () => json("GET", `${base}/mappings`);
export const keepMapping = (name, mapping) =>
  json("POST", `${base}/mappings`, { body: { name, mapping } });
export const deleteMapping = (name) =>
  json("DELETE", `${base}/mappings/${encodeURIComponent(name)}`);

// What is done to a recording before it is used
export const conditioning = (id) => json("GET", `${base}/measurements/${id}/conditioning`);
export const setConditioning = (id, steps) =>
  json("PUT", `${base}/measurements/${id}/conditioning`, { body: { steps } });

// Jobs of a kind: "identifications", "profiles", "validations" or "campaigns"
export const submit = (kind, body) => json("POST", `${base}/${kind}`, { body });
export const jobs = (kind) => json("GET", `${base}/${kind}`);
export const job = (kind, id) => json("GET", `${base}/${kind}/${id}`);
export const cancelJob = (kind, id) => json("POST", `${base}/${kind}/${id}/cancel`);

/** Whether the service answers at all. */
export const answers = () => fetch("/healthz").then(() => true, () => false);

/**
 * Follow a job: onProgress(progress), onState(job), onLost() when the connection is. Returns a function
 * that stops following.
 */
export function follow(kind, id, onProgress, onState, onLost) {
  const source = new EventSource(`${base}/${kind}/${id}/events`);
  source.addEventListener("progress", (event) => onProgress(JSON.parse(event.data)));
  source.addEventListener("state", (event) => {
    const job = JSON.parse(event.data);
    if (isFinal(job.state)) source.close();
    onState(job);
  });
  // EventSource reconnects by itself; when the service refuses for good, one look tells the end.
  source.addEventListener("error", () => {
    onLost();
    if (source.readyState !== EventSource.CLOSED) return;
    setTimeout(async () => {
      try {
        const found = await job(kind, id);
        onState(found);
        if (!isFinal(found.state)) stop = follow(kind, id, onProgress, onState, onLost);
      } catch (error) {
        if (error.lost || error.status >= 500) source.dispatchEvent(new Event("error"));
      }
    }, 2000);
  });
  let stop = () => source.close();
  return () => stop();
}

export const isFinal = (state) => ["done", "failed", "cancelled"].includes(state);

// What a validation and a campaign have besides
/** What the report shows, as JSON. */
export const validationDocument = (id) => json("GET", `${base}/validations/${id}/result.json`);
export const reportUrl = (id) => `${base}/validations/${id}/report.html`;
/** The whole recordings as measurements of the session. */
export const takeOver = (id) => json("POST", `${base}/campaigns/${id}/measurements`);
/** What is known of the car that drove. */
export const campaignVehicle = (id) => json("GET", campaignFileUrl(id, "vehicle.json"));
export const campaignUrl = (id) => `${base}/campaigns/${id}/campaign.zip`;
export const campaignFileUrl = (id, name) =>
  `${base}/campaigns/${id}/files/${encodeURIComponent(name)}`;

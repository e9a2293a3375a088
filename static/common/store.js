// What the page knows, in one place. Keys:
//
//   session      its id
//   name         what it is called; a session is a project
//   parameters   rows of /api/parameters
//   channels     rows of /api/channels
//   vehicle      the session's vehicle, with the sliders' values in it
//   baseline     the vehicle that the sliders are compared with
//   values       {parameter name: SI value}, the sliders
//   measurements, vehicles, manoeuvres, plants, formats, roads   lists of the service
//                (a manoeuvre that the service does not know by its key is `given` as an object)
//   ride         {kind: "measurement", id} or {kind: "manoeuvre", key}
//   road         null (as the manoeuvre says) or a road description
//   use          {measurement id: "fit", "hold_out" or "leave_out"} where that was chosen
//   fixed        names of the parameters that a fit leaves alone
//   bounds       {parameter: [SI or null, SI or null]}, typed
//   search       {starts, seed, loss, loss_scale} of a fit
//   noise        {channel: SI}, typed
//   priors       {parameter: [mean or null, deviation or null]}, SI, typed
//   sensors      {channel: {quantity: SI or "fit"}}, typed
//   fitNoise     the noise of the compared channels is to be found
//   traction     how a measured ride gets its traction, "exact" or "paper"
//   rimsSettings   filters and initial state with which recordings drive the model
//   rimsUsual    those that hold where none are chosen
//   defaultBounds   {start, bounds}: default bounds of a fit by parameter, and their start values
//   braking      {measurement id: [[begin, end], ...]} in s, marked by hand
//   liftOff      wheels may leave the road
//   compare      "baseline", "7dof" or "none"
//   now, reference, measured   runs (see api.js) of the ride, or null
//   valuesNow    the sliders' values with which `now` was simulated
//   bands        95 % bands of `now` by the errors of the fit (a run with X.lower, X.upper), or null
//   trouble      why the last simulation was refused (its `values` with which sliders), or null
//   fitJob       the last identification that is done, or null; set by identification.js alone. Another
//                car on the sliders leaves it: what was found stays found, of the car it was found for
//   fit          its result (fit.json), null without one
//   ready        the service has compiled its kernels
//   online       the service answers

const state = {};
const listeners = [];

export const get = (key) => state[key];

/**
 * Change keys and tell whoever listens to one of them. A listener that fails is reported where errors
 * of the page are: neither the others nor whoever made the change have anything to do with it.
 */
export function set(changes) {
  const keys = Object.keys(changes).filter((key) => state[key] !== changes[key]);
  Object.assign(state, changes);
  for (const { names, fn } of listeners) {
    if (!keys.some((key) => names.includes(key))) continue;
    try {
      fn(state);
    } catch (error) {
      reportError(error);
    }
  }
}

/** Call `fn(state)` after any of the space-separated keys has changed. */
export function on(keys, fn) {
  listeners.push({ names: keys.split(" "), fn });
}

// The road as a surface, from what the wheels met: heights over distance under both tracks.
//
// Road rides have `road.*.z`. A measured ride has none; there the path of the rims is shown, which
// is the road as far as the tyre is stiff. A car on a rig stands on flat ground.

const BEHIND = 30;
const AHEAD = 60;
const STEP = 0.15;
const MOST_STATIONS = 2600;
const EDGE = 1.75;
const LANE = [1.02, 0.48];
const MARK_EVERY = 2;

/** {vertices, faces, marks} for the scene's road nodes, heights not magnified. */
export function surface(vehicle, run) {
  const profiles = [profile(vehicle, run, "l"), profile(vehicle, run, "r")];
  const start = Math.min(profiles[0].x[0], profiles[1].x[0]) - BEHIND;
  const end = profiles[0].x.at(-1) + AHEAD;
  const stations = Math.min(Math.ceil((end - start) / STEP), MOST_STATIONS);
  const step = (end - start) / (stations - 1);
  const y = [EDGE, ...LANE, ...LANE.map((v) => -v).reverse(), -EDGE];
  const columns = y.length;
  const vertices = new Float32Array(3 * columns * stations);
  const heights = profiles.map(({ x, z }) => resample(x, z, start, step, stations));
  for (let k = 0, at = 0; k < stations; k++) {
    for (let c = 0; c < columns; c++) {
      vertices[at++] = start + k * step;
      vertices[at++] = y[c];
      vertices[at++] = heights[c < columns / 2 ? 0 : 1][k];
    }
  }
  return { vertices, faces: grid(stations, columns), marks: marks(vertices, columns, step) };
}

function profile(vehicle, run, side) {
  const [front, rear] = ["f", "r"].map(
    (axle) => run.values[`road.${axle}${side}.z`] ?? run.values[`wheel.${axle}${side}.z`],
  );
  const travelled = run.values["chassis.x"] ?? distance(run);
  if (!front || !travelled || travelled.at(-1) - travelled[0] < 1) {
    return { x: [-3, 3], z: [0, 0] };
  }
  const x = [];
  const z = [];
  const take = (at, height) => {
    if (x.length && at < x.at(-1) + 0.02) return;
    x.push(at);
    z.push(Number.isFinite(height) ? height : 0);
  };
  const first = travelled[0] + vehicle.front.cg_distance;
  if (rear) {
    for (let i = 0; i < travelled.length; i++) {
      const at = travelled[i] - vehicle.rear.cg_distance;
      if (at < first) take(at, rear[i]);
    }
  }
  travelled.forEach((value, i) => take(value + vehicle.front.cg_distance, front[i]));
  return { x, z };
}

/** Distance travelled from the measured speed, where the file has no distance. */
function distance(run) {
  const speed = run.values["chassis.v_x"];
  if (!speed) return null;
  const x = new Float32Array(speed.length);
  for (let i = 1; i < x.length; i++) {
    x[i] = x[i - 1] + ((speed[i] + speed[i - 1]) / 2) * (run.time[i] - run.time[i - 1]);
  }
  return x;
}

function resample(x, z, start, step, count) {
  const out = new Float32Array(count);
  for (let k = 0, i = 0; k < count; k++) {
    const at = start + k * step;
    while (i < x.length - 2 && x[i + 1] < at) i++;
    const w = Math.min(Math.max((at - x[i]) / (x[i + 1] - x[i]), 0), 1);
    out[k] = (1 - w) * z[i] + w * z[i + 1];
  }
  return out;
}

function grid(rows, columns) {
  const faces = new Uint32Array(6 * (rows - 1) * (columns - 1));
  let at = 0;
  for (let r = 0; r < rows - 1; r++) {
    for (let c = 0; c < columns - 1; c++) {
      const a = r * columns + c;
      const b = a + columns;
      faces.set([a, a + 1, b + 1, a, b + 1, b], at);
      at += 6;
    }
  }
  return faces;
}

/** Cross lines every MARK_EVERY metres, as (start, end) pairs. */
function marks(vertices, columns, step) {
  const every = Math.max(1, Math.round(MARK_EVERY / step));
  const rows = vertices.length / 3 / columns;
  const out = [];
  for (let r = 0; r < rows; r += every) {
    for (let c = 0; c < columns - 1; c++) {
      const at = 3 * (r * columns + c);
      out.push(...vertices.subarray(at, at + 6));
    }
  }
  return new Float32Array(out);
}

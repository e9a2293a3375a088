// Where every part of the car is at one instant: pure arithmetic, no document, no server.
//
// Frame: X forward with its origin under the CG at rest (it travels with the car), Y left, Z up,
// Z = 0 the flat ground. Body frame B and signs after ISO 8855. Nodes are those of app/viewer/scene.py. Motion is magnified about the state of rest: z, pitch, roll, arm angles,
// wheel heights and the road alike.

const INBOARD = 0.19;
const BAR_SHARE = 0.25;
const SHADOW_LIFT = 0.012;
/** Where the body is, roughly: beyond either axle as a share of the wheelbase, and in height, m. */
const OVERHANG = 0.33;
const BODY_HEIGHTS = [0.05, 1.3];
export const CORNERS = ["fl", "fr", "rl", "rr"];
/** Channels that a pose is made of. */
export const POSE_CHANNELS = [
  "chassis.x", "chassis.z", "chassis.pitch", "chassis.roll",
  ...CORNERS.flatMap((c) => [`arm.${c}.angle`, `wheel.${c}.z`, `road.${c}.z`, `post.${c}.z`]),
];

/** Index and weight of an instant between samples: value = (1 - w) v[i] + w v[i + 1]. */
export function locate(time, t) {
  const last = time.length - 1;
  if (last < 1 || t <= time[0]) return [0, 0];
  if (t >= time[last]) return [last - 1, 1];
  let low = 0;
  let high = last;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (time[middle] <= t) low = middle;
    else high = middle;
  }
  return [low, (t - time[low]) / (time[high] - time[low])];
}

/** A channel's value at a located instant; NaN where the run does not have it. */
export function valueAt(run, name, [i, w]) {
  const values = run.values[name];
  if (!values) return NaN;
  return w ? (1 - w) * values[i] + w * values[i + 1] : values[i];
}

const or0 = (x) => (Number.isFinite(x) ? x : 0);

/** Geometry of a corner at rest, in B. */
function corner(vehicle, name) {
  const front = name[0] === "f";
  const axle = front ? vehicle.front : vehicle.rear;
  const forward = front ? 1 : -1;
  const side = name[1] === "l" ? 1 : -1;
  const cgHeight = vehicle.chassis.cg_height;
  const x = forward * axle.cg_distance;
  const { distance, angle } = axle.pivot;
  return {
    side, radius: axle.wheel.radius,
    hub: [x, (side * axle.track) / 2, axle.wheel.radius - cgHeight],
    pivot: [x - forward * distance, (side * axle.track) / 2, distance * Math.tan(angle) - cgHeight],
    mountHeight: axle.suspension.mount_height ?? 0.4,
  };
}

/**
 * How much of an arm, from the wheel on, lies within the body at rest. A pivot is the centre of a
 * motion: where it lies underground or far off, nothing of the car is there.
 */
function shareInBody(vehicle, { hub, pivot }) {
  const { front, rear, chassis } = vehicle;
  const beyond = OVERHANG * (front.cg_distance + rear.cg_distance);
  const room = { 0: [-rear.cg_distance - beyond, front.cg_distance + beyond],
    2: BODY_HEIGHTS.map((height) => height - chassis.cg_height) };
  const shares = Object.entries(room).map(([k, [low, high]]) => {
    const way = pivot[k] - hub[k];
    return Math.abs(way) < 1e-9 ? 1 : ((way < 0 ? low : high) - hub[k]) / way;
  });
  return Math.max(0, Math.min(1, ...shares));
}

/** Axles whose pivots lie where no arm is drawn: [{axle, distance, height}], m, height from the ground. */
export const farPivots = (vehicle) => ["fl", "rl"]
  .filter((name) => shareInBody(vehicle, corner(vehicle, name)) < 1)
  .map((name) => {
    const axle = name === "fl" ? "front" : "rear";
    const { distance, angle } = vehicle[axle].pivot;
    return { axle, distance, height: distance * Math.tan(angle) };
  });

/** The body's pose at an instant: position, quaternion (w x y z) and a map from B to the frame. */
export function bodyPose(vehicle, run, where, magnification) {
  const z = vehicle.chassis.cg_height + magnification * or0(valueAt(run, "chassis.z", where));
  const pitch = magnification * or0(valueAt(run, "chassis.pitch", where));
  const roll = magnification * or0(valueAt(run, "chassis.roll", where));
  const [cp, sp, cr, sr] = [Math.cos(pitch), Math.sin(pitch), Math.cos(roll), Math.sin(roll)];
  return {
    position: [0, 0, z],
    wxyz: product(aboutY(pitch), [Math.cos(roll / 2), Math.sin(roll / 2), 0, 0]),
    place: ([x, y, up]) => {
      const across = cr * y - sr * up;
      const above = sr * y + cr * up;
      return [cp * x + sp * above, across, z - sp * x + cp * above];
    },
  };
}

/** viser messages that put the car's parts in place. */
export function carMessages(vehicle, run, t, magnification) {
  const where = locate(run.time, t);
  const travelled = or0(valueAt(run, "chassis.x", where));
  const body = bodyPose(vehicle, run, where, magnification);
  const messages = [...pose("/car/body", body.position, body.wxyz)];
  const onBar = {};
  for (const name of CORNERS) {
    const geometry = corner(vehicle, name);
    const { side, radius, hub, pivot, mountHeight } = geometry;
    const angle = magnification * or0(valueAt(run, `arm.${name}.angle`, where));
    const height = valueAt(run, `wheel.${name}.z`, where);
    const [c, s] = [Math.cos(angle), Math.sin(angle)];
    const [dx, dz] = [hub[0] - pivot[0], hub[2] - pivot[2]];
    const centre = body.place([pivot[0] + c * dx + s * dz, hub[1], pivot[2] - s * dx + c * dz]);
    // Exact at any magnification: large rotations would lift a wheel off its magnified road.
    if (Number.isFinite(height)) centre[2] = radius + magnification * height;
    const inboard = (point) => [point[0], point[1] - side * INBOARD, point[2]];
    const inner = inboard(centre);
    const hinge = inboard(body.place(pivot));
    const mount = inboard(body.place([hub[0], hub[1], hub[2] + mountHeight]));
    const turn = product(body.wxyz, aboutY(angle + travelled / radius));
    const [, strut] = turnTo([0, 0, 1], inner, mount);
    const [length, along] = turnTo([1, 0, 0], inner, hinge);
    const share = shareInBody(vehicle, geometry);
    messages.push(
      ...pose(`/car/wheel_${name}`, centre, turn),
      ...pose(`/car/pivot_${name}`, hinge, body.wxyz),
      ...pose(`/car/arm_${name}`, inner, along),
      ...pose(`/car/ray_${name}`, inner, along),
      ...pose(`/car/spring_${name}`, inner, strut),
      ...pose(`/car/damper_${name}`, inner, strut),
      ...pose(`/car/rod_${name}`, mount, strut),
      update(`/car/spring_${name}`, { scale: [1, 1, distance(inner, mount)] }),
      update(`/car/arm_${name}`, { scale: [share * length, 1, 1] }),
      update(`/car/ray_${name}`, { scale: [length, 1, 1] }),
      visibility(`/car/pivot_${name}`, share === 1),
    );
    if (side < 0) {
      messages.push(position(`/car/body/grip_${name === "fr" ? "front" : "rear"}`, inboard(pivot)));
    }
    onBar[name] = inner.map((value, k) => value + BAR_SHARE * share * (hinge[k] - value));
  }
  for (const [axle, right, left] of [["front", onBar.fr, onBar.fl], ["rear", onBar.rr, onBar.rl]]) {
    const [length, across] = turnTo([0, 1, 0], right, left);
    messages.push(...pose(`/car/bar_${axle}`, right, across),
      update(`/car/bar_${axle}`, { scale: [1, length, 1] }));
  }
  // On a rig the ground moves with the posts; the shadow lies on what the wheels stand on.
  const [height, , tilt] = plane(vehicle, run, "post", where, magnification);
  const [under, slope, lean] = plane(vehicle, run, "wheel", where, magnification);
  const middle = (vehicle.front.cg_distance - vehicle.rear.cg_distance) / 2;
  messages.push(...pose("/car/shadow", [middle, 0, under + slope * middle + SHADOW_LIFT], lean));
  messages.push(...pose("/road/surface", [-travelled, 0, height], tilt),
    ...pose("/road/lines", [-travelled, 0, height + 0.004], tilt));
  return messages;
}

/** The plane that four magnified heights make: height at X = 0, slope along X, and its turn. */
function plane(vehicle, run, what, where, magnification) {
  const [fl, fr, rl, rr] = CORNERS.map((c) =>
    magnification * or0(valueAt(run, `${what}.${c}.z`, where)));
  const { front, rear } = vehicle;
  const frontHeight = (fl + fr) / 2;
  const rearHeight = (rl + rr) / 2;
  const slope = (frontHeight - rearHeight) / (front.cg_distance + rear.cg_distance);
  const bank = (fl - fr + rl - rr) / (front.track + rear.track);
  return [rearHeight + slope * rear.cg_distance, slope,
    product(aboutY(-Math.atan(slope)), [Math.cos(bank / 2), Math.sin(bank / 2), 0, 0])];
}

/** Pivot distance and angle (SI) of an axle from where its grip is, in B. */
export function pivotAt(vehicle, axle, [x, , z]) {
  const distance = axle === "front" ? vehicle.front.cg_distance - x : x + vehicle.rear.cg_distance;
  return { distance, angle: Math.atan((z + vehicle.chassis.cg_height) / distance) };
}

/** viser messages for the outline of another run of the same instant. */
export function ghostMessages(vehicle, run, t, magnification) {
  const where = locate(run.time, t);
  const body = bodyPose(vehicle, run, where, magnification);
  const messages = pose("/ghost/body", body.position, body.wxyz);
  for (const name of CORNERS) {
    const { hub, radius } = corner(vehicle, name);
    const height = or0(valueAt(run, `wheel.${name}.z`, where));
    messages.push(
      position(`/ghost/wheel_${name}`, [hub[0], hub[1], radius + magnification * height]),
    );
  }
  return messages;
}

export const visibility = (name, visible) =>
  ({ type: "SetSceneNodeVisibilityMessage", name, visible, owner: "" });
export const update = (name, updates) =>
  ({ type: "SceneNodeUpdateMessage", name, updates, owner: "" });
const position = (name, at) => ({ type: "SetPositionMessage", name, position: at, owner: "" });
const pose = (name, at, wxyz) =>
  [position(name, at), { type: "SetOrientationMessage", name, wxyz, owner: "" }];

const distance = (a, b) => Math.hypot(b[0] - a[0], b[1] - a[1], b[2] - a[2]);

/** Length from a to b, and the shortest turn that brings a unit axis into that direction. */
function turnTo(axis, a, b) {
  const length = distance(a, b) || 1e-9;
  const d = [0, 1, 2].map((k) => (b[k] - a[k]) / length);
  const w = 1 + axis[0] * d[0] + axis[1] * d[1] + axis[2] * d[2];
  // Straight back: half a turn about Z, or about X for the Z axis.
  if (w < 1e-6) return [length, axis[2] ? [0, 1, 0, 0] : [0, 0, 0, 1]];
  const q = [w, axis[1] * d[2] - axis[2] * d[1], axis[2] * d[0] - axis[0] * d[2],
    axis[0] * d[1] - axis[1] * d[0]];
  const size = Math.hypot(...q);
  return [length, q.map((value) => value / size)];
}

const aboutY = (angle) => [Math.cos(angle / 2), 0, Math.sin(angle / 2), 0];

function product([a, b, c, d], [e, f, g, k]) {
  return [
    a * e - b * f - c * g - d * k,
    a * f + b * e + c * k - d * g,
    a * g - b * k + c * e + d * f,
    a * k + b * g - c * f + d * e,
  ];
}

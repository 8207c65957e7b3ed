// Flesh on the bones: a body of spheres round the joints, and the parts that are hulls of those spheres.
// Joint names and parents come with the payload (playground/motion/skeleton.py); here is the drawing only.

// name: [kind, ..., radius in metres].
//   joint NAME · between A B share · beyond A B metres (past B) · off NAME frame [left, up, forward] metres
const MIDDLE = {
  waist: ["off", "spine1", "hips", [0, 0, 0.025], 0.098],
  belly: ["off", "pelvis", "hips", [0, 0.03, 0.012], 0.102],
  seat: ["off", "pelvis", "hips", [0, -0.045, -0.03], 0.1],
  hipL: ["off", "l_hip", "hips", [0.022, -0.01, 0], 0.086],
  hipR: ["off", "r_hip", "hips", [-0.022, -0.01, 0], 0.086],
  ribs: ["off", "spine2", "chest", [0, -0.02, 0.03], 0.108],
  chest: ["off", "spine3", "chest", [0, 0.06, 0.035], 0.112],
  breastL: ["off", "spine3", "chest", [0.075, 0.09, 0.025], 0.085],
  breastR: ["off", "spine3", "chest", [-0.075, 0.09, 0.025], 0.085],
  yokeL: ["between", "l_shoulder", "l_collar", 0.3, 0.056],
  yokeR: ["between", "r_shoulder", "r_collar", 0.3, 0.056],
  nape: ["off", "neck", "chest", [0, 0.0, 0.0], 0.062],
  throat: ["off", "neck", "chest", [0, 0.02, 0.01], 0.05],
  skullBase: ["off", "head", "head", [0, 0.015, -0.012], 0.05],
  jaw: ["off", "head", "head", [0, -0.002, 0.042], 0.05],
  brow: ["off", "head", "head", [0, 0.09, 0.026], 0.077],
  crown: ["off", "head", "head", [0, 0.102, -0.018], 0.085],
  bridge: ["off", "head", "head", [0, 0.078, 0.098], 0.006],
  nose: ["off", "head", "head", [0, 0.042, 0.106], 0.012],
  eyeL: ["off", "head", "head", [0.042, 0.082, 0.068], 0.021],
  eyeR: ["off", "head", "head", [-0.042, 0.082, 0.068], 0.021],
  eyes: ["off", "head", "head", [0, 0.08, 0.083], 0.022],
};

function limbSpheres(side) {
  const s = side === "L" ? "l_" : "r_", out = side === "L" ? 1 : -1;
  return {
    [`shoulder${side}`]: ["off", `${s}shoulder`, "chest", [-0.004 * out, -0.002, 0], 0.06],
    [`biceps${side}`]: ["between", `${s}shoulder`, `${s}elbow`, 0.45, 0.049],
    [`elbow${side}`]: ["joint", `${s}elbow`, 0.04],
    [`forearm${side}`]: ["between", `${s}elbow`, `${s}wrist`, 0.28, 0.043],
    [`wrist${side}`]: ["joint", `${s}wrist`, 0.028],
    [`palm${side}`]: ["beyond", `${s}elbow`, `${s}wrist`, 0.065, 0.036],
    [`fingers${side}`]: ["beyond", `${s}elbow`, `${s}wrist`, 0.14, 0.02],
    [`groin${side}`]: ["off", `${s}hip`, "hips", [0.02 * out, -0.03, 0], 0.086],
    [`thigh${side}`]: ["between", `${s}hip`, `${s}knee`, 0.35, 0.081],
    [`knee${side}`]: ["joint", `${s}knee`, 0.055],
    [`calf${side}`]: ["calf", `${s}knee`, `${s}ankle`, `${s}foot`, 0.054],
    [`ankle${side}`]: ["joint", `${s}ankle`, 0.037],
    [`heel${side}`]: ["sole", `${s}knee`, `${s}ankle`, `${s}foot`, [-0.045, -0.03], 0.034],
    [`ball${side}`]: ["sole", `${s}knee`, `${s}ankle`, `${s}foot`, [0.125, -0.028], 0.036],
    [`toe${side}`]: ["sole", `${s}knee`, `${s}ankle`, `${s}foot`, [0.185, -0.036], 0.026],
  };
}

// parts: [spheres, spheres whose rim is not drawn because the next shape goes on there]
function limbShapes(side) {
  const shape = (spheres, open) => {
    const named = (names) => names.map((name) => name + side);
    return { tone: side, behind: 0, parts: [[named(spheres), named(open)]] };
  };
  return [
    shape(["groin", "thigh", "knee"], ["groin", "knee"]),
    shape(["knee", "calf", "ankle"], ["knee", "ankle"]),
    shape(["ankle", "heel", "ball", "toe"], ["ankle"]),
    shape(["shoulder", "biceps", "elbow"], ["shoulder", "elbow"]),
    shape(["elbow", "forearm", "wrist"], ["elbow", "wrist"]),
    shape(["wrist", "palm", "fingers"], ["wrist"]),
  ];
}

// Parts that are painted as one shape; `behind` moves a shape back, in metres, so that its neighbour covers the seam.
const SHAPES = [
  {
    tone: "M",
    behind: 0,
    parts: [
      [["waist", "belly", "seat", "hipL", "hipR"], []],
      [["waist", "ribs", "belly"], []],
      [["ribs", "chest", "breastL", "breastR", "yokeL", "yokeR", "nape"], []],
    ],
  },
  { tone: "M", behind: 0.16, parts: [[["throat", "skullBase"], ["throat", "skullBase"]]] },
  { tone: "H", behind: 0, parts: [[["skullBase", "jaw", "brow", "crown"], []]] },
  { tone: "H", behind: 0.2, parts: [[["bridge", "nose"], ["bridge", "nose"]]] }, // shows in the profile only
  { tone: "V", behind: 0, parts: [[["eyeL", "eyes", "eyeR"], ["eyeL", "eyes", "eyeR"]]] }, // a visor tells the face
  ...limbShapes("L"), ...limbShapes("R"),
];

// The body of a skeleton: radii of its spheres, the shapes they make, and a function that places them on a pose.
export function createBody(skeleton) {
  const joint = Object.fromEntries(skeleton.names.map((name, index) => [name, index]));
  const table = { ...MIDDLE, ...limbSpheres("L"), ...limbSpheres("R") };
  const names = Object.keys(table);
  const recipes = names.map((name) => compile(table[name], joint));
  const shapes = SHAPES.map((shape) => ({
    ...shape,
    parts: shape.parts.map(([spheres, open]) => ({
      spheres: spheres.map((name) => names.indexOf(name)),
      open: spheres.map((name) => open.includes(name)),
    })),
  }));
  const frames = { hips: new Float64Array(9), chest: new Float64Array(9), head: new Float64Array(9) };
  return {
    shapes,
    radii: Float64Array.from(names, (name) => table[name].at(-1)),
    size: names.length,
    // pose: [J * 3] positions; out: [size * 3] sphere centres.
    place(pose, out) {
      axes(pose, joint.l_hip, joint.r_hip, joint.pelvis, joint.spine2, frames.hips);
      axes(pose, joint.l_shoulder, joint.r_shoulder, joint.spine2, joint.neck, frames.chest);
      headAxes(pose, joint.neck, joint.head, frames.chest, frames.head);
      for (let i = 0; i < recipes.length; i++) recipes[i](pose, frames, out, 3 * i);
    },
  };
}

function compile(recipe, joint) {
  const [kind, a, b, c] = recipe;
  const from = 3 * joint[a], to = 3 * joint[b];
  if (kind === "joint") return (pose, _, out, at) => out.set(pose.subarray(from, from + 3), at);
  if (kind === "between") return (pose, _, out, at) => along(pose, from, to, c, out, at);
  if (kind === "beyond") {
    return (pose, _, out, at) => along(pose, from, to, 1 + c / (distance(pose, from, to) || 1), out, at);
  }
  if (kind === "off") {
    return (pose, frames, out, at) => {
      const frame = frames[b];
      for (let i = 0; i < 3; i++) {
        out[at + i] = pose[from + i] + frame[i] * c[0] + frame[3 + i] * c[1] + frame[6 + i] * c[2];
      }
    };
  }
  const foot = 3 * joint[c];
  if (kind === "calf") return (pose, _, out, at) => placeOnSole(pose, from, to, foot, -0.02, 0, out, at, 0.72);
  const [forward, up] = recipe[4];
  return (pose, _, out, at) => placeOnSole(pose, from, to, foot, forward, up, out, at, 0);
}

function along(pose, from, to, share, out, at) {
  for (let i = 0; i < 3; i++) out[at + i] = pose[from + i] + (pose[to + i] - pose[from + i]) * share;
}

function distance(pose, a, b) {
  return Math.hypot(pose[a] - pose[b], pose[a + 1] - pose[b + 1], pose[a + 2] - pose[b + 2]);
}

// A point beside the ankle in the foot's own directions (forward along the sole, up out of it), moved `back` of the way
// towards the knee. The sole lies 25 degrees above the line from ankle to ball.
const sole = new Float64Array(6);
function placeOnSole(pose, knee, ankle, foot, forward, up, out, at, back) {
  const length = distance(pose, ankle, foot) || 1;
  let dot = 0;
  for (let i = 0; i < 3; i++) {
    sole[i] = (pose[foot + i] - pose[ankle + i]) / length;
    sole[3 + i] = pose[knee + i] - pose[ankle + i];
    dot += sole[i] * sole[3 + i];
  }
  for (let i = 0; i < 3; i++) sole[3 + i] -= dot * sole[i];
  const lift = Math.hypot(sole[3], sole[4], sole[5]) || 1;
  for (let i = 0; i < 3; i++) {
    const e1 = sole[i], e2 = sole[3 + i] / lift;
    const ahead = 0.906 * e1 + 0.423 * e2, above = 0.906 * e2 - 0.423 * e1;
    const base = pose[ankle + i] + (pose[knee + i] - pose[ankle + i]) * back;
    out[at + i] = base + forward * ahead + up * above;
  }
}

// Left, up and forward of the trunk at a pair of joints: rows of a 3 x 3 matrix.
function axes(pose, left, right, low, high, out) {
  for (let i = 0; i < 3; i++) {
    out[i] = pose[3 * left + i] - pose[3 * right + i];
    out[3 + i] = pose[3 * high + i] - pose[3 * low + i];
  }
  orthonormal(out);
}

// The line from neck to head leans 38 degrees forward in a straight head; that lean is taken out again.
function headAxes(pose, neck, head, chest, out) {
  const length = distance(pose, 3 * neck, 3 * head) || 1;
  for (let i = 0; i < 3; i++) {
    out[i] = chest[i];
    out[3 + i] = (pose[3 * head + i] - pose[3 * neck + i]) / length - 0.58 * chest[6 + i];
  }
  orthonormal(out);
}

// Rows 0 (left) and 1 (up) are given; both become unit vectors at right angles, row 2 their cross product (forward).
function orthonormal(m) {
  normalise(m, 0);
  const dot = m[0] * m[3] + m[1] * m[4] + m[2] * m[5];
  for (let i = 0; i < 3; i++) m[3 + i] -= dot * m[i];
  normalise(m, 3);
  m[6] = m[1] * m[5] - m[2] * m[4];
  m[7] = m[2] * m[3] - m[0] * m[5];
  m[8] = m[0] * m[4] - m[1] * m[3];
}

function normalise(m, at) {
  const length = Math.hypot(m[at], m[at + 1], m[at + 2]) || 1;
  for (let i = at; i < at + 3; i++) m[i] /= length;
}

// How several figures share the picture: in how many rows, how far apart, and the way that the camera follows.

export const WORDS = 44; // pixels under the figures that belong to their names
export const AIR = 10; // pixels above them
const NAME = 116; // pixels that a name and its caption need
const LEAST = 100; // pixels below which a name would be cut short
const CROWD = 4; // figures from which on there may be two rows
const SMOOTH = 10; // frames on either side over which the followed point is averaged

// How far the bodies reach at most from their roots, sideways, in metres.
export function reachOf(figures, width, reaching) {
  let half = 0.45;
  for (const { joints, frames, centre } of figures) {
    for (let t = 0; t < frames; t += 3) {
      for (const j of reaching) {
        const at = t * width + j;
        half = Math.max(half, Math.hypot(joints[at] - centre[2 * t], joints[at + 2] - centre[2 * t + 1]));
      }
    }
  }
  return half;
}

// The height that the highest head needs, in metres.
export function tallOf(figures, width, head) {
  const heads = figures.map(({ joints }) => {
    let most = -Infinity;
    for (let i = head + 1; i < joints.length; i += width) most = Math.max(most, joints[i]);
    return most;
  });
  return Math.max(1.6, ...heads) + 0.2;
}

// {rows, across, spacing}: one row of figures or two, whichever shows them larger with their names whole; spacing of
// the lanes in metres. width, height: of the picture in CSS pixels; half, tall: reach and height in metres.
export function arrange(count, width, height, half, tall) {
  const least = Math.min(2, Math.max(0.85, 1.3 * half));
  const plans = (count >= CROWD ? [1, 2] : [1]).map((rows) => {
    const across = Math.max(1, Math.ceil(count / rows)), room = Math.max(1, height / rows - AIR - WORDS);
    const pixels = Math.min(room / tall, width / (across * least)); // of a metre
    return { rows, across, room, worth: pixels * Math.min(1, width / across / LEAST) };
  });
  const { rows, across, room } = plans.reduce((best, plan) => (plan.worth > 1.1 * best.worth ? plan : best));
  const pixel = tall / room; // metres
  const most = Math.max(1.9, NAME * pixel), free = (pixel * width) / across;
  return { rows, across, spacing: Math.max(least, Math.min(most, 0.95 * free)) };
}

// Root x, z averaged over neighbouring frames: what the camera follows without shaking at every step.
export function smoothRoot(joints, frames, width) {
  const out = new Float32Array(frames * 2);
  for (let t = 0; t < frames; t++) {
    const from = Math.max(0, t - SMOOTH), to = Math.min(frames - 1, t + SMOOTH);
    for (let s = from; s <= to; s++) {
      out[2 * t] += joints[s * width] / (to - from + 1);
      out[2 * t + 1] += joints[s * width + 2] / (to - from + 1);
    }
  }
  return out;
}

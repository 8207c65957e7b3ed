// The one twin of Python code: recovery of 22 joints from 67 columns (systems.md A1; from_features67 of
// playground/motion/representation.py) and the blend m = (1 + g) m_c - g m_u in normalised space (A8).

const COLUMNS = 67;
const JOINTS = 22;

// features: {conditional, unconditional, mean, std}, the first two [F * 67]; returns [F * 22 * 3] in metres.
export function guidedJoints(features, g, out = null) {
  const frames = features.conditional.length / COLUMNS;
  const row = new Float64Array(frames * COLUMNS);
  for (let t = 0, i = 0; t < frames; t++) {
    for (let c = 0; c < COLUMNS; c++, i++) {
      const blended = (1 + g) * features.conditional[i] - g * features.unconditional[i];
      row[i] = blended * features.std[c] + features.mean[c];
    }
  }
  return recoverJoints(row, frames, out);
}

// rows: [F * 67] in metres and radians. Column 0 is half the yaw step: cos and sin are of twice the running sum.
export function recoverJoints(rows, frames, out = null) {
  const joints = out && out.length === frames * JOINTS * 3 ? out : new Float32Array(frames * JOINTS * 3);
  let half = 0, x = 0, z = 0;
  for (let t = 0; t < frames; t++) {
    const now = t * COLUMNS, before = now - COLUMNS;
    if (t > 0) half += rows[before];
    const cos = Math.cos(2 * half), sin = Math.sin(2 * half);
    if (t > 0) {
      const vx = rows[before + 1], vz = rows[before + 2];
      x += cos * vx - sin * vz;
      z += sin * vx + cos * vz;
    }
    let at = t * JOINTS * 3;
    joints[at++] = x;
    joints[at++] = rows[now + 3];
    joints[at++] = z;
    for (let c = now + 4; c < now + COLUMNS; c += 3) {
      joints[at++] = x + cos * rows[c] - sin * rows[c + 2];
      joints[at++] = rows[c + 1];
      joints[at++] = z + sin * rows[c] + cos * rows[c + 2];
    }
  }
  return joints;
}

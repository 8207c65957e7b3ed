// The ground under the figures: a fading grid, soft shadows, the root's trail and the marks of feet that stand.

import { css } from "./colour.js";
import { project } from "./camera.js";

const BANDS = 6; // steps in which the grid fades out
const SHADOW = [0.16, -0.1]; // how far a shadow moves per metre of height
const STILL = 0.25; // m/s: slower feet stand
const LOW = 0.035; // metres above the foot's lowest point

const spot = new Float64Array(3);

export function paintGrid(ctx, camera, theme) {
  const reach = Math.max(4, Math.min(12, Math.ceil(camera.fitted * 0.75)));
  const x0 = Math.round(camera.target[0]), z0 = Math.round(camera.target[2]);
  const side = 2 * reach + 1;
  const nodes = new Float64Array(side * side * 3);
  for (let i = 0; i < side; i++) {
    for (let j = 0; j < side; j++) project(camera, x0 + i - reach, 0, z0 + j - reach, nodes, 3 * (i * side + j));
  }
  const bands = Array.from({ length: BANDS }, () => new Path2D());
  const segment = (a, b, x, z) => {
    const distance = Math.hypot(x - camera.target[0], z - camera.target[2]) / reach;
    const band = Math.floor(distance * BANDS);
    if (band >= BANDS || nodes[3 * a + 2] < 0.3 || nodes[3 * b + 2] < 0.3) return;
    bands[band].moveTo(nodes[3 * a], nodes[3 * a + 1]);
    bands[band].lineTo(nodes[3 * b], nodes[3 * b + 1]);
  };
  for (let i = 0; i < side; i++) {
    for (let j = 0; j < side; j++) {
      const here = i * side + j, x = x0 + i - reach, z = z0 + j - reach;
      if (j + 1 < side) segment(here, here + 1, x, z + 0.5);
      if (i + 1 < side) segment(here, here + side, x + 0.5, z);
    }
  }
  ctx.lineWidth = 1;
  bands.forEach((path, band) => {
    ctx.strokeStyle = css(theme.lineStrong, (theme.dark ? 0.5 : 0.42) * (1 - (band + 0.3) / BANDS));
    ctx.stroke(path);
  });
}

// Lets the floor fade out where words stand: over the lowest `height` pixels.
export function paintFade(ctx, camera, theme, height) {
  const top = camera.height - height;
  const fade = ctx.createLinearGradient(0, top, 0, top + 16);
  fade.addColorStop(0, css(theme.surface, 0));
  fade.addColorStop(1, css(theme.surface));
  ctx.fillStyle = fade;
  ctx.fillRect(0, top, camera.width, height);
}

// Runs `paint` with the canvas in metres on the floor round (x, z): right is along X, down along Z.
export function onFloor(ctx, camera, x, z, paint) {
  project(camera, x, 0, z, spot, 0);
  const [px, py, depth] = spot;
  if (depth < 0.3) return;
  project(camera, x + 0.05, 0, z, spot, 0);
  const ax = (spot[0] - px) / 0.05, ay = (spot[1] - py) / 0.05;
  project(camera, x, 0, z + 0.05, spot, 0);
  ctx.save();
  ctx.transform(ax, ay, (spot[0] - px) / 0.05, (spot[1] - py) / 0.05, px, py);
  paint();
  ctx.restore();
}

// pose: [J * 3]; dx, dz: where the figure's lane is.
export function paintShadow(ctx, camera, theme, pose, parents, dx, dz) {
  const x0 = pose[0], z0 = pose[2];
  onFloor(ctx, camera, x0 + dx, z0 + dz, () => {
    ctx.beginPath();
    for (let j = 1; j < parents.length; j++) {
      for (const [k, first] of [[parents[j], true], [j, false]]) {
        const height = pose[3 * k + 1];
        const x = pose[3 * k] - x0 + height * SHADOW[0], z = pose[3 * k + 2] - z0 + height * SHADOW[1];
        if (first) ctx.moveTo(x, z);
        else ctx.lineTo(x, z);
      }
    }
    ctx.lineCap = ctx.lineJoin = "round";
    ctx.strokeStyle = theme.dark ? "rgba(0,0,0,0.2)" : "rgba(30,34,44,0.07)";
    for (const wide of [0.21, 0.12]) {
      ctx.lineWidth = wide; // a wide faint stroke under a narrow one: a soft edge
      ctx.stroke();
    }
  });
}

// Spans in which a foot stands: [{start, stop, x, z, angle}], angle of ankle to ball on the floor.
export function findContacts(joints, frames, names, fps) {
  const width = 3 * names.length;
  return ["l_", "r_"].flatMap((side) => {
    const ball = 3 * names.indexOf(`${side}foot`), ankle = 3 * names.indexOf(`${side}ankle`);
    const between = (a, b) => Math.hypot(joints[a] - joints[b], joints[a + 2] - joints[b + 2]);
    let floor = Infinity;
    for (let t = 0; t < frames; t++) floor = Math.min(floor, joints[t * width + ball + 1]);
    const found = [];
    for (let t = 0; t < frames; t++) {
      const at = t * width, next = Math.min(t + 1, frames - 1) * width;
      const moved = between(next + ball, at + ball);
      if (joints[at + ball + 1] - floor > LOW || moved * fps > STILL) continue;
      const open = found.at(-1);
      if (open && open.stop === t) open.stop = t + 1;
      else {
        const ax = joints[at + ball] - joints[at + ankle], az = joints[at + ball + 2] - joints[at + ankle + 2];
        const angle = Math.atan2(az, ax);
        const x = joints[at + ball] - 0.05 * Math.cos(angle), z = joints[at + ball + 2] - 0.05 * Math.sin(angle);
        found.push({ start: t, stop: t + 1, x, z, angle });
      }
    }
    return found.filter((mark) => mark.stop - mark.start >= 2);
  });
}

// The marks under feet that stand now; with `all`, those of steps already taken too, fading with their age in seconds.
export function paintContacts(ctx, camera, rgb, contacts, frame, fps, dx, dz, all) {
  for (const mark of contacts) {
    if (mark.start > frame) continue;
    const age = Math.max(0, frame - mark.stop) / fps;
    if (age > 0 && !all) continue;
    const alpha = age > 0 ? Math.max(0.12, 0.36 - 0.12 * age) : 0.5;
    onFloor(ctx, camera, mark.x + dx, mark.z + dz, () => {
      ctx.rotate(mark.angle);
      ctx.beginPath();
      ctx.roundRect(-0.15, -0.06, 0.3, 0.12, 0.06);
      ctx.fillStyle = css(rgb, alpha);
      ctx.fill();
    });
  }
}

// The bones of a part of the body, and one joint of it, marked on top of the figure. marked: {joint, group}.
export function paintJoints(ctx, camera, theme, pose, parents, { joint, group }, dx, dz) {
  const at = (j) => {
    project(camera, pose[3 * j] + dx, pose[3 * j + 1], pose[3 * j + 2] + dz, spot, 0);
    return [spot[0], spot[1]];
  };
  const [x, y] = at(joint);
  ctx.lineCap = ctx.lineJoin = "round";
  for (const [color, wide, radius] of [[theme.surface, 6, 7], [theme.focus, 3, 5]]) {
    ctx.strokeStyle = ctx.fillStyle = css(color);
    ctx.lineWidth = wide;
    ctx.beginPath();
    for (const j of group) {
      if (parents[j] < 0 || !group.includes(parents[j])) continue;
      ctx.moveTo(...at(parents[j]));
      ctx.lineTo(...at(j));
    }
    ctx.stroke();
    ctx.beginPath();
    ctx.arc(x, y, radius, 0, 2 * Math.PI);
    ctx.fill();
  }
}

// A part [from, to] (frames) of the pelvis's way over the floor; width: numbers in a pose.
export function paintWay(ctx, camera, color, line, joints, width, [from, to], dx, dz) {
  const last = joints.length / width - 1;
  ctx.beginPath();
  for (let t = from; ; t = Math.min(Math.floor(t) + 1, to)) {
    const whole = Math.min(Math.floor(t), last), share = t - whole;
    const at = whole * width, next = Math.min(whole + 1, last) * width;
    const x = joints[at] + (joints[next] - joints[at]) * share;
    const z = joints[at + 2] + (joints[next + 2] - joints[at + 2]) * share;
    project(camera, x + dx, 0.004, z + dz, spot, 0);
    if (t === from) ctx.moveTo(spot[0], spot[1]);
    else ctx.lineTo(spot[0], spot[1]);
    if (t >= to) break;
  }
  ctx.strokeStyle = color;
  ctx.lineWidth = line;
  ctx.lineJoin = ctx.lineCap = "round";
  ctx.stroke();
}

// Paints one body: shapes as hulls of projected spheres, far to near, lit from the upper left, with a soft outline.

import { css, mix } from "./colour.js";

const TURN = 24; // directions in which a hull is sampled
const COS = Float64Array.from({ length: TURN }, (_, k) => Math.cos((2 * Math.PI * k) / TURN));
const SIN = Float64Array.from({ length: TURN }, (_, k) => Math.sin((2 * Math.PI * k) / TURN));
const WHITE = [255, 255, 255], BLACK = [10, 12, 16];
const LIGHT = [0.62, 0.78]; // from the upper left, in the picture
const OUTLINE = 2.4; // CSS pixels, half of it hidden under the fill
const HALO = 8; // likewise

// Shades of one figure: left limbs lighter, right limbs darker, the trunk between; each as [lit, base, shade].
export function tonesOf(rgb, theme) {
  const ramp = (base) => [mix(base, WHITE, 0.24), base, mix(base, BLACK, 0.24)].map((shade) => css(shade));
  return {
    L: ramp(mix(rgb, WHITE, theme.dark ? 0.3 : 0.36)),
    M: ramp(mix(rgb, WHITE, 0.1)),
    H: ramp(mix(rgb, WHITE, 0.18)),
    V: ramp(mix(rgb, BLACK, 0.36)),
    R: ramp(mix(rgb, BLACK, theme.dark ? 0.3 : 0.24)),
    outline: css(mix(rgb, BLACK, 0.62)),
    inner: css(mix(rgb, BLACK, 0.66), 0.5),
  };
}

export class Painter {
  constructor(body) {
    this.radii = body.radii;
    this.shapes = body.shapes.map((shape) => ({
      ...shape,
      depth: 0,
      parts: shape.parts.map((part) => ({ ...part, points: new Float64Array(2 * TURN), owner: new Uint8Array(TURN) })),
    }));
    this.order = [...this.shapes];
    this.circles = new Float64Array(3 * 8);
  }

  // screen: [spheres * 3] x, y, depth; focal: pixels per unit of x / depth.
  measure(screen, focal) {
    for (const shape of this.shapes) {
      let depth = 0, count = 0;
      for (const part of shape.parts) {
        const n = part.spheres.length;
        for (let j = 0; j < n; j++) {
          const at = 3 * part.spheres[j];
          depth += screen[at + 2];
          this.circles[3 * j] = screen[at];
          this.circles[3 * j + 1] = screen[at + 1];
          this.circles[3 * j + 2] = (this.radii[part.spheres[j]] * focal) / screen[at + 2];
        }
        count += n;
        hull(this.circles, n, part.points, part.owner);
      }
      shape.depth = depth / count + shape.behind;
    }
    this.order.sort((a, b) => b.depth - a.depth);
  }

  // halo: colour of a broad line round the body, or null; plain: one shade a shape and no rims, where time is short.
  paint(ctx, screen, focal, tones, { halo = null, plain = false } = {}) {
    this.measure(screen, focal);
    ctx.lineJoin = "bevel"; // hulls turn so little at each corner that it does not show
    ctx.lineCap = "butt";
    if (halo) this.silhouette(ctx, halo, HALO);
    this.silhouette(ctx, tones.outline);
    ctx.strokeStyle = tones.inner;
    ctx.lineWidth = 1.5;
    for (const shape of this.order) {
      if (!plain) {
        ctx.beginPath();
        for (const part of shape.parts) traceRim(ctx, part);
        ctx.stroke();
      }
      ctx.beginPath();
      for (const part of shape.parts) trace(ctx, part.points);
      ctx.fillStyle = plain ? tones[shape.tone][1] : light(ctx, shape.parts, tones[shape.tone]);
      ctx.fill();
    }
  }

  paintFlat(ctx, screen, focal, fill, line) {
    this.measure(screen, focal);
    ctx.lineJoin = "bevel";
    this.silhouette(ctx, line);
    ctx.fillStyle = fill;
    ctx.fill();
  }

  // The path of the whole body, stroked in the outline's colour.
  silhouette(ctx, color, wide = OUTLINE) {
    ctx.beginPath();
    for (const shape of this.shapes) for (const part of shape.parts) trace(ctx, part.points);
    ctx.strokeStyle = color;
    ctx.lineWidth = wide;
    ctx.stroke();
  }
}

function trace(ctx, points) {
  ctx.moveTo(points[0], points[1]);
  for (let k = 1; k < TURN; k++) ctx.lineTo(points[2 * k], points[2 * k + 1]);
  ctx.closePath();
}

// The rim of a part, except where the next shape of the limb goes on.
function traceRim(ctx, { points, owner, open }) {
  let down = false; // whether the pen is on the paper
  for (let k = 0; k < TURN; k++) {
    const next = (k + 1) % TURN;
    if (open[owner[k]] && owner[k] === owner[next]) {
      down = false;
      continue;
    }
    if (!down) ctx.moveTo(points[2 * k], points[2 * k + 1]);
    ctx.lineTo(points[2 * next], points[2 * next + 1]);
    down = true;
  }
}

// Outline of the hull of n circles (x, y, r): the farthest point in each direction, and which circle it lies on.
function hull(circles, n, points, owner) {
  for (let k = 0; k < TURN; k++) {
    const dx = COS[k], dy = SIN[k];
    let best = -Infinity, which = 0;
    for (let j = 0; j < n; j++) {
      const reach = circles[3 * j] * dx + circles[3 * j + 1] * dy + circles[3 * j + 2];
      if (reach > best) {
        best = reach;
        which = j;
      }
    }
    points[2 * k] = circles[3 * which] + circles[3 * which + 2] * dx;
    points[2 * k + 1] = circles[3 * which + 1] + circles[3 * which + 2] * dy;
    owner[k] = which;
  }
}

// A gradient across a shape, square to its long axis where it has one, its lit side towards the light.
function light(ctx, parts, [lit, base, shade]) {
  const n = parts.length * TURN;
  let x = 0, y = 0, xx = 0, xy = 0, yy = 0;
  for (const { points } of parts) {
    for (let k = 0; k < 2 * TURN; k += 2) {
      x += points[k] / n;
      y += points[k + 1] / n;
    }
  }
  for (const { points } of parts) {
    for (let k = 0; k < 2 * TURN; k += 2) {
      const dx = points[k] - x, dy = points[k + 1] - y;
      xx += dx * dx;
      xy += dx * dy;
      yy += dy * dy;
    }
  }
  const across = 0.5 * Math.atan2(2 * xy, xx - yy) + Math.PI / 2;
  const thin = Math.hypot(xx - yy, 2 * xy) / (xx + yy || 1); // 0 round, 1 thin
  const sign = Math.cos(across) * LIGHT[0] + Math.sin(across) * LIGHT[1] < 0 ? -1 : 1;
  const ax = sign * Math.cos(across) * thin + LIGHT[0] * (1 - thin);
  const ay = sign * Math.sin(across) * thin + LIGHT[1] * (1 - thin);
  const norm = Math.hypot(ax, ay) || 1;
  let reach = 0;
  for (const { points } of parts) {
    for (let k = 0; k < 2 * TURN; k += 2) {
      reach = Math.max(reach, Math.abs((points[k] - x) * ax + (points[k + 1] - y) * ay) / norm);
    }
  }
  const gx = (ax / norm) * reach, gy = (ay / norm) * reach;
  const gradient = ctx.createLinearGradient(x - gx, y - gy, x + gx, y + gy);
  gradient.addColorStop(0, lit);
  gradient.addColorStop(0.5, base);
  gradient.addColorStop(1, shade);
  return gradient;
}

// Paints one body: parts as hulls of projected spheres, far to near, lit from the upper left, with a soft outline.

import { css, mix } from "./colour.js";

const TURN = 30; // directions in which a hull is sampled
const COS = Float64Array.from({ length: TURN }, (_, k) => Math.cos((2 * Math.PI * k) / TURN));
const SIN = Float64Array.from({ length: TURN }, (_, k) => Math.sin((2 * Math.PI * k) / TURN));
const WHITE = [255, 255, 255], BLACK = [10, 12, 16];

// Shades of one figure: left limbs lighter, right limbs darker, the trunk between; each as [lit, base, shade].
export function tonesOf(rgb, theme) {
  const ramp = (base) => [mix(base, WHITE, 0.24), base, mix(base, BLACK, 0.24)];
  return {
    L: ramp(mix(rgb, WHITE, theme.dark ? 0.3 : 0.36)),
    M: ramp(mix(rgb, WHITE, 0.1)),
    H: ramp(mix(rgb, WHITE, 0.18)),
    R: ramp(mix(rgb, BLACK, theme.dark ? 0.3 : 0.24)),
    outline: css(mix(rgb, BLACK, 0.62)),
    inner: css(mix(rgb, BLACK, 0.66), 0.55),
  };
}

export function createPainter(body) {
  const count = body.parts.length;
  const hulls = body.parts.map(() => new Float64Array(TURN * 2));
  const owners = body.parts.map(() => new Uint8Array(TURN));
  const depths = new Float64Array(count);
  const order = body.parts.map((_, index) => index);
  const circle = new Float64Array(3 * 8);

  // screen: [size * 3] x, y, depth of the spheres; focal: pixels per unit of x / depth.
  function measure(screen, focal) {
    body.parts.forEach((part, index) => {
      const n = part.spheres.length;
      let depth = 0;
      for (let j = 0; j < n; j++) {
        const at = 3 * part.spheres[j];
        depth += screen[at + 2];
        circle[3 * j] = screen[at];
        circle[3 * j + 1] = screen[at + 1];
        circle[3 * j + 2] = (body.radii[part.spheres[j]] * focal) / screen[at + 2];
      }
      depths[index] = depth / n;
      hull(circle, n, hulls[index], owners[index]);
    });
    order.sort((a, b) => depths[b] - depths[a]);
  }

  function trace(ctx, points) {
    ctx.moveTo(points[0], points[1]);
    for (let k = 1; k < TURN; k++) ctx.lineTo(points[2 * k], points[2 * k + 1]);
    ctx.closePath();
  }

  function silhouette(ctx) {
    ctx.beginPath();
    for (const points of hulls) trace(ctx, points);
  }

  // Strokes the rim of a part except where the next part of the limb goes on.
  function rim(ctx, index) {
    const points = hulls[index], owner = owners[index], open = body.parts[index].open;
    ctx.beginPath();
    for (let k = 0; k < TURN; k++) {
      const next = (k + 1) % TURN;
      if (open[owner[k]] && owner[k] === owner[next]) continue;
      ctx.moveTo(points[2 * k], points[2 * k + 1]);
      ctx.lineTo(points[2 * next], points[2 * next + 1]);
    }
    ctx.stroke();
  }

  return {
    paint(ctx, screen, focal, tones, alpha = 1) {
      measure(screen, focal);
      ctx.globalAlpha = alpha;
      ctx.lineJoin = ctx.lineCap = "round";
      silhouette(ctx);
      ctx.strokeStyle = tones.outline;
      ctx.lineWidth = 2.4;
      ctx.stroke();
      ctx.strokeStyle = tones.inner;
      ctx.lineWidth = 1.5;
      for (const index of order) {
        rim(ctx, index);
        ctx.beginPath();
        trace(ctx, hulls[index]);
        ctx.fillStyle = light(ctx, hulls[index], tones[body.parts[index].tone]);
        ctx.fill();
      }
      ctx.globalAlpha = 1;
    },
    paintFlat(ctx, screen, focal, fill, line) {
      measure(screen, focal);
      ctx.lineJoin = "round";
      silhouette(ctx);
      ctx.strokeStyle = line;
      ctx.lineWidth = 2.4;
      ctx.stroke();
      ctx.fillStyle = fill;
      ctx.fill();
    },
  };
}

// Outline of the hull of n circles (x, y, r): the farthest point in each direction, and which circle it lies on.
function hull(circle, n, points, owner) {
  for (let k = 0; k < TURN; k++) {
    const dx = COS[k], dy = SIN[k];
    let best = -Infinity, which = 0;
    for (let j = 0; j < n; j++) {
      const reach = circle[3 * j] * dx + circle[3 * j + 1] * dy + circle[3 * j + 2];
      if (reach > best) {
        best = reach;
        which = j;
      }
    }
    points[2 * k] = circle[3 * which] + circle[3 * which + 2] * dx;
    points[2 * k + 1] = circle[3 * which + 1] + circle[3 * which + 2] * dy;
    owner[k] = which;
  }
}

// A gradient across the part, square to its long axis where it has one, lit side towards the upper left.
function light(ctx, points, [lit, base, shade]) {
  let x = 0, y = 0;
  for (let k = 0; k < TURN; k++) {
    x += points[2 * k];
    y += points[2 * k + 1];
  }
  x /= TURN;
  y /= TURN;
  let xx = 0, xy = 0, yy = 0;
  for (let k = 0; k < TURN; k++) {
    const dx = points[2 * k] - x, dy = points[2 * k + 1] - y;
    xx += dx * dx;
    xy += dx * dy;
    yy += dy * dy;
  }
  const angle = 0.5 * Math.atan2(2 * xy, xx - yy) + Math.PI / 2; // the short axis
  const long = Math.hypot(xx - yy, 2 * xy) / (xx + yy); // 0 round, 1 thin
  let ax = Math.cos(angle), ay = Math.sin(angle);
  if (ax * 0.62 + ay * 0.78 < 0) [ax, ay] = [-ax, -ay];
  ax = ax * long + 0.62 * (1 - long);
  ay = ay * long + 0.78 * (1 - long);
  const norm = Math.hypot(ax, ay) || 1;
  let reach = 0;
  for (let k = 0; k < TURN; k++) {
    reach = Math.max(reach, Math.abs((points[2 * k] - x) * ax + (points[2 * k + 1] - y) * ay) / norm);
  }
  const gx = (ax / norm) * reach, gy = (ay / norm) * reach;
  const gradient = ctx.createLinearGradient(x - gx, y - gy, x + gx, y + gy);
  gradient.addColorStop(0, css(lit));
  gradient.addColorStop(0.5, css(base));
  gradient.addColorStop(1, css(shade));
  return gradient;
}

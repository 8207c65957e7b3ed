// Heat maps on the score's time axis: rows by frames, one colour ramp from the ground up, named at the left.

import { css, mix } from "./colour.js";
import { told } from "./rows.js";

// From next to nothing to the most: lightness falls all the way on a light page and rises on a dark one, so that the
// order is seen without hues; the hues go from violet to yellow, which every kind of colour vision tells apart.
const LIGHT = [[247, 242, 235], [250, 209, 140], [240, 141, 72], [196, 66, 92], [118, 23, 102], [40, 8, 66]];
const DARK = [[36, 36, 44], [74, 28, 96], [142, 42, 100], [208, 76, 72], [245, 152, 68], [253, 232, 160]];
const LETTER = 6.3; // pixels of a letter of a row's name, about

// Colour [r, g, b] of a share 0..1 of the largest value.
export function rampAt(share, theme) {
  const stops = theme.dark ? DARK : LIGHT, at = Math.min(1, Math.max(0, share)) * (stops.length - 1);
  const low = Math.min(Math.floor(at), stops.length - 2);
  return mix(stops[low], stops[low + 1], at - low);
}

export function rampCss(theme) {
  const stops = theme.dark ? DARK : LIGHT;
  return `linear-gradient(to right, ${stops.map((rgb) => css(rgb)).join(", ")})`;
}

// Pixels left of the roll that the rows' names need.
export function namesWidth(strips, wide) {
  const names = strips.flatMap((strip) => (strip.groups?.length ? strip.groups.map(([name]) => name) : strip.rows));
  const longest = Math.max(0, ...names.map((name) => name.length));
  return longest ? Math.min(Math.ceil(longest * LETTER) + 16, wide < 640 ? 76 : 112) : 0;
}

// One pixel a value, to be stretched: made once a theme.
export function heatMap(strip, theme) {
  const { rows, frames, values, max } = strip;
  const canvas = document.createElement("canvas");
  canvas.width = frames;
  canvas.height = rows.length;
  const ctx = canvas.getContext("2d"), image = ctx.createImageData(frames, rows.length);
  for (let i = 0; i < values.length; i++) {
    const rgb = rampAt(values[i] / max, theme);
    for (let c = 0; c < 3; c++) image.data[4 * i + c] = rgb[c];
    image.data[4 * i + 3] = 255;
  }
  ctx.putImageData(image, 0, 0);
  return canvas;
}

// place: {y, step, count} of the score's layout; width and frames: of the whole roll.
export function paintStrip(ctx, strip, map, place, frames, width, theme) {
  const wide = (strip.frames / frames) * width, tall = place.step * place.count;
  ctx.imageSmoothingEnabled = false;
  ctx.drawImage(map, 0, place.y, wide, tall);
  ctx.fillStyle = css(theme.surface);
  for (const row of breaks(strip)) ctx.fillRect(0, place.y + row * place.step - 1, wide, 2);
  ctx.strokeStyle = css(theme.line);
  ctx.lineWidth = 1;
  ctx.strokeRect(0.5, place.y - 0.5, wide - 1, tall + 1);
}

// Names of the rows, or of their groups, right-aligned at x.
export function paintNames(ctx, strip, place, x, theme, lit) {
  const groups = strip.groups?.length ? strip.groups : strip.rows.map((name) => [name, 1]);
  ctx.textAlign = "right";
  ctx.textBaseline = "middle";
  let row = 0;
  for (const [name, count] of groups) {
    const here = lit !== null && lit >= row && lit < row + count;
    ctx.font = `${here ? "700 " : ""}11px ${theme.font}`;
    ctx.fillStyle = css(here ? theme.text : theme.muted);
    ctx.fillText(shortened(ctx, name, x - 4), x, place.y + (row + count / 2) * place.step + 0.5);
    row += count;
  }
}

// {joints of the row, joints of its group}, or null where rows are no joints.
export function jointsOf(strip, row) {
  if (!strip.joints?.length) return null;
  let first = row, last = row + 1, at = 0;
  for (const [, count] of strip.groups || []) {
    if (row >= at && row < at + count) [first, last] = [at, at + count];
    at += count;
  }
  return { joint: strip.joints[row], group: strip.joints.slice(first, last) };
}

// One sentence with the largest value, for those who do not see the picture.
export function tellStrip(strip, fps) {
  const most = strip.values.reduce((best, value, i) => (value > strip.values[best] ? i : best), 0);
  const row = strip.rows[Math.floor(most / strip.frames)], second = ((most % strip.frames) / fps).toFixed(2);
  const largest = `${told(strip.values[most])} ${strip.unit}`.trim();
  return `${strip.name}: ${strip.rows.length} rows, the largest ${largest} at ${row}, ${second} s`;
}

function breaks(strip) {
  let row = 0;
  const ends = (strip.groups || []).map(([, count]) => (row += count));
  return ends.slice(0, -1);
}

function shortened(ctx, text, room) {
  if (ctx.measureText(text).width <= room) return text;
  let kept = text;
  while (kept.length > 1 && ctx.measureText(`${kept}…`).width > room) kept = kept.slice(0, -1);
  return `${kept}…`;
}

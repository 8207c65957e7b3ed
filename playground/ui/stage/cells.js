// Paints one row of tokens: cells in their codes' colours, ids where they fit, marks, and what is still to come.

import { css, mix, textOn } from "./colour.js";
import { cellEdges, doubtOf } from "./rows.js";

const DIGIT = 6.2; // pixels of one digit of an id
const PALEST = 0.85; // share of the ground in a cell as unsure as can be

// row: {level, y, height} of `track`; frames and width: of the whole roll; alpha: how much of the row is to be seen.
export function paintRow(ctx, track, row, frames, width, theme, alpha) {
  const level = track.levels[row.level];
  const digits = String(level.codes - 1).length, cell = width * (track.frames / frames / level.size);
  const written = cell > DIGIT * digits + 5; // all ids of a row, or none
  ctx.globalAlpha = alpha;
  for (let position = 0; position < level.size; position++) {
    const [from, to] = cellEdges(track, row.level, position, frames, width);
    const wide = to - from - (to - from > 5 ? 1 : to - from > 2 ? 0.5 : 0);
    const box = [from, row.y + 0.5, wide, row.height - 1];
    if (!level.ids) {
      paintPending(ctx, box, theme);
      continue;
    }
    const rgb = cellColour(level, position, theme), marked = Boolean(level.marks?.[position]);
    ctx.fillStyle = css(rgb);
    fillCell(ctx, box);
    ctx.fillStyle = css(textOn(rgb));
    if (written) ctx.fillText(String(level.ids[position]), from + wide / 2, row.y + row.height / 2 + 0.5);
    if (marked) paintMark(ctx, box);
  }
  ctx.globalAlpha = 1;
}

// The code's colour, paler the less sure the generator was.
function cellColour(level, position, theme) {
  const rgb = [0, 1, 2].map((i) => level.rgb[3 * position + i]);
  return level.entropy ? mix(rgb, theme.surface, PALEST * doubtOf(level, position)) : rgb;
}

// A mark is a shape and no colour: a folded corner and a line under the cell; a bar where the cell is narrow.
function paintMark(ctx, [x, y, w, h]) {
  ctx.fillRect(x, y + h - 2, w, 2);
  if (w < 7) return;
  const side = Math.min(7, h - 4, w);
  ctx.beginPath();
  ctx.moveTo(x + w - side, y);
  ctx.lineTo(x + w, y);
  ctx.lineTo(x + w, y + side);
  ctx.fill();
}

function paintPending(ctx, [x, y, w, h], theme) {
  ctx.strokeStyle = css(theme.line);
  ctx.lineWidth = 1;
  ctx.strokeRect(x + 0.5, y + 0.5, Math.max(0, w - 1), h - 1);
}

// Wide cells have soft corners.
function fillCell(ctx, [x, y, w, h]) {
  if (w < 8) return ctx.fillRect(x, y, w, h);
  ctx.beginPath();
  ctx.roundRect(x, y, w, h, 2);
  ctx.fill();
}

// Slanted lines over a stretch: frames that stay as they were. colors: of lines side by side, so that they show on
// light and on dark cells.
export function paintHatch(ctx, x, y, w, h, colors, gap = 7) {
  ctx.save();
  ctx.beginPath();
  ctx.rect(x, y, w, h);
  ctx.clip();
  ctx.lineWidth = 1;
  colors.forEach((color, beside) => {
    ctx.beginPath();
    for (let at = x - h - gap - ((x + y) % gap) + 1.4 * beside; at < x + w; at += gap) {
      ctx.moveTo(at, y + h);
      ctx.lineTo(at + h, y);
    }
    ctx.strokeStyle = color;
    ctx.stroke();
  });
  ctx.restore();
}

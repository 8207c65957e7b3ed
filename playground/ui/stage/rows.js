// Where everything of the score lies: rows, cells, and what is under a point. No drawing.

import { shareOf } from "./store.js";

const HEADER = 26; // pixels over a track or a strip, for its name
const GAP = 10; // pixels under it
const FEW = 16; // rows up to which a strip's rows are tall enough to be named comfortably

// rows: [{track, level, y, height}], heads: [{track, y}], strips: [{strip, y, step, count}], stripHeads: [{strip, y}],
// height of all. Rows get lower where there are many.
export function layRows(tracks, strips = []) {
  const height = tracks.length <= 1 ? 16 : tracks.length === 2 ? 14 : 12;
  const laid = { rows: [], heads: [], strips: [], stripHeads: [], height: 0 };
  let y = 0;
  tracks.forEach((track, index) => {
    laid.heads.push({ track: index, y });
    y += HEADER;
    track.levels.forEach((_, level) => {
      laid.rows.push({ track: index, level, y, height });
      y += height;
    });
    y += GAP;
  });
  strips.forEach((strip, index) => {
    const count = strip.rows.length, step = strip.groups?.length ? 7 : count <= FEW ? 15 : 12;
    laid.stripHeads.push({ strip: index, y });
    laid.strips.push({ strip: index, y: y + HEADER, step, count });
    y += HEADER + step * count + GAP;
  });
  laid.height = Math.max(0, y - GAP + 4);
  return laid;
}

// Left and right edge of a cell in pixels of a roll that is `width` wide and `frames` long; whole pixels.
export function cellEdges(track, level, position, frames, width) {
  const [from, to] = shareOf(track, level, position);
  return [Math.round((from / frames) * width), Math.round((to / frames) * width)];
}

// {track, level, position} under a point of the roll, or null.
export function cellAt(tracks, rows, x, y, frames, width) {
  const row = rows.find((candidate) => y >= candidate.y && y < candidate.y + candidate.height);
  if (!row || width <= 0) return null;
  const track = tracks[row.track], size = track.levels[row.level].size;
  const position = Math.floor(((x / width) * frames * size) / track.frames);
  return position >= 0 && position < size ? { track: row.track, level: row.level, position } : null;
}

// {strip, row, frame} under a point of the roll, or null.
export function probeAt(strips, laid, x, y, frames, width) {
  const place = laid.find((candidate) => y >= candidate.y && y < candidate.y + candidate.step * candidate.count);
  if (!place || width <= 0) return null;
  const frame = Math.floor((x / width) * frames);
  const inside = frame >= 0 && frame < strips[place.strip].frames;
  return inside ? { strip: place.strip, row: Math.floor((y - place.y) / place.step), frame } : null;
}

// Whether the decode shown used a level, given the chosen scale and how it was chosen.
export function isUsed(level, scale, mode) {
  if (!scale) return true;
  if (mode === "upto") return level < scale;
  return mode === "without" ? level + 1 !== scale : level + 1 === scale;
}

// 0 sure, 1 as unsure as can be.
export function doubtOf(level, position) {
  return Math.min(1, Math.max(0, level.entropy[position]) / Math.log(Math.max(2, level.codes)));
}

// A few words about a cell, in pairs, for the hover card and for screen readers.
export function describeCell(tracks, { track: index, level, position }, fps) {
  const track = tracks[index], row = track.levels[level], span = row.spans;
  const id = row.ids ? row.ids[position] : null;
  const lines = [
    [`${track.name}, scale ${level + 1}`, `token ${position + 1} of ${row.size}`],
    [id === null ? "still to come" : `code ${id} of ${row.codes}`, between(shareOf(track, level, position), track, fps)],
  ];
  if (span) lines.push(["governs, as measured", between(span.subarray(2 * position, 2 * position + 2), track, fps)]);
  if (row.entropy) {
    const percent = `${Math.round(100 * doubtOf(row, position))} % of the most possible`;
    lines.push([`entropy ${row.entropy[position].toPrecision(2)} nats`, percent]);
  }
  if (row.marks?.[position]) lines.push(["marked", track.marked || "changed"]);
  return lines;
}

// The same about a value of a heat map.
export function describeProbe(strips, { strip: index, row, frame }, fps) {
  const strip = strips[index], value = strip.values[row * strip.frames + frame];
  return [
    [strip.rows[row], `${told(value)} ${strip.unit}`.trim()],
    [strip.name, `${(frame / fps).toFixed(2)} s`],
  ];
}

// Three figures, and no more digits than a small number can bear.
export function told(value) {
  return String(Number(value.toPrecision(3)));
}

function between(frames, { origin = 0 }, fps) {
  return `${Array.from(frames, (frame) => ((frame + origin) / fps).toFixed(2)).join("–")} s`;
}

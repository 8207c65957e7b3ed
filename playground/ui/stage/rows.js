// Where everything of the score lies: rows, cells, and what is under a point. No drawing.

import { shareOf } from "./store.js";

const HEADER = 26; // pixels over a track, for its name
const GAP = 10; // pixels under it

// rows: [{track, level, y, height}], heads: [{track, y}], height of all. Rows get lower where there are many tracks.
export function layRows(tracks) {
  const height = tracks.length <= 1 ? 16 : tracks.length === 2 ? 14 : 12;
  const rows = [], heads = [];
  let y = 0;
  tracks.forEach((track, index) => {
    heads.push({ track: index, y });
    y += HEADER;
    track.levels.forEach((_, level) => {
      rows.push({ track: index, level, y, height });
      y += height;
    });
    y += GAP;
  });
  return { rows, heads, height: Math.max(0, y - GAP + 4) };
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

// Whether the decode shown used a level, given the chosen scale and how it was chosen.
export function isUsed(level, scale, mode) {
  if (!scale) return true;
  if (mode === "upto") return level < scale;
  return mode === "without" ? level + 1 !== scale : level + 1 === scale;
}

// One sentence or two about a cell, for the hover card and for screen readers.
export function describeCell(tracks, { track: index, level, position }, fps) {
  const track = tracks[index], row = track.levels[level];
  const [from, to] = shareOf(track, level, position);
  const id = row.ids ? row.ids[position] : null;
  const when = `${(from / fps).toFixed(2)}–${(to / fps).toFixed(2)} s`;
  const lines = [
    [`${track.name}, scale ${level + 1}`, `token ${position + 1} of ${row.size}`],
    [id === null ? "still to come" : `code ${id} of ${row.codes}`, when],
  ];
  if (row.entropy) {
    const share = row.entropy[position] / Math.log(Math.max(2, row.codes));
    const percent = `${Math.round(100 * share)} % of the most possible`;
    lines.push([`entropy ${row.entropy[position].toPrecision(2)} nats`, percent]);
  }
  return lines;
}

// A motion without end: pieces that follow each other become one window of bounded length, on a clock that runs on.

import { locate } from "./store.js";

const PATIENCE = 10_000; // milliseconds until more is asked for once again

// A piece behind what is there: {data, dropped}. dropped: frames that left the window at its start, null where the piece
// does not follow what is there and so begins anew.
export function joined(old, piece) {
  const before = old?.growing, { first, window } = piece.growing;
  if (!before || old.scene !== piece.scene || before.first + before.made !== first) return { data: piece, dropped: null };
  const pieces = [...before.pieces, ...piece.growing.pieces];
  let dropped = 0, made = before.made + piece.growing.made;
  for (; made > window && pieces.length > 1; made -= pieces[0], dropped += pieces.shift());
  const origin = before.first + dropped;
  const figures = piece.figures.map((figure, i) => {
    const skipped = (old.figures[i].joints.length / old.figures[i].frames) * dropped;
    return { ...figure, frames: made, joints: rest(old.figures[i].joints, skipped, figure.joints) };
  });
  const tracks = piece.tracks.map((track, i) => joinedTrack(old.tracks[i], track, dropped, made, origin));
  const growing = { ...piece.growing, first: origin, made, pieces };
  return { data: { ...piece, figures, tracks, growing, origin }, dropped };
}

function joinedTrack(old, track, dropped, frames, origin) {
  const levels = track.levels.map((level, n) => {
    const before = old.levels[n], gone = cellsOf(old, before, dropped);
    const own = { ...level, size: before.size - gone + level.size };
    for (const [key, wide] of [["ids", 1], ["rgb", 3], ["entropy", 1], ["marks", 1]]) {
      own[key] = before[key] && level[key] && rest(before[key], wide * gone, level[key]);
    }
    return own;
  });
  return { ...track, frames, origin, levels };
}

function cellsOf(track, level, frames) {
  return Math.round((level.size * frames) / track.frames);
}

// The end of one typed array and all of another.
function rest(old, skipped, added) {
  const out = new old.constructor(old.length - skipped + added.length);
  out.set(old.subarray(skipped));
  out.set(added, old.length - skipped);
  return out;
}

// What clock and choices become once frames have left at the start; old: the tracks before.
export function shifted(state, old, dropped) {
  const { frame, span, selection } = state, cell = locate(old, selection);
  const position = cell ? cell.position - cellsOf(old[cell.track], old[cell.track].levels[cell.level], dropped) : -1;
  return {
    frame: Math.max(0, frame - dropped),
    span: span && span[1] > dropped ? [Math.max(0, span[0] - dropped), span[1] - dropped] : null,
    selection: position >= 0 ? { ...selection, position } : null,
  };
}

// Asks for more when little is left ahead of the playhead, and once again when nothing comes.
export class Hunger {
  constructor() {
    this.fed();
  }

  fed() {
    this.asked = -Infinity;
  }

  // growing: of the data, or null; now: milliseconds. The frame from which more is wanted, or null.
  watch(state, growing, now) {
    if (!growing || growing.made - state.frame > growing.ahead * state.speed) return null;
    if (now - this.asked < PATIENCE) return null;
    this.asked = now;
    return growing.first + growing.made;
  }
}

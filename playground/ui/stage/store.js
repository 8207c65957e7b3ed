// One clock, one selection. Every view reads `state` and listens; nobody keeps a second copy.

const DEFAULTS = {
  frame: 0, // position on the time axis in frames, fractional while playing; 0 <= frame < frames
  frames: 1,
  until: null, // frames that are there already where more are to come, else null
  origin: 0, // what the clock says at frame 0, in frames
  fps: 20,
  playing: false,
  speed: 1,
  loop: true,
  follow: true,
  trail: false,
  ghost: false,
  layout: "lanes", // or "overlay"
  scale: null, // 1-based scale that is looked at, or null
  scaleMode: "focus", // "focus" | "upto" | "only" | "without": which rows the decode used, relative to `scale`
  selection: null, // {system, scale, position}: scale 1-based, position 0-based
  span: null, // [start, stop] in frames, stop not included
  hover: null, // {track, level, position} under the pointer or the keyboard's cursor
  probe: null, // {strip, row, frame} likewise, of a heat map
  peek: null, // frame under the pointer on the time axis
  guidance: 0,
};

// Events that Python may hear of: they fire on commit only.
export const COMMITS = ["select", "span", "scale"];

export function createStore() {
  const state = { ...DEFAULTS };
  const listeners = new Map();

  function on(event, listener) {
    if (!listeners.has(event)) listeners.set(event, new Set());
    listeners.get(event).add(listener);
    return () => listeners.get(event).delete(listener);
  }

  function emit(event, detail) {
    for (const listener of listeners.get(event) || []) listener(detail);
  }

  // Changes some values and tells listeners of "change" which ones really changed.
  function set(patch) {
    const changed = Object.keys(patch).filter((key) => !same(state[key], patch[key]));
    if (!changed.length) return;
    for (const key of changed) state[key] = patch[key];
    emit("change", new Set(changed));
  }

  function seek(frame) {
    set({ frame: Math.min(Math.max(frame, 0), Math.max((state.until ?? state.frames) - 1, 0)) });
  }

  // Moves the clock by real seconds; at the end it wraps round, or stops when loop is off. A span is played by itself.
  // Where more is to come it waits at the end.
  function advance(seconds) {
    if (state.until !== null) return seek(state.frame + seconds * state.fps * state.speed);
    const [start, stop] = state.span && state.loop ? state.span : [0, state.frames];
    let frame = state.frame + seconds * state.fps * state.speed;
    if (frame >= stop || frame < start) {
      if (!state.loop && frame >= stop) {
        set({ frame: Math.max(stop - 1, 0), playing: false });
        return;
      }
      const length = Math.max(stop - start, 1);
      frame = start + ((((frame - start) % length) + length) % length);
    }
    set({ frame });
  }

  // A choice that is final: every view shows it, and Python hears of it.
  function commit(event, patch) {
    set(patch);
    if (event === "select") emit(event, state.selection);
    if (event === "span") emit(event, state.span && { start: state.span[0], stop: state.span[1] });
    if (event === "scale") emit(event, { scale: state.scale });
  }

  return { state, on, emit, set, seek, advance, commit };
}

function same(a, b) {
  if (a === b) return true;
  if (!a || !b || typeof a !== "object" || typeof b !== "object") return false;
  const keys = Object.keys(a);
  return keys.length === Object.keys(b).length && keys.every((key) => a[key] === b[key]);
}

// First and last+1 frame of a token, as its share of the track's time.
export function shareOf(track, level, position) {
  const step = track.frames / track.levels[level].size;
  return [position * step, (position + 1) * step];
}

// Frames that a token governs: measured where the microscope has measured it, else its share of time.
export function spanOf(track, level, position) {
  const spans = track.levels[level].spans;
  return spans ? [spans[2 * position], spans[2 * position + 1]] : shareOf(track, level, position);
}

// Positions [first, last + 1] of a level whose tokens govern some of the frames [from, to], or null.
export function governing(track, level, [from, to]) {
  let first = -1, last = -1;
  for (let position = 0; position < track.levels[level].size; position++) {
    const [start, stop] = spanOf(track, level, position);
    if (start >= to - 1e-6 || stop <= from + 1e-6) continue;
    if (first < 0) first = position;
    last = position;
  }
  return first < 0 ? null : [first, last + 1];
}

// The token that lights up: the one pointed at, else the chosen one; with the frames that it governs.
export function litToken(tracks, state) {
  const cell = state.hover || locate(tracks, state.selection);
  return cell && { cell, span: spanOf(tracks[cell.track], cell.level, cell.position), chosen: !state.hover };
}

// {system, scale, position} -> {track, level, position}, or null where these tracks have no such token.
export function locate(tracks, selection) {
  if (!selection) return null;
  const track = tracks.findIndex((candidate) => candidate.system === selection.system);
  const level = selection.scale - 1, row = track >= 0 ? tracks[track].levels[level] : null;
  const there = row && selection.position >= 0 && selection.position < row.size;
  return there ? { track, level, position: selection.position } : null;
}

// Position of the token under a frame, or -1 past the track's end.
export function tokenAt(track, level, frame) {
  if (frame >= track.frames) return -1;
  const size = track.levels[level].size;
  return Math.min(size - 1, Math.floor((Math.max(frame, 0) * size) / track.frames));
}

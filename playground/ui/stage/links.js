// What a link to a stage must hold, and how a stage is put back into that state. Nothing here speaks to Python.

const REST = 250; // milliseconds without a change after which the state is told

// The state as plain JSON: whole frames, null for what is not chosen.
export function readState(state) {
  const { frame, scale, scaleMode, selection, span, speed } = state;
  return {
    frame: Math.round(frame), scale, mode: scaleMode, selection: selection && { ...selection }, span: span && [...span],
    speed,
  };
}

// The part of a wish that makes sense for this result; unknown and impossible values fall away.
export function fitting(wish, data) {
  const patch = {}, whole = (value) => Number.isInteger(Number(value)) && value !== null && value !== "";
  if (whole(wish.frame)) patch.frame = clamp(Number(wish.frame), 0, data.frames - 1);
  if ("scale" in wish) {
    const most = Math.max(0, ...data.tracks.map((track) => track.levels.length));
    patch.scale = whole(wish.scale) && wish.scale >= 1 && wish.scale <= most ? Number(wish.scale) : null;
  }
  if (["focus", "upto", "only", "without"].includes(wish.mode)) patch.scaleMode = wish.mode;
  if ("selection" in wish) patch.selection = there(wish.selection, data);
  if ("span" in wish) {
    const [start, stop] = (wish.span || []).map(Number);
    const good = whole(start) && whole(stop) && start >= 0 && stop > start && stop <= data.frames;
    patch.span = good ? [start, stop] : null;
  }
  if (Number(wish.speed) > 0 && Number(wish.speed) <= 4) patch.speed = Number(wish.speed);
  return patch;
}

// Calls tell(state) once after some change to the state, when it has come to rest: not while it plays or is dragged.
export function watchState(store, isBusy, tell) {
  let timer = null, last = JSON.stringify(readState(store.state));
  const settle = () => {
    timer = null;
    if (store.state.playing) return;
    if (isBusy()) return wait();
    const now = readState(store.state), text = JSON.stringify(now);
    if (text === last) return;
    last = text;
    tell(now);
  };
  const wait = () => {
    clearTimeout(timer);
    timer = setTimeout(settle, REST);
  };
  const keys = ["frame", "scale", "scaleMode", "selection", "span", "speed", "playing"];
  const forget = store.on("change", (changed) => {
    if (!store.state.playing && keys.some((key) => changed.has(key))) wait();
  });
  return () => {
    clearTimeout(timer);
    forget();
  };
}

function there(selection, data) {
  const track = data.tracks.find(({ system }) => system === selection?.system);
  const { scale, position } = selection || {};
  const good = Number.isInteger(position) && position >= 0 && position < track?.levels[scale - 1]?.size;
  return good ? { system: track.system, scale, position } : null;
}

function clamp(value, low, high) {
  return Math.min(high, Math.max(low, value));
}

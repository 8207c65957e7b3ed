// Keyboard of the stage. Keys reach the stage that has the focus, or else the one that is in sight.

import { locate, tokenAt } from "./store.js";
import { toggleLayout, togglePlay } from "./toolbar.js";

const stages = new Set();
const TYPING = "input, textarea, select, [contenteditable], [role=slider], [role=tab], [role=listbox], [role=option]";
let listening = false;

// stage: {element, store, owns(node), getData(), camera, onCamera()}; returns a function that forgets it.
export function listenToKeys(stage) {
  stages.add(stage);
  if (!listening) document.addEventListener("keydown", route);
  listening = true;
  return () => stages.delete(stage);
}

function route(event) {
  if (event.defaultPrevented || event.ctrlKey || event.metaKey || event.altKey) return;
  const target = event.target instanceof Element ? event.target : document.body;
  const inside = [...stages].find((stage) => stage.owns(target));
  if (!inside && (target.closest(TYPING) || target.closest("button, a"))) return;
  const stage = inside || [...stages].find(inSight);
  if (stage && stage.getData() && press(stage, event, target)) event.preventDefault();
}

function inSight({ element }) {
  const box = element.getBoundingClientRect();
  return box.width > 0 && box.height > 0 && box.bottom > 0 && box.top < window.innerHeight;
}

// Does what the key says; false if the key means nothing here.
function press(stage, event, target) {
  const { store, camera } = stage, { state } = store;
  const onButton = target.closest("button");
  const jump = (frame) => store.set({ playing: false }) || store.seek(frame) || true;
  const flip = (key) => store.set({ [key]: !state[key] }) || true;
  const moved = () => stage.onCamera() || true;
  switch (event.key) {
    case " ": return onButton ? false : togglePlay(store) || true;
    case "ArrowLeft": return event.shiftKey ? stepToken(stage, -1) : jump(Math.ceil(state.frame) - 1);
    case "ArrowRight": return event.shiftKey ? stepToken(stage, 1) : jump(Math.floor(state.frame) + 1);
    case "ArrowUp": return event.shiftKey ? stepScale(stage, -1) : false;
    case "ArrowDown": return event.shiftKey ? stepScale(stage, 1) : false;
    case "Home": return jump(0);
    case "End": return jump(state.frames - 1);
    case "Escape": return clearChoice(store);
    case "[": return markSpan(store, Math.floor(state.frame), state.span ? state.span[1] : state.frames);
    case "]": return markSpan(store, state.span ? state.span[0] : 0, Math.floor(state.frame) + 1);
    case "+": case "=": return camera.zoomBy(1.15) || moved();
    case "-": return camera.zoomBy(1 / 1.15) || moved();
    case "l": return flip("loop");
    case "f": return flip("follow");
    case "t": return flip("trail");
    case "g": return flip("ghost");
    case "o": return toggleLayout(store) || true;
    case "r": return camera.reset() && moved();
    case "Enter": return onButton ? false : selectUnderPlayhead(stage);
    default: return /^[0-9]$/.test(event.key) ? chooseScale(stage, event.key === "0" ? 10 : Number(event.key)) : false;
  }
}

function chooseScale({ store, getData }, scale) {
  const most = Math.max(0, ...getData().tracks.map((track) => track.levels.length));
  if (scale > most) return false;
  store.commit("scale", { scale: store.state.scale === scale ? null : scale, scaleMode: "focus" });
  return true;
}

// The token that keys move from: the chosen one, else the one under the playhead at the chosen scale (or the finest).
function current({ store, getData }, selection = store.state.selection) {
  const chosen = locate(getData().tracks, selection);
  if (chosen) return chosen;
  const track = getData().tracks[0];
  if (!track) return null;
  const level = Math.min(store.state.scale || track.levels.length, track.levels.length) - 1;
  return { track: 0, level, position: Math.max(0, tokenAt(track, level, store.state.frame)) };
}

function stepToken(stage, by) {
  const { store, getData } = stage;
  const cell = current(stage);
  if (!cell) return false;
  const track = getData().tracks[cell.track], size = track.levels[cell.level].size;
  const position = Math.min(size - 1, Math.max(0, cell.position + by));
  return goTo(stage, { ...cell, position }, Boolean(store.state.selection));
}

function stepScale(stage, by) {
  const { store, getData } = stage;
  const cell = current(stage);
  if (!cell) return false;
  const track = getData().tracks[cell.track];
  const level = Math.min(track.levels.length - 1, Math.max(0, cell.level + by));
  if (!store.state.selection) return chooseScale(stage, level + 1);
  const middle = ((cell.position + 0.5) * track.frames) / track.levels[cell.level].size;
  return goTo(stage, { track: cell.track, level, position: Math.max(0, tokenAt(track, level, middle)) }, true);
}

// Puts the playhead on the first frame whose token this is, and chooses the token where one was chosen before.
function goTo({ store, getData }, { track: index, level, position }, choose) {
  const track = getData().tracks[index];
  store.set({ playing: false });
  store.seek(Math.ceil((position * track.frames) / track.levels[level].size));
  if (choose) store.commit("select", { selection: { system: track.system, scale: level + 1, position } });
  return true;
}

function selectUnderPlayhead(stage) {
  const { store, getData } = stage;
  const cell = current(stage, null);
  if (!cell || !getData().tracks[cell.track].levels[cell.level].ids) return false;
  const { system } = getData().tracks[cell.track];
  store.commit("select", { selection: { system, scale: cell.level + 1, position: cell.position } });
  return true;
}

function markSpan(store, start, stop) {
  store.set({ playing: false });
  store.commit("span", { span: stop > start ? [start, stop] : null });
  return true;
}

function clearChoice(store) {
  const { state } = store;
  if (!state.selection && !state.span && !state.scale) return false;
  if (state.selection) store.commit("select", { selection: null });
  if (state.span) store.commit("span", { span: null });
  if (state.scale && state.scaleMode === "focus") store.commit("scale", { scale: null });
  return true;
}

// What lights up over the score: the tokens under the clock, the token pointed at and the chosen one, their frames in
// every other track, the span, and the place in a heat map.

import { css } from "./colour.js";
import { cellEdges } from "./rows.js";
import { governing, litToken, locate, tokenAt } from "./store.js";

const SCRIM = 0.42; // how much of the ground lies over what is not governed, while a token is pointed at

// view: {data, laid, width, theme, store}
export function paintLight(ctx, view) {
  const { store, theme, data } = view, { state } = store;
  const lit = litToken(data.tracks, state);
  if (state.span) column(ctx, view, state.span, theme.focus, 0.14);
  if (lit && !lit.chosen) shadeOutside(ctx, view, lit.span);
  if (lit) column(ctx, view, lit.span, lit.chosen ? theme.focus : theme.text, lit.chosen ? 0.14 : 0);
  paintUnderClock(ctx, view, state.peek ?? state.frame);
  if (lit) paintOthers(ctx, view, lit);
  paintChosen(ctx, view);
  if (state.hover) ring(ctx, view, state.hover, css(theme.text), 2.5);
  if (state.peek !== null) line(ctx, view, state.peek, css(theme.text, 0.7));
  if (state.probe) paintProbe(ctx, view, state.probe);
}

// The token of every scale and every track at one moment.
function paintUnderClock(ctx, view, frame) {
  const { data, laid, theme } = view;
  for (const row of laid.rows) {
    const track = data.tracks[row.track], position = tokenAt(track, row.level, frame);
    if (position < 0 || !track.levels[row.level].ids) continue;
    ring(ctx, view, { ...row, position }, css(theme.surface, 0.9), 3);
    ring(ctx, view, { ...row, position }, css(theme.ink), 1.75);
  }
}

// In the other tracks, an outline round the tokens that govern the same frames.
function paintOthers(ctx, view, { cell, span, chosen }) {
  const { data, laid, theme } = view;
  for (const row of laid.rows) {
    const track = data.tracks[row.track];
    if (row.track === cell.track || !track.levels[row.level].ids) continue;
    const range = governing(track, row.level, span);
    if (!range) continue;
    const [from] = edges(view, { ...row, position: range[0] });
    const [, to] = edges(view, { ...row, position: range[1] - 1 });
    outline(ctx, from, row.y, to - from, row.height, css(theme.surface, 0.9), 3);
    outline(ctx, from, row.y, to - from, row.height, css(chosen ? theme.focus : theme.text), 1.5);
  }
}

// The chosen token, and thinly every place where the same code stands in its scale.
function paintChosen(ctx, view) {
  const { data, theme, store } = view, chosen = locate(data.tracks, store.state.selection);
  if (!chosen) return;
  const level = data.tracks[chosen.track].levels[chosen.level];
  for (let position = 0; level.ids && position < level.size; position++) {
    const same = level.ids[position] === level.ids[chosen.position];
    if (same && position !== chosen.position) ring(ctx, view, { ...chosen, position }, css(theme.focus), 1.5);
  }
  ring(ctx, view, chosen, css(theme.surface), 6, 1.5);
  ring(ctx, view, chosen, css(theme.focus), 3, 1.5);
}

// A stretch of time from the top of the score to its end, with its two edges; tinted between the tracks only, so that
// what is written on the cells stays as easy to read.
function column(ctx, { data, laid, width }, [from, to], rgb, alpha) {
  const x = (from / data.frames) * width, wide = ((to - from) / data.frames) * width;
  let free = 0;
  const filled = [...laid.rows, ...laid.strips.map(({ y, step, count }) => ({ y, height: step * count }))];
  ctx.fillStyle = css(rgb, alpha);
  for (const { y, height } of [...filled, { y: laid.height, height: 0 }]) {
    ctx.fillRect(x, free, wide, y - free);
    free = y + height;
  }
  ctx.fillStyle = css(rgb);
  ctx.fillRect(Math.round(x), 0, 1, laid.height);
  ctx.fillRect(Math.round(x + wide) - 1, 0, 1, laid.height);
}

function shadeOutside(ctx, { data, laid, width, theme }, [from, to]) {
  ctx.fillStyle = css(theme.surface, SCRIM);
  const x = (from / data.frames) * width, end = (to / data.frames) * width;
  ctx.fillRect(0, 0, x, laid.height);
  ctx.fillRect(end, 0, width - end, laid.height);
}

function paintProbe(ctx, view, { strip, row, frame }) {
  const { data, laid, width, theme } = view, place = laid.strips[strip], step = width / data.frames;
  line(ctx, view, frame + 0.5, css(theme.text, 0.7));
  const y = place.y + row * place.step, wide = data.strips[strip].frames * step;
  outline(ctx, -1, y - 1, wide + 2, place.step + 2, css(theme.surface, 0.9), 3);
  outline(ctx, -1, y - 1, wide + 2, place.step + 2, css(theme.text), 1.25);
  outline(ctx, frame * step - 1.5, y - 2, step + 3, place.step + 4, css(theme.text), 2);
}

function line(ctx, { data, laid, width }, frame, color) {
  ctx.fillStyle = color;
  ctx.fillRect(Math.round((frame / data.frames) * width), 0, 1, laid.height);
}

function edges({ data, width }, { track, level, position }) {
  return cellEdges(data.tracks[track], level, position, data.frames, width);
}

// grow: pixels by which the ring is larger than the cell, so that what is written in it stays free.
function ring(ctx, view, cell, color, wide, grow = 0) {
  const row = view.laid.rows.find((candidate) => candidate.track === cell.track && candidate.level === cell.level);
  const [from, to] = edges(view, cell);
  outline(ctx, from - grow, row.y - grow, to - from + 2 * grow, row.height + 2 * grow, color, wide);
}

function outline(ctx, x, y, w, h, color, wide) {
  ctx.strokeStyle = color;
  ctx.lineWidth = wide;
  ctx.beginPath();
  ctx.roundRect(x, y + 0.5, Math.max(2, w - 1), h - 1, 2);
  ctx.stroke();
}

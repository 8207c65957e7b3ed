// The time axis: ruler, playhead, span. Dragging scrubs; dragging with alt (or in span mode) chooses a span.

import { clear, el, seconds, sizeCanvas } from "./dom.js";
import { css } from "./colour.js";
import { spanOf } from "./store.js";

export const RULER = 30; // height in CSS pixels

export function createTimeline(store, getData) {
  const { state } = store;
  const canvas = el("canvas", { "aria-hidden": "true" });
  const element = el(
    "div",
    { class: "ms-ruler", role: "slider", tabindex: "0", "aria-label": "Time", "aria-valuemin": "0", title: "Drag to scrub, alt+drag to choose a span" },
    canvas,
  );
  let width = 0, left = 0, right = 0, ratio = 1, theme = null, view = null, spanMode = false;

  const xOf = (frame) => left + (frame / Math.max(state.frames, 1)) * (width - left - right);
  const frameAt = (x) => ((x - left) / Math.max(1, width - left - right)) * state.frames;

  function resize(nextWidth, gutter, margin, pixelRatio) {
    [width, left, right, ratio] = [nextWidth, gutter, margin, pixelRatio];
    sizeCanvas(canvas, width, RULER, ratio);
  }

  function draw() {
    if (!theme || width < 2) return;
    const ctx = clear(canvas, ratio);
    drawRuler(ctx);
    const bar = RULER - 9;
    ctx.fillStyle = css(theme.line);
    rounded(ctx, left, bar, width - left - right, 4);
    if (state.hover && getData()) {
      const track = getData().tracks[state.hover.track];
      const [from, to] = spanOf(track, state.hover.level, state.hover.position);
      ctx.fillStyle = css(theme.text, 0.35);
      rounded(ctx, xOf(from), bar - 2, Math.max(2, xOf(to) - xOf(from)), 8);
    }
    ctx.fillStyle = css(theme.ink);
    rounded(ctx, left, bar, xOf(state.frame) - left, 4);
    if (state.span) drawSpan(ctx, bar);
    if (view) {
      ctx.strokeStyle = css(theme.lineStrong);
      ctx.strokeRect(xOf(view[0]) + 0.5, bar - 5.5, xOf(view[1]) - xOf(view[0]) - 1, 14);
    }
    const x = xOf(state.frame);
    ctx.beginPath();
    ctx.arc(x, bar + 2, 6, 0, 2 * Math.PI);
    ctx.fillStyle = css(theme.ink);
    ctx.fill();
    ctx.lineWidth = 2;
    ctx.strokeStyle = css(theme.surface);
    ctx.stroke();
  }

  function drawRuler(ctx) {
    const total = state.frames / state.fps, pixels = (width - left - right) / Math.max(total, 0.01);
    const every = [0.5, 1, 2, 5, 10].find((stepSeconds) => stepSeconds * pixels > 44) || 20;
    ctx.font = `11px ${theme.font}`;
    ctx.textBaseline = "alphabetic";
    ctx.fillStyle = css(theme.muted);
    ctx.textAlign = "left";
    for (let s = 0; s <= total + 1e-6; s += every) {
      const x = xOf(s * state.fps);
      const text = `${s} s`;
      if (x + ctx.measureText(text).width > width) break;
      ctx.fillText(text, Math.round(x), 12);
    }
  }

  function drawSpan(ctx, bar) {
    const from = xOf(state.span[0]), to = xOf(state.span[1]);
    ctx.fillStyle = css(theme.focus, 0.3);
    ctx.fillRect(from, bar - 4, to - from, 12);
    ctx.fillStyle = css(theme.focus);
    ctx.fillRect(from - 1, bar - 6, 2, 16);
    ctx.fillRect(to - 1, bar - 6, 2, 16);
  }

  function rounded(ctx, x, y, w, h) {
    if (w <= 0) return;
    ctx.beginPath();
    ctx.roundRect(x, y, w, h, 2);
    ctx.fill();
  }

  function tell() {
    element.setAttribute("aria-valuemax", seconds(state.frames, state.fps));
    element.setAttribute("aria-valuenow", seconds(state.frame, state.fps));
    element.setAttribute("aria-valuetext", `${seconds(state.frame, state.fps)} of ${seconds(state.frames, state.fps)} seconds`);
  }

  function pointer() {
    let drag = null;
    const at = (event) => frameAt(event.clientX - element.getBoundingClientRect().left);
    element.addEventListener("pointerdown", (event) => {
      if (event.button !== 0 || state.frames < 2) return;
      element.setPointerCapture(event.pointerId);
      drag = { from: at(event), span: event.altKey || spanMode, playing: state.playing };
      store.set({ playing: false });
      if (!drag.span) store.seek(drag.from);
      event.preventDefault();
      element.focus({ preventScroll: true });
    });
    element.addEventListener("pointermove", (event) => {
      if (!drag) return;
      if (!drag.span) store.seek(at(event));
      else store.set({ span: ordered(drag.from, at(event), state.frames) });
    });
    const end = (event) => {
      if (!drag) return;
      const { span, from, playing } = drag;
      drag = null;
      if (span) store.commit("span", { span: event.type === "pointercancel" ? state.span : ordered(from, at(event), state.frames) });
      store.set({ playing });
    };
    element.addEventListener("pointerup", end);
    element.addEventListener("pointercancel", end);
  }

  pointer();
  return {
    element, resize, draw, tell, xOf,
    dress: (next) => (theme = next),
    setView: (next) => (view = next),
    setSpanMode: (on) => (spanMode = on),
  };
}

// Whole frames [start, stop] of a drag; null when it is shorter than a frame: a mere click clears the span.
function ordered(a, b, frames) {
  const start = Math.max(0, Math.floor(Math.min(a, b))), stop = Math.min(frames, Math.ceil(Math.max(a, b)));
  return Math.abs(a - b) < 1 || stop <= start ? null : [start, stop];
}

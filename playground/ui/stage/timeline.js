// The time axis: ruler, playhead, span. Dragging scrubs; dragging with alt (or in span mode) chooses a span.

import { clear, el, seconds, sizeCanvas } from "./dom.js";
import { css } from "./colour.js";
import { spanOf } from "./store.js";

const HEIGHT = 30; // CSS pixels
const BAR = HEIGHT - 9; // top of the bar

export class Timeline {
  constructor(store, getData) {
    Object.assign(this, { store, getData, width: 0, left: 0, right: 0, ratio: 1 });
    Object.assign(this, { theme: null, view: null, spanMode: false });
    this.canvas = el("canvas", { "aria-hidden": "true" });
    this.elapsed = el("i", { class: "ms-elapsed" });
    this.knob = el("i", { class: "ms-knob" });
    this.element = el("div", {
      class: "ms-ruler", role: "slider", tabindex: "0", "aria-label": "Time", "aria-valuemin": "0",
      title: "Drag to scrub, alt+drag to choose a span",
    }, this.canvas, this.elapsed, this.knob);
    this.listen();
  }

  xOf(frame) {
    return this.left + (frame / Math.max(this.store.state.frames, 1)) * (this.width - this.left - this.right);
  }

  frameAt(event) {
    const x = event.clientX - this.element.getBoundingClientRect().left;
    return ((x - this.left) / Math.max(1, this.width - this.left - this.right)) * this.store.state.frames;
  }

  resize(width, left, right, ratio) {
    Object.assign(this, { width, left, right, ratio });
    sizeCanvas(this.canvas, width, HEIGHT, ratio);
  }

  // What moves at every frame is two elements, so that the canvas stands still.
  move() {
    const x = this.xOf(this.store.state.frame);
    this.knob.style.transform = `translateX(${x.toFixed(1)}px)`;
    this.elapsed.style.transform = `translateX(${this.left}px) scaleX(${Math.max(0, x - this.left).toFixed(1)})`;
    this.tell();
  }

  draw() {
    const { theme, width, left, right } = this, { state } = this.store;
    if (!theme || width < 2) return;
    const ctx = clear(this.canvas, this.ratio);
    this.drawRuler(ctx);
    ctx.fillStyle = css(theme.line);
    rounded(ctx, left, BAR, width - left - right, 4);
    if (state.hover) {
      const track = this.getData().tracks[state.hover.track];
      const [from, to] = spanOf(track, state.hover.level, state.hover.position);
      ctx.fillStyle = css(theme.text, 0.35);
      rounded(ctx, this.xOf(from), BAR - 2, Math.max(2, this.xOf(to) - this.xOf(from)), 8);
    }
    if (state.span) this.drawSpan(ctx, state.span);
    if (this.view) {
      const [from, to] = this.view.map((frame) => this.xOf(frame));
      ctx.strokeStyle = css(theme.lineStrong);
      ctx.strokeRect(from + 0.5, BAR - 5.5, to - from - 1, 14);
    }
  }

  drawRuler(ctx) {
    const { state } = this.store;
    const total = state.frames / state.fps, pixels = (this.width - this.left - this.right) / Math.max(total, 0.01);
    const every = [0.5, 1, 2, 5, 10].find((step) => step * pixels > 44) || 20;
    ctx.font = `11px ${this.theme.font}`;
    ctx.textAlign = "left";
    ctx.textBaseline = "alphabetic";
    ctx.fillStyle = css(this.theme.muted);
    for (let s = 0; s <= total + 1e-6; s += every) {
      const x = Math.round(this.xOf(s * state.fps)), text = `${s} s`;
      if (x + ctx.measureText(text).width > this.width) break;
      ctx.fillText(text, x, 12);
    }
  }

  drawSpan(ctx, span) {
    const [from, to] = span.map((frame) => this.xOf(frame));
    ctx.fillStyle = css(this.theme.focus, 0.3);
    ctx.fillRect(from, BAR - 4, to - from, 12);
    ctx.fillStyle = css(this.theme.focus);
    ctx.fillRect(from - 1, BAR - 6, 2, 16);
    ctx.fillRect(to - 1, BAR - 6, 2, 16);
  }

  // The values that screen readers tell; not at every drawn frame while it plays, or they would never stop talking.
  tell() {
    const { state } = this.store;
    const now = seconds(Math.floor(state.frame + 1e-6), state.fps), total = seconds(state.frames, state.fps);
    if (this.told === now + total) return;
    this.told = now + total;
    this.element.setAttribute("aria-valuemax", total);
    this.element.setAttribute("aria-valuenow", now);
    this.element.setAttribute("aria-valuetext", `${now} of ${total} seconds`);
  }

  listen() {
    const { element, store } = this;
    let drag = null;
    element.addEventListener("pointerdown", (event) => {
      if (event.button !== 0 || store.state.frames < 2) return;
      event.preventDefault();
      element.setPointerCapture(event.pointerId);
      element.focus({ preventScroll: true });
      drag = { from: this.frameAt(event), span: event.altKey || this.spanMode, playing: store.state.playing };
      store.set({ playing: false });
      if (!drag.span) store.seek(drag.from);
    });
    element.addEventListener("pointermove", (event) => {
      if (!drag) return;
      if (drag.span) store.set({ span: spanBetween(drag.from, this.frameAt(event), store.state.frames) });
      else store.seek(this.frameAt(event));
    });
    const end = (event) => {
      if (!drag) return;
      const { span, from, playing } = drag;
      drag = null;
      const { state } = store, released = event.type === "pointerup";
      const chosen = released ? spanBetween(from, this.frameAt(event), state.frames) : state.span;
      if (span) store.commit("span", { span: chosen });
      store.set({ playing });
    };
    element.addEventListener("pointerup", end);
    element.addEventListener("pointercancel", end);
  }
}

function rounded(ctx, x, y, w, h) {
  if (w <= 0) return;
  ctx.beginPath();
  ctx.roundRect(x, y, w, h, 2);
  ctx.fill();
}

// Whole frames [start, stop] of a drag; null when it is shorter than a frame: a mere click clears the span.
function spanBetween(a, b, frames) {
  const start = Math.max(0, Math.floor(Math.min(a, b))), stop = Math.min(frames, Math.ceil(Math.max(a, b)));
  return Math.abs(a - b) < 1 || stop <= start ? null : [start, stop];
}

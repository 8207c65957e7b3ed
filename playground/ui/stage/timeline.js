// The time axis: ruler, playhead, span. Dragging scrubs; dragging with alt (or in span mode) chooses a span.

import { Brush } from "./brush.js";
import { paintHatch } from "./cells.js";
import { clear, el, seconds, sizeCanvas } from "./dom.js";
import { css } from "./colour.js";
import { litToken } from "./store.js";

const HEIGHT = 30; // CSS pixels
const BAR = HEIGHT - 9; // top of the bar
const HINT = "Drag to scrub, alt+drag to choose a span";
const SPAN_HINT = "Drag to choose a span, drag the dot to scrub";
const THICK = 4; // pixels of the bar; more where frames are hatched
const KNOB = 10; // pixels on either side that take hold of the playhead in span mode

export class Timeline {
  constructor(store, getData) {
    Object.assign(this, { store, getData, width: 0, left: 0, right: 0, ratio: 1 });
    Object.assign(this, { theme: null, view: null, spanMode: false, drag: null });
    this.canvas = el("canvas", { "aria-hidden": "true" });
    this.elapsed = el("i", { class: "ms-elapsed" });
    this.knob = el("i", { class: "ms-knob" });
    this.peek = el("i", { class: "ms-peek", hidden: true });
    this.slider = el("div", {
      class: "ms-time-slider", role: "slider", tabindex: "0", "aria-label": "Time", "aria-valuemin": "0",
      title: HINT,
    });
    const parts = [this.canvas, this.elapsed, this.slider];
    this.element = el("div", { class: "ms-ruler" }, ...parts);
    this.brush = new Brush(this);
    this.element.append(this.knob, this.peek);
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
    this.brush.show();
  }

  // In span mode a plain drag draws a span, and the playhead is dragged by its knob.
  setSpanMode(on) {
    this.spanMode = Boolean(on);
    this.element.classList.toggle("is-spanning", this.spanMode);
    this.slider.title = on ? SPAN_HINT : HINT;
  }

  // What moves at every frame is two elements, so that the canvas stands still.
  move() {
    const x = this.xOf(this.store.state.frame);
    this.knob.style.transform = `translateX(${x.toFixed(1)}px)`;
    this.elapsed.style.transform = `translateX(${this.left}px) scaleX(${Math.max(0, x - this.left).toFixed(1)})`;
    this.tell();
  }

  draw() {
    const { theme, width, left, right } = this, { state } = this.store, data = this.getData();
    if (!theme || width < 2) return;
    const ctx = clear(this.canvas, this.ratio);
    this.drawRuler(ctx);
    ctx.fillStyle = css(theme.line);
    rounded(ctx, left, BAR, this.xOf(state.until ?? state.frames) - left, THICK);
    for (const [from, to] of data?.hatch || []) {
      const [x, end] = [this.xOf(from), this.xOf(to)];
      ctx.fillStyle = css(theme.line);
      ctx.fillRect(x, BAR - 3, end - x, THICK + 6);
      paintHatch(ctx, x, BAR - 3, end - x, THICK + 6, [css(theme.lineStrong)], 5);
    }
    const lit = data && litToken(data.tracks, state);
    if (lit) {
      const [from, to] = lit.span.map((frame) => this.xOf(frame));
      ctx.fillStyle = lit.chosen ? css(theme.focus) : css(theme.text, 0.45);
      rounded(ctx, from, BAR - 2, Math.max(2, to - from), THICK + 4);
    }
    if (this.view) {
      const [from, to] = this.view.map((frame) => this.xOf(frame));
      ctx.strokeStyle = css(theme.lineStrong);
      ctx.strokeRect(from + 0.5, BAR - 5.5, to - from - 1, THICK + 10);
    }
    this.brush.show();
    this.drawPeek(state.peek);
  }

  drawRuler(ctx) {
    const { state } = this.store;
    const total = state.frames / state.fps, pixels = (this.width - this.left - this.right) / Math.max(total, 0.01);
    const first = state.origin / state.fps;
    const every = [0.5, 1, 2, 5, 10].find((step) => step * pixels > 44) || 20;
    ctx.font = `11px ${this.theme.font}`;
    ctx.textAlign = "left";
    ctx.textBaseline = "alphabetic";
    ctx.fillStyle = css(this.theme.muted);
    for (let s = Math.ceil(first / every - 1e-6) * every; s <= first + total + 1e-6; s += every) {
      const x = Math.round(this.xOf(s * state.fps - state.origin)), text = `${s} s`;
      if (x + ctx.measureText(text).width > this.width) break;
      ctx.fillText(text, x, 12);
    }
  }

  // The moment under the pointer, told over the ruler.
  drawPeek(frame) {
    this.peek.hidden = frame === null;
    if (frame === null) return;
    this.peek.textContent = `${seconds(frame + this.store.state.origin, this.store.state.fps)} s`;
    const x = Math.min(Math.max(this.xOf(frame), 26), this.width - 26);
    this.peek.style.transform = `translateX(${x.toFixed(1)}px) translateX(-50%)`;
  }

  // The values that screen readers tell; not at every drawn frame while it plays, or they would never stop talking.
  tell() {
    const { state } = this.store;
    const now = seconds(state.origin + Math.floor(state.frame + 1e-6), state.fps);
    const total = seconds(state.origin + (state.until ?? state.frames), state.fps);
    if (this.told === now + total) return;
    this.told = now + total;
    this.slider.setAttribute("aria-valuemax", total);
    this.slider.setAttribute("aria-valuenow", now);
    this.slider.setAttribute("aria-valuetext", `${now} of ${total} seconds`);
  }

  listen() {
    const { element } = this;
    element.addEventListener("pointerdown", (event) => this.begin(event));
    element.addEventListener("pointermove", (event) => this.follow(event));
    element.addEventListener("pointerup", (event) => this.end(event));
    element.addEventListener("pointercancel", (event) => this.end(event));
    element.addEventListener("pointerleave", () => this.store.set({ peek: null }));
  }

  begin(event) {
    const { store, element, brush } = this;
    if (event.button !== 0 || store.state.frames < 2) return;
    event.preventDefault();
    element.setPointerCapture(event.pointerId);
    const at = this.frameAt(event), part = brush.partAt(event), edge = part === "start" || part === "end";
    const onKnob = Math.abs(this.xOf(at) - this.xOf(store.state.frame)) <= KNOB;
    const spanning = edge || event.altKey || (this.spanMode && !onKnob);
    this.drag = { spanning, playing: store.state.playing };
    store.set({ playing: false, peek: null });
    (edge ? brush.handles[part === "end" ? 1 : 0] : this.slider).focus({ preventScroll: true });
    if (spanning) brush.take(edge || (part && !event.altKey) ? part : null, at);
    else store.seek(at);
  }

  follow(event) {
    const { store, drag } = this, at = this.frameAt(event);
    if (drag) return drag.spanning ? this.brush.drawTo(at) : store.seek(at);
    const inside = at >= 0 && at < store.state.frames && event.pointerType !== "touch";
    store.set({ peek: inside ? at : null });
  }

  end(event) {
    const { drag, store } = this;
    if (!drag) return;
    this.drag = null;
    const at = this.frameAt(event), still = drag.spanning && !event.altKey && this.brush.isStill(at);
    if (drag.spanning && event.type === "pointerup") this.brush.drawTo(at);
    if (still) this.brush.undo();
    if (drag.spanning) this.brush.release(!still);
    if (still) store.seek(at); // a mere click in span mode
    store.set({ playing: drag.playing });
  }
}

function rounded(ctx, x, y, w, h) {
  if (w <= 0) return;
  ctx.beginPath();
  ctx.roundRect(x, y, w, h, 2);
  ctx.fill();
}

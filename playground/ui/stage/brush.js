// The span on the time axis: a band with a handle at each end, for mouse, finger and keyboard. Python hears of it when
// it is let go.

import { el } from "./dom.js";

const REACH = 12; // pixels on either side of a handle's line that take hold of it
const LEAST = 1; // frames
const HAIR = 0.01; // part of a frame that a pointer may be beside an edge

export class Brush {
  // axis: {element, store, xOf(frame), frameAt(event)}
  constructor(axis) {
    this.axis = axis;
    this.band = el("i", { class: "ms-band" });
    this.handles = ["Start", "End"].map((name, side) => {
      const node = el("div", {
        class: "ms-handle", role: "slider", tabindex: "0", "aria-label": `${name} of the span`, "aria-valuemin": "0",
      });
      node.addEventListener("keydown", (event) => this.press(event, side));
      node.addEventListener("keyup", () => this.settle());
      node.addEventListener("blur", () => this.settle());
      return node;
    });
    axis.element.append(this.band, ...this.handles);
    this.show();
  }

  // "start" | "end" | "band" | null: what of the span is under a pointer. Handles win over the band.
  partAt(event) {
    const { span } = this.axis.store.state;
    if (!span) return null;
    const x = event.clientX - this.axis.element.getBoundingClientRect().left;
    const [from, to] = span.map((frame) => this.axis.xOf(frame));
    const [before, after] = [Math.abs(x - from), Math.abs(x - to)];
    if (Math.min(before, after) <= REACH) return before < after ? "start" : "end";
    return x > from && x < to ? "band" : null;
  }

  // Begins a drag that started at `frame`; part null draws a new span.
  take(part, frame) {
    this.drag = { part, frame, span: this.axis.store.state.span };
  }

  drawTo(frame) {
    const { part, frame: from, span } = this.drag, { store } = this.axis, { frames } = store.state;
    if (!part) return store.set({ span: between(from, frame, frames) });
    const by = Math.round(frame - from);
    if (part === "band") {
      const moved = Math.min(frames - span[1], Math.max(-span[0], by));
      return store.set({ span: [span[0] + moved, span[1] + moved] });
    }
    this.moveEdge(part === "end" ? 1 : 0, span[part === "end" ? 1 : 0] + by, span);
  }

  // Whether a drag has gone nowhere.
  isStill(frame) {
    return Math.abs(frame - this.drag.frame) < 1;
  }

  undo() {
    this.axis.store.set({ span: this.drag.span });
  }

  release(commit) {
    this.drag = null;
    if (commit) this.axis.store.commit("span", {});
  }

  moveEdge(side, frame, [start, stop] = this.axis.store.state.span) {
    const { frames } = this.axis.store.state;
    const span = side ? [start, Math.min(frames, Math.max(start + LEAST, frame))]
      : [Math.max(0, Math.min(stop - LEAST, frame)), stop];
    this.axis.store.set({ span });
  }

  press(event, side) {
    const { state } = this.axis.store, second = Math.round(state.fps), step = event.shiftKey ? 5 : 1;
    const by = {
      ArrowLeft: -step, ArrowDown: -step, ArrowRight: step, ArrowUp: step, PageDown: -second, PageUp: second,
      Home: -Infinity, End: Infinity,
    }[event.key];
    if (by === undefined || !state.span) return;
    event.preventDefault();
    this.moveEdge(side, state.span[side] + by);
    this.moved = true;
  }

  // A key may be held down: the span is told once it is let go.
  settle() {
    if (this.moved) this.axis.store.commit("span", {});
    this.moved = false;
  }

  show() {
    const { span, frames, fps } = this.axis.store.state;
    for (const node of [this.band, ...this.handles]) node.hidden = !span;
    if (!span) return;
    const [from, to] = span.map((frame) => this.axis.xOf(frame));
    Object.assign(this.band.style, { left: `${from}px`, width: `${Math.max(0, to - from)}px` });
    this.handles.forEach((node, side) => {
      node.style.left = `${[from, to][side]}px`;
      node.setAttribute("aria-valuemax", (frames / fps).toFixed(2));
      node.setAttribute("aria-valuenow", (span[side] / fps).toFixed(2));
      node.setAttribute("aria-valuetext", `${(span[side] / fps).toFixed(2)} seconds, frame ${span[side]}`);
    });
  }
}

// Whole frames [start, stop] of a drag; null when it is shorter than a frame: a mere click clears the span.
function between(a, b, frames) {
  const start = Math.max(0, Math.floor(Math.min(a, b) + HAIR));
  const stop = Math.min(frames, Math.ceil(Math.max(a, b) - HAIR));
  return Math.abs(a - b) < 1 || stop <= start ? null : [start, stop];
}

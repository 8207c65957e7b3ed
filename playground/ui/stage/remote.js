// What the page may call of a mounted stage, beside setPayload: play, seek, select, read and restore its state.

import { fitting, readState } from "./links.js";
import { snapshot } from "./snapshot.js";

export class Remote {
  busy(text = "Working") {
    this.say("loading", text);
  }

  fail(text) {
    this.say("error", text);
  }

  setGuidance(g) {
    if (Number.isFinite(Number(g))) this.store.set({ guidance: Number(g) });
  }

  // mode: "focus" marks a scale, "upto" | "only" | "without" say which scales the decode shown used. null: all.
  setScale(scale, mode = "focus") {
    this.store.set({ scale: scale || null, scaleMode: mode });
  }

  play(playing = true) {
    this.store.set({ playing });
  }

  pause() {
    this.play(false);
  }

  // A motion that grew is whole now: the window that is there can be played and looked at like any other.
  finish() {
    const { data } = this;
    this.pause();
    if (!data?.growing) return;
    this.data = { ...data, frames: data.growing.made, growing: null };
    this.show(this.data, {});
  }

  seek(frame) {
    this.store.seek(Number(frame));
  }

  select(selection) {
    this.store.set({ selection: selection || null });
  }

  selectSpan(span) {
    this.store.set({ span: span || null });
  }

  setSpanMode(on) {
    this.timeline.setSpanMode(on);
  }

  // What a link holds: {frame, scale, mode, selection, span, speed}, plain JSON.
  getState() {
    return readState(this.store.state);
  }

  // Puts some of it back, without telling Python. Before there is a result it waits for the first one.
  setState(wish) {
    if (!this.data) return void (this.wished = { ...this.wished, ...wish });
    this.wished = null;
    const patch = fitting(wish, this.data);
    this.store.set("frame" in patch ? { ...patch, playing: false } : patch);
  }

  // PNG of the figures with their names, as a data URL; null while there is nothing to see.
  snapshot() {
    if (!this.data || !this.figures.theme) return null;
    this.figures.draw();
    return snapshot(this.figures.canvas, this.figures.labels.nodes, this.figures.theme);
  }

  // event: "select", "span", "scale" (on commit), "state" (what a link holds, once it has come to rest), "change" (any
  // value of the state), "frame" (each drawn frame).
  on(event, listener) {
    if (event !== "frame") return this.store.on(event, listener);
    (this.frameListeners ??= new Set()).add(listener);
    return () => this.frameListeners.delete(listener);
  }

  get state() {
    return { ...this.store.state };
  }

  // Joints of a figure as they are drawn now, Float32Array [F * J * 3].
  joints(id) {
    return this.figures.figures.find((figure) => figure.block.id === id)?.joints;
  }
}

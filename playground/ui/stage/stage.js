// One mounted stage: its parts, its states, what is drawn when, and what others may call.

import { createCamera } from "./camera.js";
import { readTheme } from "./colour.js";
import { decodePayload } from "./decode.js";
import { el } from "./dom.js";
import { Figures } from "./figures.js";
import { addGestures } from "./gestures.js";
import { listenToKeys } from "./keys.js";
import { Notices } from "./notices.js";
import { describeCell } from "./rows.js";
import { GUTTER, MARGIN, Score } from "./score.js";
import { COMMITS, createStore, locate } from "./store.js";
import { Timeline } from "./timeline.js";
import { Toolbar } from "./toolbar.js";

const UNREADABLE = "This result cannot be shown: it is not readable.";
const SLOW = 0.036; // seconds a frame: where drawing takes longer, the figures get one pixel a CSS pixel

export class Stage {
  constructor(element, options) {
    this.options = { height: 320, ...options };
    this.store = createStore();
    this.camera = createCamera();
    this.data = null;
    this.dirty = { layout: true, theme: true, still: true, cells: true, figures: true };
    this.calm = matchMedia("(prefers-reduced-motion: reduce)");
    this.build(element);
    this.listen();
  }

  build(host) {
    const canvas = el("canvas", { class: "ms-canvas", role: "img", "aria-label": "No motion yet" });
    const labels = el("div", { class: "ms-labels" });
    const { badge, notice, progress, error, spoken } = (this.notices = new Notices(this.options.empty));
    this.picture = el("div", { class: "ms-picture" }, canvas, labels, notice, progress);
    this.picture.style.height = `${this.options.height}px`;
    this.figures = new Figures(canvas, labels, this.store, this.camera);
    this.toolbar = new Toolbar(this.store, { onReset: () => this.resetView() });
    this.toolbar.element.append(badge); // in a corner of the picture, or among the controls on a phone
    this.timeline = new Timeline(this.store, () => this.data);
    this.score = new Score(this.store, { onView: (view) => this.setView(view) });
    this.scorePart = el("div", { class: "ms-score ms" }, this.timeline.element, this.score.element);
    this.element = el(
      "section",
      { class: "ms is-empty", tabindex: "0", "aria-label": "Stage: figures and tokens. Space plays, arrows step." },
      this.picture, this.toolbar.element, error, this.scorePart, spoken,
    );
    host.replaceChildren(this.element);
    addGestures(canvas, this.camera, { onMove: () => this.redraw("figures"), onReset: () => this.resetView() });
  }

  listen() {
    const { store } = this;
    this.forget = [
      store.on("change", (changed) => this.changed(changed)),
      ...COMMITS.map((event) => store.on(event, (detail) => this.options.onEvent?.(event, detail))),
      listenToKeys({
        element: this.element, store, camera: this.camera,
        owns: (node) => this.element.contains(node) || this.scorePart.contains(node),
        getData: () => this.data,
        onCamera: () => this.redraw("figures"),
      }),
    ];
    this.watchSize = new ResizeObserver(() => this.redraw("layout"));
    for (const part of [this.picture, this.scorePart]) this.watchSize.observe(part);
    this.watchTheme = new MutationObserver(() => this.redraw("theme"));
    for (const node of [document.documentElement, document.body]) {
      this.watchTheme.observe(node, { attributes: true, attributeFilter: ["class", "data-theme"] });
    }
    this.onScreen = () => this.redraw("theme", "layout");
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", this.onScreen);
    window.addEventListener("resize", this.onScreen); // also fires when the pixel ratio changes
  }

  // payload: object, JSON text, or null for the empty state. A message payload keeps the last result.
  setPayload(payload) {
    try {
      const parsed = typeof payload === "string" && payload ? JSON.parse(payload) : payload;
      if (parsed?.state === "empty") return this.clear(parsed.message);
      if (parsed?.state) return this.say(parsed.state, parsed.message);
      this.data = parsed ? decodePayload(parsed) : null;
    } catch (error) {
      return this.say("error", error instanceof SyntaxError ? UNREADABLE : error.message);
    }
    if (!this.data) return this.clear();
    this.say("ready");
    this.show(this.data);
  }

  clear(text = "") {
    this.data = null;
    this.store.set({ playing: false, selection: null, span: null, hover: null });
    this.figures.clear();
    this.toolbar.fitTo(null);
    this.notices.showBadge(null);
    this.say("empty", text);
    this.redraw("layout");
  }

  show(data) {
    const first = !this.scene;
    const scene = [data.frames, ...data.figures.map((figure) => figure.id)].join();
    const patch = { frames: data.frames, fps: data.fps, hover: null };
    if (data.features) patch.guidance = data.features.guidance;
    // The same scene told again (a re-decode, one more scale) goes on where it was; another one starts anew.
    if (scene !== this.scene) Object.assign(patch, { frame: 0, selection: null, span: null });
    this.scene = scene;
    this.store.set(patch);
    this.figures.setData(data);
    this.score.setData(data);
    this.toolbar.fitTo(data);
    this.toolbar.show();
    this.notices.showBadge(data.badge);
    this.redraw("layout", "theme");
    if (first && (this.options.autoplay ?? true) && !this.calm.matches) this.store.set({ playing: true });
  }

  // "loading" and "error" keep the last result; "empty" and "ready" end both.
  say(state, text = "") {
    for (const { classList } of [this.element, this.scorePart]) {
      classList.toggle("is-loading", state === "loading");
      classList.toggle("is-empty", !this.data);
    }
    this.element.setAttribute("aria-busy", String(state === "loading"));
    this.notices.say(state, text, Boolean(this.data));
  }

  changed(changed) {
    const has = (...keys) => keys.some((key) => changed.has(key));
    if (has("guidance") && this.data) this.figures.setGuidance(this.store.state.guidance);
    if (has("selection")) this.speak();
    if (has("layout", "follow")) this.redraw("layout");
    if (has("scale", "scaleMode")) this.redraw("still");
    if (has("hover", "span", "selection")) this.redraw("cells", "figures");
    if (has("frame", "playing", "guidance", "trail", "ghost")) this.redraw("figures");
    this.toolbar.show(changed);
  }

  speak() {
    const cell = this.data && locate(this.data.tracks, this.store.state.selection);
    this.notices.speak(cell ? describeCell(this.data.tracks, cell, this.data.fps).flat().join(", ") : "");
  }

  redraw(...what) {
    for (const part of what) this.dirty[part] = true;
    this.pending ??= requestAnimationFrame((now) => this.tick(now));
  }

  tick(now) {
    this.pending = null;
    if (!this.element.isConnected) return;
    const { store, dirty } = this;
    if (!this.picture.clientWidth && !this.scorePart.clientWidth) return void (this.last = null); // a hidden tab rests
    if (store.state.playing && this.last) this.advance((now - this.last) / 1000);
    this.last = store.state.playing ? now : null;
    if (dirty.theme) this.dress();
    if (dirty.layout) this.layOut();
    if (dirty.still) this.score.drawStill();
    if (dirty.cells) this.drawCells();
    if (dirty.figures) this.drawFigures();
    Object.keys(dirty).forEach((part) => (dirty[part] = false));
    if (store.state.playing) this.redraw("figures");
  }

  advance(passed) {
    this.store.advance(Math.min(0.1, passed));
    this.pace = 0.92 * (this.pace ?? 0) + 0.08 * Math.min(0.1, passed);
    if (this.pace > SLOW && !this.coarse && window.devicePixelRatio > 1) {
      this.coarse = true;
      this.dirty.layout = true;
    }
  }

  drawCells() {
    this.score.drawCells();
    this.timeline.draw();
  }

  drawFigures() {
    this.figures.draw();
    this.timeline.move();
    this.score.move();
    this.toolbar.showReset(!this.camera.isHome());
    if (this.store.state.playing) this.score.reveal();
    for (const listener of this.frameListeners || []) listener(this.store.state.frame);
  }

  dress() {
    const theme = readTheme(this.element);
    this.figures.dress(theme);
    this.timeline.theme = theme;
    this.score.dress(theme);
    Object.assign(this.dirty, { still: true, cells: true, figures: true });
  }

  layOut() {
    const ratio = window.devicePixelRatio || 1;
    const wide = this.scorePart.clientWidth, tracks = this.data && this.data.tracks.length > 0;
    if (this.data) this.score.resize(wide, ratio);
    this.timeline.resize(wide, tracks ? GUTTER : 10, MARGIN, ratio);
    this.figures.resize(this.picture.clientWidth, this.picture.clientHeight, this.coarse ? 1 : ratio);
    if (this.data) this.figures.fit();
    Object.assign(this.dirty, { still: true, cells: true, figures: true });
  }

  resetView() {
    this.camera.reset();
    this.redraw("layout");
  }

  setView(view) {
    this.timeline.view = view;
    this.redraw("cells");
  }

  moveScore(element) {
    element.replaceChildren(this.scorePart);
    this.redraw("layout");
  }

  // The rest of what others may call; setPayload and say belong to it too.
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
    this.timeline.spanMode = Boolean(on);
  }

  // event: "select", "span", "scale" (on commit), "change" (any value of the state), "frame" (each drawn frame).
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

  destroy() {
    this.forget.forEach((forget) => forget());
    this.watchSize.disconnect();
    this.watchTheme.disconnect();
    window.removeEventListener("resize", this.onScreen);
    matchMedia("(prefers-color-scheme: dark)").removeEventListener("change", this.onScreen);
    cancelAnimationFrame(this.pending);
    this.element.remove();
    this.scorePart.remove();
  }
}

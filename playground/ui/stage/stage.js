// One mounted stage: its parts, its states, and what is drawn when. What others may call is in remote.js.

import { createCamera } from "./camera.js";
import { readTheme } from "./colour.js";
import { decodePayload } from "./decode.js";
import { el } from "./dom.js";
import { Figures } from "./figures.js";
import { addGestures } from "./gestures.js";
import { Hunger, joined, shifted } from "./growth.js";
import { listenToKeys } from "./keys.js";
import { watchState } from "./links.js";
import { Notices } from "./notices.js";
import { Pace } from "./pace.js";
import { Remote } from "./remote.js";
import { Ribbon } from "./ribbon.js";
import { describeCell } from "./rows.js";
import { MARGIN, Score } from "./score.js";
import { COMMITS, createStore, locate } from "./store.js";
import { watchSurroundings } from "./surroundings.js";
import { Timeline } from "./timeline.js";
import { Toolbar } from "./toolbar.js";

const UNREADABLE = "This result cannot be shown: it is not readable.";
const PHONE = 520; // CSS pixels: in a narrower picture two rows of figures get more height
const ONE_LINE = 660; // CSS pixels that all controls with the frame's number need in one line
const TALLER = 1.4;

export class Stage extends Remote {
  constructor(element, options) {
    super();
    this.options = { height: 320, ...options };
    this.store = createStore();
    this.camera = createCamera();
    this.data = null;
    this.pace = new Pace();
    this.hunger = new Hunger();
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
    this.ribbon = new Ribbon(this.store);
    const score = [this.timeline.element, this.ribbon.element, this.score.element];
    this.scorePart = el("div", { class: "ms-score ms" }, ...score);
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
    this.forget.push(
      watchSurroundings([this.picture, this.scorePart], {
        onSize: () => this.redraw("layout"),
        onTheme: () => this.redraw("theme"),
      }),
      watchState(store, () => Boolean(this.timeline.drag), (state) => this.tellState(state)),
    );
  }

  tellState(state) {
    this.store.emit("state", state);
    const detail = { name: this.options.name, state };
    this.element.dispatchEvent(new CustomEvent("motion-stage-state", { bubbles: true, detail }));
  }

  // payload: object, JSON text, or null for the empty state. A message payload keeps the last result, and a piece of a
  // motion that grows joins it where it follows.
  setPayload(payload) {
    let patch = null;
    try {
      const parsed = typeof payload === "string" && payload ? JSON.parse(payload) : payload;
      if (parsed?.state === "empty") return this.clear(parsed.message);
      if (parsed?.state) return this.say(parsed.state, parsed.message);
      const before = this.data, found = parsed ? decodePayload(parsed) : null;
      if (found?.growing && before && !before.growing && before.scene === found.scene) return; // it has been ended
      const { data, dropped } = found?.growing ? joined(before, found) : { data: found, dropped: null };
      if (dropped !== null) patch = shifted(this.store.state, before.tracks, dropped);
      this.data = data;
    } catch (error) {
      return this.say("error", error instanceof SyntaxError ? UNREADABLE : error.message);
    }
    if (!this.data) return this.clear();
    this.say("ready");
    this.show(this.data, patch);
  }

  clear(text = "") {
    this.data = null;
    this.store.set({ playing: false, until: null, selection: null, span: null, hover: null, probe: null });
    this.figures.clear();
    this.ribbon.element.hidden = true;
    this.toolbar.fitTo(null);
    this.notices.showBadge(null);
    this.say("empty", text);
    this.redraw("layout");
  }

  // moved: what clock and selection become where the data has moved on, else null.
  show(data, moved = null) {
    const first = !this.scene;
    const scene = data.scene ?? [data.frames, ...data.figures.map((figure) => figure.id)].join();
    const { frames, fps, origin } = data, until = data.growing ? data.growing.made : null;
    const patch = { frames, fps, origin, until, hover: null, probe: null, ...moved };
    this.hunger.fed();
    if (data.features) patch.guidance = data.features.guidance;
    // The same scene told again (a re-decode, one more scale) goes on where it was; another one starts anew.
    if (scene !== this.scene || (data.growing && !moved)) Object.assign(patch, { frame: 0, selection: null, span: null });
    this.scene = scene;
    this.store.set(patch);
    const wish = data.growing ? null : this.wished || this.options.wish?.();
    if (wish) this.setState(wish);
    this.figures.setData(data);
    this.score.setData(data);
    this.ribbon.setData(data);
    this.toolbar.fitTo(data);
    this.toolbar.show();
    this.notices.showBadge(data.badge);
    this.redraw("layout", "theme");
    const plays = (this.options.autoplay ?? true) && !this.calm.matches && wish?.frame === undefined;
    const begins = data.growing && !moved;
    if ((first || begins) && plays || (begins && data.growing.play)) this.store.set({ playing: true });
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
    if (has("playing") && !this.store.state.playing && this.pace.step) this.drawWhole();
    if (has("scale", "scaleMode")) this.redraw("still");
    if (has("hover", "span", "selection", "probe", "peek")) this.redraw("cells", "figures");
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
    const have = this.hunger.watch(this.store.state, this.data?.growing, performance.now());
    if (have !== null) this.options.onEvent?.("hungry", { have });
    if (this.pace.watch(passed)) this.dirty.layout = true;
  }

  // A picture that stands still is drawn with all it has.
  drawWhole() {
    this.pace.restart();
    this.redraw("layout");
  }

  drawCells() {
    this.score.drawCells();
    this.timeline.draw();
  }

  drawFigures() {
    this.figures.draw();
    this.timeline.move();
    this.score.move();
    this.ribbon.move();
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
    const ratio = window.devicePixelRatio || 1, { figures, picture, options } = this;
    const wide = this.scorePart.clientWidth, scored = this.data && !this.score.element.hidden;
    if (this.data) this.score.resize(wide, ratio);
    const left = scored ? this.score.gutterWidth : 10;
    this.timeline.resize(wide, left, MARGIN, ratio);
    this.ribbon.resize(left, MARGIN);
    const crowd = picture.clientWidth < PHONE && figures.plan(picture.clientWidth, options.height).rows > 1;
    picture.style.height = `${Math.round(options.height * (crowd ? TALLER : 1))}px`;
    this.toolbar.element.classList.toggle("is-narrow", picture.clientWidth < ONE_LINE);
    figures.plain = this.pace.plain;
    figures.resize(picture.clientWidth, picture.clientHeight, this.pace.ratio(ratio));
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

  destroy() {
    this.forget.forEach((forget) => forget());
    cancelAnimationFrame(this.pending);
    this.element.remove();
    this.scorePart.remove();
  }
}

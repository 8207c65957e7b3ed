// The row of controls under the figures: step, play, speed, loop, follow, trail, ghost, lanes, view.

import { el, icon, seconds } from "./dom.js";

const SPEEDS = [0.5, 1, 2];
const TOGGLES = {
  loop: ["Loop", "Start again at the end (L)"],
  follow: ["Follow", "The camera goes with the figure (F)"],
  trail: ["Trail", "Show the way over the floor and the footprints (T)"],
  ghost: ["Ghost", "Show the original faintly behind each reconstruction (G)"],
};

export class Toolbar {
  constructor(store, { onReset }) {
    const { state } = store;
    this.store = store;
    const step = (by) => () => {
      store.set({ playing: false });
      store.seek(Math.round(state.frame) + by);
    };
    this.play = button("", "Play", () => togglePlay(store), "ms-play");
    const back = button("", "One frame back (←)", step(-1)), next = button("", "One frame on (→)", step(1));
    back.append(icon("back"));
    next.append(icon("next"));
    this.now = el("span", { class: "ms-now" });
    this.total = el("span", { class: "ms-total" });
    this.count = el("span", { class: "ms-total ms-count", title: "Frame of the motion" });
    this.speeds = SPEEDS.map((speed) =>
      button(`${speed}×`, `Play at ${speed} times the speed`, () => store.set({ speed })));
    this.toggles = Object.fromEntries(Object.entries(TOGGLES).map(([key, [text, title]]) =>
      [key, button(text, title, () => store.set({ [key]: !state[key] }))]));
    this.overlay = button("Overlay", "Put all figures on one spot (O)", () => toggleLayout(store));
    this.reset = button("Reset view", "Camera back to its place (R)", onReset);
    this.element = el(
      "div", { class: "ms-toolbar", role: "group", "aria-label": "Playback" },
      el("div", { class: "ms-group" }, back, this.play, next),
      el("div", { class: "ms-time" }, this.now, this.total, " ", this.count),
      el("div", { class: "ms-group", role: "group", "aria-label": "Speed" }, ...this.speeds),
      el("div", { class: "ms-group ms-toggles" }, ...Object.values(this.toggles), this.overlay, this.reset),
    );
    this.show();
    this.showReset(false);
    this.fitTo(null);
  }

  // changed: set of the state's keys that changed, or null for all.
  show(changed = null) {
    const { state } = this.store;
    const has = (...keys) => !changed || keys.some((key) => changed.has(key));
    if (has("playing")) {
      this.play.replaceChildren(icon(state.playing ? "pause" : "play"));
      this.play.setAttribute("aria-label", state.playing ? "Pause" : "Play");
      this.play.title = state.playing ? "Pause (space)" : "Play (space)";
    }
    if (has("speed")) this.speeds.forEach((node, i) => press(node, SPEEDS[i] === state.speed));
    if (has("layout")) press(this.overlay, state.layout === "overlay");
    for (const [key, node] of Object.entries(this.toggles)) if (has(key)) press(node, state[key]);
    if (has("frame", "frames", "fps", "until", "origin")) {
      const now = state.origin + Math.floor(state.frame + 1e-6);
      this.now.textContent = seconds(now, state.fps);
      this.total.textContent = ` / ${seconds(state.origin + (state.until ?? state.frames), state.fps)} s`;
      this.count.textContent = `frame ${now}`;
    }
  }

  showReset(on) {
    this.reset.hidden = !on;
  }

  // Controls without a meaning for this payload are not there.
  fitTo(data) {
    this.toggles.ghost.hidden = !data || !data.figures.some((figure) => figure.ghost_of);
    this.toggles.loop.hidden = Boolean(data?.growing);
    this.overlay.hidden = !data || data.figures.length < 2;
    for (const node of this.element.querySelectorAll("button")) node.disabled = !data;
  }
}

function button(text, title, onClick, extra = "") {
  const label = text ? null : title;
  const node = el("button", { type: "button", class: `ms-button ${extra}`, text, title, "aria-label": label });
  node.addEventListener("click", onClick);
  return node;
}

function press(node, on) {
  node.setAttribute("aria-pressed", String(Boolean(on)));
}

export function togglePlay(store) {
  const { state } = store;
  if (!state.playing && !state.loop && state.until === null && state.frame >= state.frames - 1) store.seek(0);
  store.set({ playing: !state.playing });
}

export function toggleLayout(store) {
  store.set({ layout: store.state.layout === "overlay" ? "lanes" : "overlay" });
}

// The row of controls under the figures: step, play, speed, loop, follow, trail, ghost, lanes, view.

import { el, icon, seconds } from "./dom.js";

const SPEEDS = [0.5, 1, 2];

export function createToolbar(store, { onReset }) {
  const { state } = store;
  const step = (by) => () => store.set({ playing: false }) || store.seek(Math.round(state.frame) + by);
  const play = el("button", { type: "button", class: "ms-button ms-play" });
  const back = el("button", { type: "button", class: "ms-button", "aria-label": "One frame back", title: "One frame back (←)" }, icon("back"));
  const next = el("button", { type: "button", class: "ms-button", "aria-label": "One frame on", title: "One frame on (→)" }, icon("next"));
  const now = el("span", { class: "ms-now" });
  const total = el("span", { class: "ms-total" });
  play.addEventListener("click", () => togglePlay(store));
  back.addEventListener("click", step(-1));
  next.addEventListener("click", step(1));

  const speeds = SPEEDS.map((speed) => {
    const button = el("button", { type: "button", class: "ms-button ms-text", text: `${speed}×`, title: `Play at ${speed} times the speed` });
    button.addEventListener("click", () => store.set({ speed }));
    return button;
  });
  const toggles = {
    loop: toggle("Loop", "Start again at the end (L)"),
    follow: toggle("Follow", "The camera goes with the figure (F)"),
    trail: toggle("Trail", "Show the way over the floor and the footprints (T)"),
    ghost: toggle("Ghost", "Show the original faintly behind each reconstruction (G)"),
  };
  for (const [key, button] of Object.entries(toggles)) button.addEventListener("click", () => store.set({ [key]: !state[key] }));
  const overlay = toggle("Overlay", "Put all figures on one spot (O)");
  overlay.addEventListener("click", () => toggleLayout(store));
  const reset = el("button", { type: "button", class: "ms-button ms-text", text: "Reset view", title: "Camera back to its place (R)" });
  reset.addEventListener("click", onReset);

  const element = el(
    "div", { class: "ms-toolbar", role: "toolbar", "aria-label": "Playback" },
    el("div", { class: "ms-group" }, back, play, next),
    el("div", { class: "ms-time" }, now, total),
    el("div", { class: "ms-group ms-segment", role: "group", "aria-label": "Speed" }, ...speeds),
    el("div", { class: "ms-group ms-toggles" }, ...Object.values(toggles), overlay, reset),
  );

  function show(changed = null) {
    const has = (...keys) => !changed || keys.some((key) => changed.has(key));
    if (has("playing")) {
      play.replaceChildren(icon(state.playing ? "pause" : "play"));
      play.setAttribute("aria-label", state.playing ? "Pause" : "Play");
      play.title = state.playing ? "Pause (space)" : "Play (space)";
    }
    if (has("speed")) speeds.forEach((button, i) => button.setAttribute("aria-pressed", String(SPEEDS[i] === state.speed)));
    if (has("loop", "follow", "trail", "ghost", "layout")) {
      for (const [key, button] of Object.entries(toggles)) button.setAttribute("aria-pressed", String(state[key]));
      overlay.setAttribute("aria-pressed", String(state.layout === "overlay"));
    }
    if (has("frame", "frames", "fps")) {
      now.textContent = `${seconds(Math.floor(state.frame + 1e-6), state.fps)} s`;
      total.textContent = ` / ${seconds(state.frames, state.fps)} s`;
    }
  }

  // Controls without a meaning for this payload are not there.
  function fitTo(data) {
    toggles.ghost.hidden = !data || !data.figures.some((figure) => figure.ghost_of);
    overlay.hidden = !data || data.figures.length < 2;
    element.classList.toggle("is-off", !data);
    for (const button of element.querySelectorAll("button")) button.disabled = !data;
  }

  show();
  fitTo(null);
  return { element, show, fitTo };
}

function toggle(text, title) {
  return el("button", { type: "button", class: "ms-button ms-text", text, title, "aria-pressed": "false" });
}

export function togglePlay(store) {
  const { state } = store;
  if (!state.playing && !state.loop && state.frame >= state.frames - 1) store.seek(0);
  store.set({ playing: !state.playing });
}

export function toggleLayout(store) {
  store.set({ layout: store.state.layout === "overlay" ? "lanes" : "overlay" });
}

// The stage: figures, score and clock as one component. Way in: mount(element, payload, options).

import { Stage } from "./stage.js";

const mounted = new Map(); // name -> api
const slots = new Map(); // name -> element that shows the score of that stage
const wishes = new Map(); // name -> state that a link asked for

// options: {name, onEvent(event, detail), height, empty, autoplay}
export function mount(element, payload = null, options = {}) {
  const stage = new Stage(element, { ...options, wish: () => wishes.get(options.name) });
  if (options.name) {
    mounted.get(options.name)?.destroy();
    mounted.set(options.name, stage);
    if (slots.has(options.name)) stage.moveScore(slots.get(options.name));
  }
  stage.setPayload(payload);
  return stage;
}

// The mounted stage of that name, or undefined.
export function get(name) {
  return mounted.get(name);
}

// Puts a stage into the state that a link holds (getState's keys, or some), now or as soon as it is there, and again at
// each new result, until the visitor does something.
export function restore(name, wish) {
  if (!wishes.size) {
    for (const type of ["pointerdown", "keydown"]) {
      document.addEventListener(type, () => wishes.clear(), { capture: true, once: true });
    }
  }
  wishes.set(name, wish);
  mounted.get(name)?.setState(wish);
}

// Shows the score of the stage `name` in another element, now or as soon as that stage is there.
export function adoptScore(name, element) {
  slots.set(name, element);
  mounted.get(name)?.moveScore(element);
}

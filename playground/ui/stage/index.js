// The stage: figures, score and clock as one component. Way in: mount(element, payload, options).

import { Stage } from "./stage.js";

const mounted = new Map(); // name -> api
const slots = new Map(); // name -> element that shows the score of that stage

// options: {name, onEvent(event, detail), height, empty, autoplay}
export function mount(element, payload = null, options = {}) {
  const stage = new Stage(element, options);
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

// Shows the score of the stage `name` in another element, now or as soon as that stage is there.
export function adoptScore(name, element) {
  slots.set(name, element);
  mounted.get(name)?.moveScore(element);
}

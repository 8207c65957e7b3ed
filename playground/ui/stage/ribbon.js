// A line of words between time axis and score: what was asked for, and which seconds followed it.

import { el, seconds } from "./dom.js";

export class Ribbon {
  constructor(store) {
    this.store = store;
    this.parts = [];
    this.element = el("ol", { class: "ms-ribbon", "aria-label": "Instructions over time", hidden: true });
  }

  // data.ribbon: [[first frame, words]...] on the clock that runs on; each holds until the next one begins.
  setData({ ribbon, origin, frames, growing, fps }) {
    const end = origin + (growing ? growing.made : frames);
    const parts = ribbon.map(([from, text], i) => [Math.max(from, origin), Math.min(end, ribbon[i + 1]?.[0] ?? end), text]);
    this.parts = parts.filter(([from, to]) => to > from);
    this.element.hidden = !this.parts.length;
    this.element.replaceChildren(...this.parts.map(([from, to, text]) => el("li", {
      text, title: `${seconds(from, fps)} to ${seconds(to, fps)} s: ${text}`,
      style: `left:${(100 * (from - origin)) / frames}%;width:${(100 * (to - from)) / frames}%`,
    })));
    this.origin = origin;
    this.move();
  }

  resize(left, right) {
    this.element.style.margin = `0 ${right}px 0 ${left}px`;
  }

  move() {
    const now = this.store.state.frame + this.origin;
    this.parts.forEach(([from, to], i) => this.element.children[i].classList.toggle("is-now", now >= from && now < to));
  }
}

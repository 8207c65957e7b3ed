// Names and small captions under the figures, as text of the page; and the picture's own text alternative.

import { el } from "./dom.js";

const TIGHT = 124; // pixels a name: with less, names are written smaller

export class Labels {
  constructor(element, canvas) {
    Object.assign(this, { element, canvas, nodes: [], places: [] });
  }

  clear() {
    this.element.replaceChildren();
    this.nodes = [];
    this.canvas.setAttribute("aria-label", "No motion yet");
  }

  write(data) {
    this.nodes = data.figures.map(({ name, caption = "" }) =>
      el("div", { class: "ms-label" }, el("strong", { text: name }), el("span", { text: caption })));
    this.places = [];
    this.element.replaceChildren(...this.nodes);
    const told = data.figures.map(({ name, caption }) => (caption ? `${name} (${caption})` : name));
    const count = told.length === 1 ? "One figure" : `${told.length} figures in sync`;
    const length = (data.frames / data.fps).toFixed(1);
    this.canvas.setAttribute("aria-label", `${count}: ${told.join(", ")}. ${length} seconds.`);
  }

  dress(colors) {
    this.nodes.forEach((node, index) => node.style.setProperty("--system", colors[index]));
  }

  // spots: [x, y] of the middle of each label's upper edge, `across` of them in a row; room: pixels a lane has at most.
  place(spots, room, across) {
    const gaps = spots.slice(1).map(([x, y], index) => (spots[index][1] === y ? Math.abs(x - spots[index][0]) : room));
    const least = Math.round(Math.min(room, across > 1 ? Math.min(...gaps) : room));
    this.element.classList.toggle("is-tight", least < TIGHT);
    spots.forEach(([x, y], index) => {
      const place = `translate(${Math.round(x)}px, ${Math.round(y)}px) translateX(-50%)`;
      if (this.places[index] === place + least) return;
      this.places[index] = place + least;
      Object.assign(this.nodes[index].style, { transform: place, maxWidth: `${Math.max(least - 3, 52)}px` });
    });
  }
}

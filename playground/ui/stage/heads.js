// Words over and under the score: a line over each track and each heat map, and the key to what cells may wear.

import { el } from "./dom.js";
import { told } from "./rows.js";

export function trackHead(track, y) {
  const scales = track.levels.length, there = track.levels.filter((level) => level.ids);
  const tokens = there.reduce((sum, level) => sum + level.size, 0);
  const so = there.length < scales ? `${there.length} of ${scales}` : scales;
  const node = el(
    "div", { class: "ms-head", style: `top:${y}px` },
    el("i", { class: "ms-swatch" }),
    el("strong", { text: track.name }),
    el("span", { text: `${tokens} tokens in ${so} ${scales === 1 ? "scale" : "scales"}` }),
  );
  if (track.note) node.append(el("span", { class: "ms-note", text: track.note, tabindex: "0" }));
  return node;
}

export function stripHead(strip, y) {
  return el(
    "div", { class: "ms-head", style: `top:${y}px` },
    el("strong", { text: strip.name }),
    el(
      "span", { class: "ms-ramp", role: "img", "aria-label": `Colours from 0 to ${told(strip.max)} ${strip.unit}` },
      el("span", { text: "0" }), el("i", {}), el("span", { text: `${told(strip.max)} ${strip.unit}`.trim() }),
    ),
  );
}

// The key: only what is really to be seen in this score. Empty where there is nothing to explain.
export function keyLines(data) {
  const levels = data.tracks.flatMap((track) => track.levels), lines = [];
  if (levels.some((level) => level.entropy)) {
    lines.push(el(
      "span", { title: "Entropy of each token's distribution, as a share of the most that its codebook allows" },
      "sure", el("i", { class: "ms-key-doubt" }), "unsure (fainter: higher entropy)",
    ));
  }
  for (const track of data.tracks.filter(({ levels }) => levels.some((level) => level.marks))) {
    const marked = track.levels.filter((level) => level.marks);
    const all = marked.reduce((sum, level) => sum + level.size, 0);
    const marks = marked.reduce((sum, level) => sum + level.marks.reduce((count, mark) => count + mark, 0), 0);
    const whose = data.tracks.length > 1 ? `${track.name}: ` : "";
    lines.push(el(
      "span", {}, el("i", { class: "ms-key-mark" }), `${whose}${track.marked || "changed"}, ${marks} of ${all} tokens`,
    ));
  }
  if (data.hatch.length) lines.push(el("span", {}, el("i", { class: "ms-key-hatch" }), data.hatched));
  return lines;
}

export function summary(data) {
  const told = data.tracks.map((track) => `${track.name}: ${track.levels.map((level) => level.size).join(", ")}`);
  return `Tokens over time, coarse scales on top. ${told.join(". ")}. Arrow keys move, Enter chooses.`;
}

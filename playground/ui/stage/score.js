// The score: a piano roll of tokens. One canvas holds what stands still, one over it what moves.

import { css, mix, textOn } from "./colour.js";
import { clear, el, sizeCanvas } from "./dom.js";
import { cellAt, cellEdges, describeCell, fillCell, isUsed, layRows } from "./rows.js";
import { spanOf, tokenAt } from "./store.js";

export const GUTTER = 36;
export const MARGIN = 14;
const NARROWEST = 680; // the roll is at least this wide; a narrower screen scrolls it sideways

export function createScore(store, { onView }) {
  const { state } = store;
  const gutter = el("canvas", { class: "ms-gutter", "aria-hidden": "true" });
  const still = el("canvas", { class: "ms-still", role: "img", "aria-label": "Tokens" });
  const moving = el("canvas", { class: "ms-moving", "aria-hidden": "true" });
  const roll = el("div", { class: "ms-roll" }, still, moving);
  const scroller = el("div", { class: "ms-scroll", role: "group", "aria-label": "Token score", tabindex: "-1" }, roll);
  const heads = el("div", { class: "ms-heads" });
  const tip = el("div", { class: "ms-tip", role: "tooltip", hidden: true });
  const element = el("div", { class: "ms-tracks", hidden: true }, gutter, scroller, heads, tip);
  let data = null, laid = layRows([]), width = 0, ratio = 1, theme = null;

  function setData(next) {
    data = next;
    laid = layRows(data.tracks);
    element.hidden = !data.tracks.length;
    still.setAttribute("aria-label", summary(data.tracks));
    heads.replaceChildren(...data.tracks.map((track, index) => head(track, laid.heads[index].y)));
  }

  function head(track, y) {
    const tokens = track.levels.reduce((sum, level) => sum + (level.ids ? level.size : 0), 0);
    const scales = track.levels.length;
    const node = el("div", { class: "ms-head" });
    node.append(el("i", { class: "ms-swatch" }), el("strong", { text: track.name }));
    node.append(el("span", { text: `${tokens} tokens in ${scales} ${scales === 1 ? "scale" : "scales"}` }));
    if (track.levels.some((level) => level.entropy)) node.append(el("span", { text: "faint = unsure" }));
    if (track.note) node.append(el("span", { class: "ms-note", text: track.note, title: track.note }));
    node.style.top = `${y}px`;
    return node;
  }

  function resize(full, pixelRatio) {
    ratio = pixelRatio;
    const room = full - GUTTER;
    width = Math.max(room - MARGIN, Math.min(NARROWEST, longest() * 13));
    roll.style.width = `${Math.max(width + MARGIN, room)}px`;
    roll.style.height = `${laid.height}px`;
    sizeCanvas(gutter, GUTTER, laid.height, ratio);
    for (const canvas of [still, moving]) sizeCanvas(canvas, width + MARGIN, laid.height, ratio);
    tellView();
  }

  const longest = () => (data ? Math.max(1, ...data.tracks.flatMap((track) => track.levels.map((level) => level.size))) : 1);

  // The part of the time that is in sight when the roll is wider than the screen.
  function tellView() {
    const seen = scroller.clientWidth;
    if (!data || seen >= roll.clientWidth - 1) return onView(null);
    const frames = (pixels) => Math.min(Math.max((pixels / width) * data.frames, 0), data.frames);
    onView([frames(scroller.scrollLeft), frames(scroller.scrollLeft + seen)]);
  }

  function drawStill() {
    if (!data || !theme || !data.tracks.length || width < 2) return;
    const ctx = clear(still, ratio), side = clear(gutter, ratio);
    data.tracks.forEach((track, index) => {
      heads.children[index].style.setProperty("--system", theme.dark ? track.dark_color : track.color);
    });
    for (const row of laid.rows) {
      drawRow(ctx, row);
      const chosen = state.scale === row.level + 1;
      side.font = `${chosen ? "600 " : ""}11px ${theme.font}`;
      side.fillStyle = css(chosen ? theme.text : theme.muted);
      side.textAlign = "right";
      side.textBaseline = "middle";
      side.fillText(String(row.level + 1), GUTTER - 8, row.y + row.height / 2 + 0.5);
    }
  }

  function drawRow(ctx, row) {
    const track = data.tracks[row.track], level = track.levels[row.level];
    const used = isUsed(row.level, state.scale, state.scaleMode);
    ctx.font = `10px ${theme.font}`;
    ctx.textAlign = "center";
    ctx.textBaseline = "middle";
    for (let p = 0; p < level.size; p++) {
      const [from, to] = cellEdges(track, row.level, p, data.frames, width);
      const gap = to - from > 5 ? 1 : to - from > 2 ? 0.5 : 0;
      const box = [from, row.y + 0.5, to - from - gap, row.height - 1];
      if (!level.ids) {
        ctx.strokeStyle = css(theme.line);
        ctx.strokeRect(box[0] + 0.5, box[1] + 0.5, box[2] - 1, box[3] - 1);
        continue;
      }
      const rgb = cellColour(level, row.level, p);
      ctx.globalAlpha = used ? 1 : state.scaleMode === "focus" ? 0.38 : 0.16;
      ctx.fillStyle = css(rgb);
      fillCell(ctx, box);
      const text = String(level.ids[p]);
      if (box[2] > 6.2 * text.length + 3 && row.height >= 12) {
        ctx.fillStyle = css(textOn(rgb), 0.88);
        ctx.fillText(text, (from + to - gap) / 2, row.y + row.height / 2 + 0.5);
      }
    }
    ctx.globalAlpha = 1;
  }

  // The code's colour, paler the less sure the generator was.
  function cellColour(level, index, position) {
    const rgb = [0, 1, 2].map((i) => level.rgb[3 * position + i]);
    if (!level.entropy) return rgb;
    const doubt = Math.min(1, level.entropy[position] / Math.log(Math.max(2, level.codes)));
    return mix(rgb, theme.surface, 0.85 * doubt);
  }

  function drawMoving() {
    if (!data || !theme || !data.tracks.length || width < 2) return;
    const ctx = clear(moving, ratio);
    const xOf = (frame) => (frame / data.frames) * width;
    if (state.span) band(ctx, state.span, css(theme.focus, 0.14));
    if (state.hover) band(ctx, spanOf(data.tracks[state.hover.track], state.hover.level, state.hover.position), css(theme.text, 0.08));
    for (const row of laid.rows) {
      const track = data.tracks[row.track], p = tokenAt(track, row.level, state.frame);
      if (p >= 0 && track.levels[row.level].ids) glow(ctx, row, p);
    }
    drawSelection(ctx);
    if (state.hover) ring(ctx, state.hover, theme.text, 1.5);
    ctx.fillStyle = css(theme.ink);
    ctx.fillRect(xOf(state.frame) - 0.75, 0, 1.5, laid.height);
  }

  function band(ctx, [from, to], color) {
    ctx.fillStyle = color;
    ctx.fillRect((from / data.frames) * width, 0, ((to - from) / data.frames) * width, laid.height);
  }

  function boxOf({ track, level, position }) {
    const row = laid.rows.find((candidate) => candidate.track === track && candidate.level === level);
    const [from, to] = cellEdges(data.tracks[track], level, position, data.frames, width);
    return [from, row.y, Math.max(2, to - from - 1), row.height];
  }

  function glow(ctx, row, position) {
    const [x, y, w, h] = boxOf({ ...row, position });
    const rgb = cellColour(data.tracks[row.track].levels[row.level], row.level, position);
    ctx.lineWidth = 1.5;
    ctx.strokeStyle = css(theme.ink);
    ctx.fillStyle = css(mix(rgb, [255, 255, 255], 0.35), 0.55);
    ctx.beginPath();
    ctx.roundRect(x - 0.25, y + 0.25, w + 0.5, h - 0.5, 3);
    ctx.stroke();
  }

  function ring(ctx, cell, rgb, line) {
    const [x, y, w, h] = boxOf(cell);
    ctx.strokeStyle = css(rgb);
    ctx.lineWidth = line;
    ctx.beginPath();
    ctx.roundRect(x - 1, y - 0.5, w + 2, h + 1, 3);
    ctx.stroke();
  }

  // The chosen token, and thinly every place where the same code stands in its scale.
  function drawSelection(ctx) {
    const chosen = locate(state.selection);
    if (!chosen) return;
    const level = data.tracks[chosen.track].levels[chosen.level];
    band(ctx, spanOf(data.tracks[chosen.track], chosen.level, chosen.position), css(theme.focus, 0.12));
    for (let p = 0; level.ids && p < level.size; p++) {
      if (p !== chosen.position && level.ids[p] === level.ids[chosen.position]) ring(ctx, { ...chosen, position: p }, theme.focus, 1);
    }
    ring(ctx, chosen, theme.focus, 2.5);
  }

  // {system, scale, position} -> {track, level, position}, or null if this score has no such cell.
  function locate(selection) {
    if (!selection || !data) return null;
    const track = data.tracks.findIndex((candidate) => candidate.system === selection.system);
    const level = selection.scale - 1;
    const row = track >= 0 ? data.tracks[track].levels[level] : null;
    return row && selection.position >= 0 && selection.position < row.size ? { track, level, position: selection.position } : null;
  }

  function under(event) {
    const box = roll.getBoundingClientRect();
    return data && cellAt(data.tracks, laid.rows, event.clientX - box.left, event.clientY - box.top, data.frames, width);
  }

  function showTip(cell, event) {
    tip.hidden = !cell;
    if (!cell) return;
    const lines = describeCell(data.tracks, cell, data.fps);
    tip.replaceChildren(...lines.map(([first, second]) => el("div", {}, el("span", { text: first }), el("span", { text: second }))));
    const box = element.getBoundingClientRect();
    const x = Math.min(Math.max(event.clientX - box.left + 14, 4), Math.max(4, box.width - tip.offsetWidth - 4));
    const y = event.clientY - box.top + 18;
    tip.style.transform = `translate(${x}px, ${y}px)`;
  }

  scroller.addEventListener("scroll", tellView);
  roll.addEventListener("pointermove", (event) => {
    if (event.pointerType === "touch") return;
    const cell = under(event);
    store.set({ hover: cell });
    showTip(cell, event);
  });
  roll.addEventListener("pointerleave", () => {
    store.set({ hover: null });
    showTip(null);
  });
  roll.addEventListener("click", (event) => {
    const cell = under(event);
    if (!cell || !data.tracks[cell.track].levels[cell.level].ids) return;
    const selection = { system: data.tracks[cell.track].system, scale: cell.level + 1, position: cell.position };
    const again = JSON.stringify(locate(state.selection)) === JSON.stringify(cell);
    store.commit("select", { selection: again ? null : selection });
  });

  return {
    element, scroller, setData, resize, drawStill, drawMoving, locate,
    dress: (next) => (theme = next),
    // Keeps the playhead in sight while it plays.
    reveal() {
      const seen = scroller.clientWidth, x = data ? (state.frame / data.frames) * width : 0;
      if (!data || seen >= roll.clientWidth - 1) return;
      if (x < scroller.scrollLeft || x > scroller.scrollLeft + seen - 24) scroller.scrollLeft = x - 24;
    },
  };
}

function summary(tracks) {
  const told = tracks.map((track) => `${track.name}: ${track.levels.map((level) => level.size).join(", ")} tokens`);
  return `Tokens, coarse scales on top. ${told.join(". ")}.`;
}

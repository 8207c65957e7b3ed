// The score: a piano roll of tokens. One canvas holds what stands still, one over it what moves.

import { css, mix, textOn } from "./colour.js";
import { clear, el, sizeCanvas } from "./dom.js";
import { cellAt, cellEdges, describeCell, isUsed, layRows } from "./rows.js";
import { locate, spanOf, tokenAt } from "./store.js";

export const GUTTER = 36; // pixels left of the roll, for the scales' numbers
export const MARGIN = 14; // pixels right of it, so that the playhead's end is seen
const NARROW = 9; // pixels: where the finest cell would be narrower than this,
const WIDER = 13; // it gets this many, and the roll scrolls sideways inside itself
const DIGIT = 6.2; // pixels of one digit of an id

export class Score {
  // onView is told which frames are in sight, [from, to], or null when all are.
  constructor(store, { onView }) {
    Object.assign(this, { store, onView, data: null, laid: layRows([]), width: 0, ratio: 1, theme: null });
    this.gutter = el("canvas", { class: "ms-gutter", "aria-hidden": "true" });
    this.still = el("canvas", { class: "ms-still", role: "img", "aria-label": "Tokens" });
    this.moving = el("canvas", { class: "ms-moving", "aria-hidden": "true" });
    this.playhead = el("i", { class: "ms-playhead" });
    this.roll = el("div", { class: "ms-roll" }, this.still, this.moving, this.playhead);
    this.scroller = el("div", { class: "ms-scroll", role: "group", "aria-label": "Tokens over time" }, this.roll);
    this.heads = el("div", { class: "ms-heads" });
    this.tip = el("div", { class: "ms-tip", role: "tooltip", hidden: true });
    this.element = el("div", { class: "ms-tracks", hidden: true }, this.gutter, this.scroller, this.heads, this.tip);
    this.listen();
  }

  setData(data) {
    this.data = data;
    this.laid = layRows(data.tracks);
    this.element.hidden = !data.tracks.length;
    this.still.setAttribute("aria-label", summary(data.tracks));
    this.heads.replaceChildren(...data.tracks.map((track, index) => this.head(track, this.laid.heads[index].y)));
    this.under = null;
    this.showTip(null);
  }

  dress(theme) {
    this.theme = theme;
    this.data?.tracks.forEach((track, index) => {
      this.heads.children[index].style.setProperty("--system", theme.dark ? track.dark_color : track.color);
    });
  }

  resize(full, ratio) {
    const room = full - GUTTER;
    const finest = Math.max(1, ...this.data.tracks.flatMap((track) => track.levels.map((level) => level.size)));
    this.ratio = ratio;
    this.width = room - MARGIN < finest * NARROW ? Math.min(1200, finest * WIDER) : room - MARGIN;
    this.roll.style.width = `${this.width + MARGIN}px`;
    this.roll.style.height = `${this.laid.height}px`;
    sizeCanvas(this.gutter, GUTTER, this.laid.height, ratio);
    for (const canvas of [this.still, this.moving]) sizeCanvas(canvas, this.width + MARGIN, this.laid.height, ratio);
    this.tellView();
  }

  tellView() {
    const { clientWidth: seen, scrollLeft } = this.scroller;
    const scrolls = this.data && seen > 0 && seen < this.width + MARGIN - 1;
    this.scroller.toggleAttribute("tabindex", scrolls);
    if (scrolls) this.scroller.tabIndex = 0;
    if (!scrolls) return this.onView(null);
    const frameAt = (x) => Math.min(Math.max((x / this.width) * this.data.frames, 0), this.data.frames);
    this.onView([frameAt(scrollLeft), frameAt(scrollLeft + seen)]);
  }

  // Keeps the playhead in sight while it plays.
  reveal() {
    const { scroller, data } = this, seen = scroller.clientWidth;
    if (!data || seen >= this.width + MARGIN - 1) return;
    const x = (this.store.state.frame / data.frames) * this.width;
    if (x < scroller.scrollLeft || x > scroller.scrollLeft + seen - 24) scroller.scrollLeft = x - 24;
  }

  ready() {
    return this.data && this.theme && this.data.tracks.length && this.width > 1;
  }

  drawStill() {
    if (!this.ready()) return;
    const ctx = clear(this.still, this.ratio), side = clear(this.gutter, this.ratio);
    ctx.textAlign = "center";
    side.textAlign = "right";
    ctx.textBaseline = side.textBaseline = "middle";
    ctx.font = `10px ${this.theme.font}`;
    for (const row of this.laid.rows) {
      this.drawRow(ctx, row);
      const chosen = this.store.state.scale === row.level + 1;
      side.font = `${chosen ? "700 " : ""}11px ${this.theme.font}`;
      side.fillStyle = css(chosen ? this.theme.text : this.theme.muted);
      side.fillText(String(row.level + 1), GUTTER - 8, row.y + row.height / 2 + 0.5);
    }
  }

  drawRow(ctx, row) {
    const track = this.data.tracks[row.track], level = track.levels[row.level], { scale, scaleMode } = this.store.state;
    const digits = String(level.codes - 1).length, cell = this.width * (track.frames / this.data.frames / level.size);
    const written = cell > DIGIT * digits + 3; // all ids of a row, or none
    ctx.globalAlpha = isUsed(row.level, scale, scaleMode) ? 1 : scaleMode === "focus" ? 0.4 : 0.16;
    for (let position = 0; position < level.size; position++) {
      const [from, to] = cellEdges(track, row.level, position, this.data.frames, this.width);
      const wide = to - from - (to - from > 5 ? 1 : to - from > 2 ? 0.5 : 0);
      const box = [from, row.y + 0.5, wide, row.height - 1];
      if (!level.ids) {
        drawPending(ctx, box, this.theme);
        continue;
      }
      const rgb = this.cellColour(level, position), text = String(level.ids[position]);
      ctx.fillStyle = css(rgb);
      fillCell(ctx, box);
      if (written) {
        ctx.fillStyle = css(textOn(rgb), 0.9);
        ctx.fillText(text, from + wide / 2, row.y + row.height / 2 + 0.5);
      }
    }
    ctx.globalAlpha = 1;
  }

  // The code's colour, paler the less sure the generator was.
  cellColour(level, position) {
    const rgb = [0, 1, 2].map((i) => level.rgb[3 * position + i]);
    return level.entropy ? mix(rgb, this.theme.surface, 0.85 * doubtOf(level, position)) : rgb;
  }

  // Called at every frame: the playhead is an element, the canvas is drawn again only when other cells are under it.
  move() {
    if (!this.ready()) return;
    const { frame } = this.store.state, { data } = this;
    this.playhead.style.transform = `translateX(${((frame / data.frames) * this.width).toFixed(1)}px)`;
    const under = this.laid.rows.map((row) => tokenAt(data.tracks[row.track], row.level, frame)).join();
    if (under === this.under) return;
    this.under = under;
    this.drawCells();
  }

  drawCells() {
    if (!this.ready()) return;
    const ctx = clear(this.moving, this.ratio), { theme, data } = this, { state } = this.store;
    if (state.span) this.band(ctx, state.span, css(theme.focus, 0.14));
    if (state.hover) this.band(ctx, this.spanOf(state.hover), css(theme.text, 0.1));
    for (const row of this.laid.rows) {
      const track = data.tracks[row.track], position = tokenAt(track, row.level, state.frame);
      if (position < 0 || !track.levels[row.level].ids) continue;
      this.ring(ctx, { ...row, position }, css(theme.surface, 0.9), 3);
      this.ring(ctx, { ...row, position }, css(theme.ink), 1.75);
    }
    this.drawSelection(ctx);
    if (state.hover) this.ring(ctx, state.hover, css(theme.text), 2);
  }

  // The chosen token, and thinly every place where the same code stands in its scale.
  drawSelection(ctx) {
    const chosen = locate(this.data.tracks, this.store.state.selection);
    if (!chosen) return;
    const level = this.data.tracks[chosen.track].levels[chosen.level], { focus } = this.theme;
    this.band(ctx, this.spanOf(chosen), css(focus, 0.14));
    for (let position = 0; level.ids && position < level.size; position++) {
      const same = level.ids[position] === level.ids[chosen.position];
      if (same && position !== chosen.position) this.ring(ctx, { ...chosen, position }, css(focus), 1.5);
    }
    this.ring(ctx, chosen, css(focus), 3);
  }

  spanOf({ track, level, position }) {
    return spanOf(this.data.tracks[track], level, position);
  }

  // Lights up a stretch of time in all rows.
  band(ctx, [from, to], color) {
    const scale = this.width / this.data.frames;
    ctx.fillStyle = color;
    for (const row of this.laid.rows) ctx.fillRect(from * scale, row.y, (to - from) * scale, row.height);
  }

  ring(ctx, { track, level, position }, color, line) {
    const row = this.laid.rows.find((candidate) => candidate.track === track && candidate.level === level);
    const [from, to] = cellEdges(this.data.tracks[track], level, position, this.data.frames, this.width);
    ctx.strokeStyle = color;
    ctx.lineWidth = line;
    ctx.beginPath();
    ctx.roundRect(from, row.y + 1, Math.max(2, to - from - 1), row.height - 2, 2);
    ctx.stroke();
  }

  cellOf(event) {
    const box = this.roll.getBoundingClientRect(), { data, laid, width } = this;
    const x = event.clientX - box.left, y = event.clientY - box.top;
    return data && cellAt(data.tracks, laid.rows, x, y, data.frames, width);
  }

  listen() {
    const { roll, store } = this;
    const hover = (cell, event) => {
      store.set({ hover: cell });
      this.showTip(cell, event);
    };
    this.scroller.addEventListener("scroll", () => this.tellView());
    roll.addEventListener("pointermove", (event) => event.pointerType !== "touch" && hover(this.cellOf(event), event));
    roll.addEventListener("pointerleave", () => hover(null));
    roll.addEventListener("click", (event) => {
      const cell = this.cellOf(event);
      if (!cell || !this.data.tracks[cell.track].levels[cell.level].ids) return;
      const selection = { system: this.data.tracks[cell.track].system, scale: cell.level + 1, position: cell.position };
      const again = JSON.stringify(locate(this.data.tracks, store.state.selection)) === JSON.stringify(cell);
      store.commit("select", { selection: again ? null : selection });
    });
  }

  showTip(cell, event) {
    if (!cell) return void (this.tip.hidden = true);
    const lines = describeCell(this.data.tracks, cell, this.data.fps);
    const content = lines.map((line) => el("div", {}, ...line.map((text) => el("span", { text }))));
    this.placeTip(event.clientX + 14, event.clientY + 18, content);
  }

  // x, y: in the window.
  placeTip(x, y, content) {
    const { tip } = this, box = this.element.getBoundingClientRect();
    tip.hidden = false;
    tip.replaceChildren(...content);
    const left = Math.max(4, Math.min(x - box.left, box.width - tip.offsetWidth - 4));
    tip.style.transform = `translate(${left}px, ${y - box.top}px)`;
  }

  head(track, y) {
    const node = head(track, y), note = node.querySelector(".ms-note");
    const show = () => {
      const box = note.getBoundingClientRect();
      this.placeTip(box.left, box.bottom + 4, [el("p", { text: track.note })]);
    };
    for (const event of ["pointerenter", "focus"]) note?.addEventListener(event, show);
    for (const event of ["pointerleave", "blur"]) note?.addEventListener(event, () => (this.tip.hidden = true));
    return node;
  }
}

function head(track, y) {
  const scales = track.levels.length, there = track.levels.filter((level) => level.ids);
  const tokens = there.reduce((sum, level) => sum + level.size, 0);
  const so = there.length < scales ? `${there.length} of ${scales}` : scales;
  const node = el(
    "div", { class: "ms-head", style: `top:${y}px` },
    el("i", { class: "ms-swatch" }),
    el("strong", { text: track.name }),
    el("span", { text: `${tokens} tokens in ${so} ${scales === 1 ? "scale" : "scales"}` }),
  );
  if (track.levels.some((level) => level.entropy)) node.append(el("span", { text: "faint: unsure" }));
  if (track.note) node.append(el("span", { class: "ms-note", text: track.note, tabindex: "0" }));
  return node;
}

function summary(tracks) {
  const told = tracks.map((track) => `${track.name}: ${track.levels.map((level) => level.size).join(", ")} tokens`);
  return `Tokens, coarse scales on top. ${told.join(". ")}.`;
}

// 0 sure, 1 as unsure as can be.
function doubtOf(level, position) {
  return Math.min(1, Math.max(0, level.entropy[position]) / Math.log(Math.max(2, level.codes)));
}

function drawPending(ctx, [x, y, w, h], theme) {
  ctx.strokeStyle = css(theme.line);
  ctx.lineWidth = 1;
  ctx.strokeRect(x + 0.5, y + 0.5, Math.max(0, w - 1), h - 1);
}

// Wide cells have soft corners.
function fillCell(ctx, [x, y, w, h]) {
  if (w < 8) return ctx.fillRect(x, y, w, h);
  ctx.beginPath();
  ctx.roundRect(x, y, w, h, 2);
  ctx.fill();
}

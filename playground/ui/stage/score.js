// The score: a piano roll of tokens, heat maps under it. One canvas holds what stands still, one over it what moves.

import { paintHatch, paintRow } from "./cells.js";
import { css } from "./colour.js";
import { Cursor } from "./cursor.js";
import { clear, el, sizeCanvas } from "./dom.js";
import { keyLines, stripHead, summary, trackHead } from "./heads.js";
import { paintLight } from "./light.js";
import { cellAt, describeCell, describeProbe, isUsed, layRows, probeAt } from "./rows.js";
import { locate, tokenAt } from "./store.js";
import { heatMap, namesWidth, paintNames, paintStrip, rampCss, tellStrip } from "./strips.js";

const GUTTER = 36; // pixels left of the roll, for the scales' numbers
export const MARGIN = 14; // pixels right of it, so that the playhead's end is seen
const NARROW = 9; // pixels: where the finest cell would be narrower than this,
const WIDER = 13; // it gets this many, and the roll scrolls sideways inside itself
const HATCH = ["rgba(17,18,20,0.34)", "rgba(255,255,255,0.2)"];

export class Score {
  // onView is told which frames are in sight, [from, to], or null when all are.
  constructor(store, { onView }) {
    Object.assign(this, { store, onView, data: null, laid: layRows([]), width: 0, ratio: 1, theme: null });
    this.gutterWidth = GUTTER;
    this.gutter = el("canvas", { class: "ms-gutter", "aria-hidden": "true" });
    this.still = el("canvas", { class: "ms-still", "aria-hidden": "true" });
    this.moving = el("canvas", { class: "ms-moving", "aria-hidden": "true" });
    this.playhead = el("i", { class: "ms-playhead" });
    this.roll = el("div", { class: "ms-roll", role: "presentation" }, this.still, this.moving, this.playhead);
    this.scroller = el("div", { class: "ms-scroll", role: "grid", "aria-label": "Tokens over time" }, this.roll);
    this.heads = el("div", { class: "ms-heads" });
    this.key = el("div", { class: "ms-key", hidden: true });
    this.tip = el("div", { class: "ms-tip", role: "tooltip", hidden: true });
    const roll = el("div", { class: "ms-rolls" }, this.gutter, this.scroller, this.heads);
    this.element = el("div", { class: "ms-tracks", hidden: true }, roll, this.key, this.tip);
    this.cursor = new Cursor(this);
    this.listen();
  }

  setData(data) {
    this.data = data;
    this.laid = layRows(data.tracks, data.strips);
    this.maps = null;
    this.element.hidden = !data.tracks.length && !data.strips.length;
    const told = [summary(data), ...data.strips.map((strip) => tellStrip(strip, data.fps))];
    this.scroller.setAttribute("aria-label", told.join(" "));
    this.trackHeads = data.tracks.map((track, index) => this.noted(trackHead(track, this.laid.heads[index].y), track));
    this.stripHeads = data.strips.map((strip, index) => stripHead(strip, this.laid.stripHeads[index].y));
    this.heads.replaceChildren(...this.trackHeads, ...this.stripHeads);
    const key = keyLines(data);
    this.key.replaceChildren(...key);
    this.key.hidden = !key.length;
    this.under = null;
    this.showTip(null);
  }

  dress(theme) {
    this.theme = theme;
    if (!this.data) return;
    this.data.tracks.forEach((track, index) => {
      this.trackHeads[index].style.setProperty("--system", theme.dark ? track.dark_color : track.color);
    });
    this.stripHeads.forEach((head) => head.style.setProperty("--ramp", rampCss(theme)));
    this.maps = this.data.strips.map((strip) => heatMap(strip, theme));
  }

  resize(full, ratio) {
    this.gutterWidth = Math.max(GUTTER, namesWidth(this.data.strips, full));
    const room = full - this.gutterWidth;
    const finest = Math.max(1, ...this.data.tracks.flatMap((track) => track.levels.map((level) => level.size)));
    this.ratio = ratio;
    this.width = room - MARGIN < finest * NARROW ? Math.min(1200, finest * WIDER) : room - MARGIN;
    this.scroller.style.marginLeft = `${this.gutterWidth}px`;
    this.roll.style.width = `${this.width + MARGIN}px`;
    this.roll.style.height = `${this.laid.height}px`;
    sizeCanvas(this.gutter, this.gutterWidth, this.laid.height, ratio);
    for (const canvas of [this.still, this.moving]) sizeCanvas(canvas, this.width + MARGIN, this.laid.height, ratio);
    this.tellView();
  }

  tellView() {
    const { clientWidth: seen, scrollLeft } = this.scroller;
    const scrolls = this.data && seen > 0 && seen < this.width + MARGIN - 1;
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
    return this.data && this.theme && this.laid.height > 0 && this.width > 1;
  }

  drawStill() {
    if (!this.ready()) return;
    const { data, theme, width, laid } = this, { scale, scaleMode } = this.store.state;
    const ctx = clear(this.still, this.ratio);
    ctx.textAlign = "center";
    ctx.textBaseline = "middle";
    ctx.font = `10px ${theme.font}`;
    for (const row of laid.rows) {
      const alpha = isUsed(row.level, scale, scaleMode) ? 1 : scaleMode === "focus" ? 0.4 : 0.16;
      paintRow(ctx, data.tracks[row.track], row, data.frames, width, theme, alpha);
      for (const [from, to] of data.hatch) {
        const x = (from / data.frames) * width, end = Math.min(to, data.tracks[row.track].frames) / data.frames;
        paintHatch(ctx, x, row.y, end * width - x, row.height, HATCH);
      }
    }
    for (const place of laid.strips) {
      paintStrip(ctx, data.strips[place.strip], this.maps[place.strip], place, data.frames, width, theme);
    }
    this.drawGutter();
  }

  drawGutter() {
    const { theme, laid, gutterWidth, data } = this, { scale, probe } = this.store.state;
    const side = clear(this.gutter, this.ratio);
    side.textAlign = "right";
    side.textBaseline = "middle";
    for (const row of laid.rows) {
      const chosen = scale === row.level + 1;
      side.font = `${chosen ? "700 " : ""}11px ${theme.font}`;
      side.fillStyle = css(chosen ? theme.text : theme.muted);
      side.fillText(String(row.level + 1), gutterWidth - 8, row.y + row.height / 2 + 0.5);
    }
    for (const place of laid.strips) {
      const lit = probe?.strip === place.strip ? probe.row : null;
      paintNames(side, data.strips[place.strip], place, gutterWidth - 8, theme, lit);
    }
    this.named = JSON.stringify(probe && [probe.strip, probe.row]);
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
    const { probe } = this.store.state;
    paintLight(clear(this.moving, this.ratio), this);
    if (this.data.strips.length && this.named !== JSON.stringify(probe && [probe.strip, probe.row])) this.drawGutter();
  }

  // What is under a pointer: {hover, probe}, one of them or neither.
  at(event) {
    const { data, laid, width } = this;
    if (!data) return { hover: null, probe: null };
    const box = this.roll.getBoundingClientRect(), x = event.clientX - box.left, y = event.clientY - box.top;
    const hover = cellAt(data.tracks, laid.rows, x, y, data.frames, width);
    return { hover, probe: hover ? null : probeAt(data.strips, laid.strips, x, y, data.frames, width) };
  }

  listen() {
    const { roll, store } = this;
    this.scroller.addEventListener("scroll", () => this.tellView());
    roll.addEventListener("pointermove", (event) => {
      if (event.pointerType === "touch") return;
      const found = this.at(event);
      store.set(found);
      this.showTip(this.linesOf(found), event.clientX + 14, event.clientY + 18);
    });
    roll.addEventListener("pointerleave", () => {
      store.set({ hover: null, probe: null });
      this.showTip(null);
    });
    roll.addEventListener("click", (event) => {
      const { hover, probe } = this.at(event);
      if (hover) this.select(hover);
      if (probe) store.seek(probe.frame);
      if (probe && event.pointerType === "touch") this.touch(probe, event);
    });
  }

  // A finger cannot hover: what it taps in a heat map is told until the next tap.
  touch(probe, event) {
    this.store.set({ probe });
    this.showTip(this.linesOf({ probe }), event.clientX + 14, event.clientY + 18);
  }

  linesOf({ hover, probe }) {
    const { tracks, strips, fps } = this.data;
    return hover ? describeCell(tracks, hover, fps) : probe && describeProbe(strips, probe, fps);
  }

  isChosen(cell) {
    return JSON.stringify(locate(this.data.tracks, this.store.state.selection)) === JSON.stringify(cell);
  }

  // Chooses a token, or lets go of it where it is chosen already. One that is still to come cannot be chosen.
  select(cell) {
    const track = this.data.tracks[cell.track];
    if (!track.levels[cell.level].ids) return;
    const selection = { system: track.system, scale: cell.level + 1, position: cell.position };
    this.store.commit("select", { selection: this.isChosen(cell) ? null : selection });
  }

  // lines: pairs of words, or null to hide it; x, y: in the window.
  showTip(lines, x, y) {
    if (!lines) return void (this.tip.hidden = true);
    this.placeTip(x, y, lines.map((line) => el("div", {}, ...line.map((text) => el("span", { text })))));
  }

  placeTip(x, y, content) {
    const { tip } = this, box = this.element.getBoundingClientRect();
    tip.hidden = false;
    tip.replaceChildren(...content);
    const left = Math.max(4, Math.min(x - box.left, box.width - tip.offsetWidth - 4));
    tip.style.transform = `translate(${left}px, ${y - box.top}px)`;
  }

  // A head whose note, where it is cut off, is told whole on hover and focus.
  noted(head, { note: text }) {
    const note = head.querySelector(".ms-note");
    const show = () => {
      const box = note.getBoundingClientRect();
      this.placeTip(box.left, box.bottom + 4, [el("p", { text })]);
    };
    for (const event of ["pointerenter", "focus"]) note?.addEventListener(event, show);
    for (const event of ["pointerleave", "blur"]) note?.addEventListener(event, () => (this.tip.hidden = true));
    return head;
  }
}

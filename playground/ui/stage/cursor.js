// The score by keyboard: one cell of a grid has the cursor, arrows move it, Enter chooses. Screen readers hear it.

import { el } from "./dom.js";
import { cellEdges, describeCell, describeProbe } from "./rows.js";
import { locate, shareOf, tokenAt } from "./store.js";

let count = 0;

export class Cursor {
  // score: {store, data, laid, width, scroller, select(cell), showTip(lines, x, y)}
  constructor(score) {
    this.score = score;
    this.cell = el("div", { class: "ms-cell", role: "gridcell", id: `ms-cell-${++count}` });
    this.row = el("div", { class: "ms-cell-row", role: "row" }, this.cell);
    const { scroller } = score;
    scroller.append(this.row);
    scroller.tabIndex = 0;
    scroller.setAttribute("aria-activedescendant", this.cell.id);
    scroller.addEventListener("keydown", (event) => this.press(event));
    scroller.addEventListener("focus", () => {
      this.byKeyboard = scroller.matches(":focus-visible");
      if (this.byKeyboard) this.enter();
    });
    scroller.addEventListener("blur", () => this.leave());
  }

  // Starts at the chosen token, else at the one under the playhead in the scale looked at.
  enter() {
    const { store, data } = this.score, { hover, probe } = store.state;
    if (hover || probe || !data?.tracks.length) return;
    const { selection, scale, frame } = store.state, track = data.tracks[0];
    const level = Math.min(scale || 1, track.levels.length) - 1;
    this.go(locate(data.tracks, selection) || { track: 0, level, position: Math.max(0, tokenAt(track, level, frame)) });
  }

  leave() {
    this.score.store.set({ hover: null, probe: null });
    this.score.showTip(null);
  }

  press(event) {
    const { data, store } = this.score;
    if (!data || event.altKey || event.ctrlKey || event.metaKey || event.shiftKey) return;
    const { hover, probe } = store.state;
    if (!hover && !probe) {
      if (event.key.startsWith("Arrow")) {
        event.preventDefault();
        this.enter();
      }
      return;
    }
    const clocks = event.key === "Home" || event.key === "End"; // after a click these two are still the clock's
    if ((this.byKeyboard || !clocks) && this.move(event.key, hover, probe)) event.preventDefault();
  }

  // false if the key means nothing here, so that others may have it.
  move(key, hover, probe) {
    const sideways = { ArrowLeft: -1, ArrowRight: 1, Home: -Infinity, End: Infinity }[key];
    if (sideways !== undefined) return probe ? this.slide(probe, sideways) : this.step(hover, sideways);
    if (key === "ArrowUp" || key === "ArrowDown") return this.change(hover, probe, key === "ArrowUp" ? -1 : 1);
    if (key === "PageUp" || key === "PageDown") return this.jump(hover, probe, key === "PageUp" ? -1 : 1);
    if (key !== "Enter") return false;
    if (probe) this.score.store.seek(probe.frame);
    else this.score.select(hover);
    return true;
  }

  step(hover, by) {
    const { size } = this.score.data.tracks[hover.track].levels[hover.level];
    return this.go({ ...hover, position: clamp(hover.position + by, size) });
  }

  slide(probe, by) {
    return this.go(null, { ...probe, frame: clamp(probe.frame + by, this.score.data.strips[probe.strip].frames) });
  }

  // One row up or down at the same time; past the last track the rows of the heat maps go on.
  change(hover, probe, by) {
    const lines = this.lines(), at = this.lineOf(lines, hover, probe), next = clamp(at + by, lines.length);
    return next === at || this.enterLine(lines[next], hover, probe);
  }

  // To the first row of the next or the previous track or heat map.
  jump(hover, probe, by) {
    const lines = this.lines(), starts = lines.filter((line) => !(line.level ?? line.row));
    const here = lines[this.lineOf(lines, hover, probe)];
    const at = starts.findIndex((line) => line.track === here.track && line.strip === here.strip);
    return this.enterLine(starts[clamp(at + by, starts.length)], hover, probe);
  }

  lines() {
    const { laid } = this.score;
    const heat = laid.strips.flatMap(({ strip, count: rows }) =>
      Array.from({ length: rows }, (_, row) => ({ strip, row })));
    return [...laid.rows.map(({ track, level }) => ({ track, level })), ...heat];
  }

  lineOf(lines, hover, probe) {
    return lines.findIndex((line) =>
      probe ? line.strip === probe.strip && line.row === probe.row
        : line.track === hover.track && line.level === hover.level);
  }

  enterLine(line, hover, probe) {
    const { tracks, strips } = this.score.data;
    const share = hover && shareOf(tracks[hover.track], hover.level, hover.position);
    const middle = share ? (share[0] + share[1]) / 2 : probe.frame + 0.5;
    if (line.strip !== undefined) {
      return this.go(null, { ...line, frame: clamp(Math.floor(middle), strips[line.strip].frames) });
    }
    const track = tracks[line.track];
    const position = tokenAt(track, line.level, Math.min(middle, track.frames - 1e-6));
    return this.go({ ...line, position: Math.max(0, position) });
  }

  go(hover, probe = null) {
    const { score } = this;
    score.store.set({ hover, probe });
    const [left, top, wide, tall] = hover ? this.boxOf(hover) : this.boxOfProbe(probe);
    Object.assign(this.cell.style, {
      left: `${left}px`, top: `${top}px`, width: `${Math.max(2, wide)}px`, height: `${tall}px`,
    });
    const { tracks, strips, fps } = score.data;
    const lines = hover ? describeCell(tracks, hover, fps) : describeProbe(strips, probe, fps);
    this.cell.textContent = lines.flat().join(", ");
    this.cell.setAttribute("aria-selected", String(Boolean(hover) && score.isChosen(hover)));
    this.cell.scrollIntoView({ block: "nearest", inline: "nearest" });
    const box = this.cell.getBoundingClientRect();
    score.showTip(lines, box.left + Math.min(wide, 14), box.bottom + 8);
    return true;
  }

  boxOf({ track, level, position }) {
    const { data, laid, width } = this.score;
    const row = laid.rows.find((line) => line.track === track && line.level === level);
    const [from, to] = cellEdges(data.tracks[track], level, position, data.frames, width);
    return [from, row.y, to - from, row.height];
  }

  boxOfProbe({ strip, row, frame }) {
    const { data, laid, width } = this.score, place = laid.strips[strip], step = width / data.frames;
    return [frame * step, place.y + row * place.step, step, place.step];
  }
}

function clamp(value, size) {
  return Math.min(size - 1, Math.max(0, value));
}

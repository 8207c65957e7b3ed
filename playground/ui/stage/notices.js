// What the stage says in words: badge, the note while it works or is empty, one sentence of error, speech for readers.

import { el } from "./dom.js";

const EMPTY = "Choose a motion or type a prompt. The figure and its tokens appear here.";

function told(seconds) {
  return seconds < 0.1 ? `${Math.max(1, Math.round(1000 * seconds))} ms` : `${Number(seconds.toPrecision(2))} s`;
}

export class Notices {
  constructor(empty = EMPTY) {
    this.empty = empty;
    this.badge = el("div", { class: "ms-badge", hidden: true });
    this.notice = el("div", { class: "ms-notice", role: "status", text: empty });
    this.progress = el("div", { class: "ms-progress" });
    this.error = el("div", { class: "ms-error", role: "alert", hidden: true });
    this.spoken = el("div", { class: "ms-spoken", "aria-live": "polite" });
  }

  showBadge(badge) {
    this.badge.hidden = !badge;
    if (!badge) return;
    this.badge.textContent = badge.seconds === null ? badge.kind : `${badge.kind}, ${told(badge.seconds)}`;
    this.badge.dataset.kind = badge.kind;
    this.badge.title = badge.text || (badge.kind === "live" ? "Computed just now" : "A stored result");
  }

  // state: "loading" | "error" | "empty" | "ready"; hasData: whether a result is there, dimmed or not.
  say(state, text, hasData) {
    this.error.hidden = state !== "error";
    this.error.textContent = state === "error" ? text : "";
    if (state === "loading") this.notice.textContent = text || "Working";
    else this.notice.textContent = hasData ? "" : (state === "empty" && text) || this.empty;
  }

  speak(text) {
    this.spoken.textContent = text;
  }
}

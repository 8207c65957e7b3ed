// How much is drawn while it plays: where frames take too long, first fewer pixels, then plainer bodies.

const SLOW = 0.034; // seconds a frame
const PATIENCE = 24; // frames that are watched before a step

export class Pace {
  constructor() {
    this.restart();
  }

  // At a new result or a new size everything is drawn again.
  restart() {
    Object.assign(this, { step: 0, mean: 0, seen: 0 });
  }

  // Told of the time since the last frame; true when what is to be drawn has changed.
  watch(seconds) {
    this.seen++;
    this.mean += (Math.min(0.25, seconds) - this.mean) / Math.min(this.seen, PATIENCE);
    if (this.seen < PATIENCE || this.mean <= SLOW || this.step >= 2) return false;
    this.step++;
    this.seen = 0;
    return true;
  }

  // Pixels a CSS pixel on a screen that has `most`.
  ratio(most) {
    return this.step >= 1 ? Math.min(1, most) : most;
  }

  get plain() {
    return this.step >= 2;
  }
}

// How many points a frame may draw: as many as its time allows, learnt from the frames before.
const FIRST = 150_000;
const STALL_MS = 1500; // longer is a pause of the page, not the price of a frame
const SLOW_FPS = 24; // with the least budget, fewer frames ask for a coarser picture
const FAST_FPS = 45;

export class Pace {
  constructor(aim_ms, least) {
    this.aim_ms = aim_ms;
    this.least = least; // points
    this.budget = FIRST;
    this.fps = 0;
    this.slow = false;
    this.last = null;
  }

  /** A frame begins at `now` (ms): the time since the last one is what that one took. */
  tick(now) {
    const took = now - (this.last ?? now);
    this.last = now;
    if (took <= 0 || took > STALL_MS) return;
    this.fps += (1000 / took - this.fps) * (this.fps ? 0.2 : 1);
    const change = Math.min(1.25, Math.max(0.6, this.aim_ms / took));
    this.budget = Math.max(this.least, this.budget * change);
    if (this.budget === this.least && this.fps < SLOW_FPS) this.slow = true;
    if (this.fps > FAST_FPS) this.slow = false;
  }

  /** The pause that follows is not the price of a frame. */
  stop() {
    this.last = null;
  }
}

// How often to draw and how sharp, from what pictures cost: the machine keeps half of its time for others. Pure.

const QUICK_MS = 10; // a picture that costs no more needs no pause: 60 a second leave enough room
const SLOW_MS = 28; // pictures that cost more give up sharpness
const SLOW_RUN = 3,
  QUICK_RUN = 90; // so many in a row: one slow picture is a shader being made
const MOST_PAUSE_MS = 700; // one picture that took seconds, as the first with its shaders, holds up none after it
const LOST_MS = 3000; // an answer that never comes stands for one that came

export class Pace {
  costMs = 0; // of the last picture
  begun = 0;
  drawing = false;
  restUntil = 0;
  slow = 0;
  quick = 0;

  /** @param {number} least sharpness @param {number} sharpness to begin with, 1: all pixels of the screen */
  constructor(least, sharpness = 1) {
    this.least = least;
    this.sharpness = Math.max(least, sharpness);
  }

  /** may the next picture begin? One at a time, and about as long a pause as it took @param {number} now ms */
  ready(now) {
    return this.drawing ? now - this.begun > LOST_MS : now >= this.restUntil;
  }

  /** @param {number} now ms */
  begin(now) {
    this.drawing = true;
    this.begun = now;
  }

  /** the picture is there @param {number} now ms @returns {boolean} sharpness is another from now on */
  done(now) {
    this.drawing = false;
    this.costMs = now - this.begun;
    this.restUntil = this.costMs > QUICK_MS ? now + Math.min(this.costMs, MOST_PAUSE_MS) : now;
    this.slow = this.costMs > SLOW_MS ? this.slow + 1 : 0;
    this.quick = this.costMs < QUICK_MS / 2 ? this.quick + 1 : 0;
    const before = this.sharpness;
    // the cost goes about with the number of pixels
    if (this.slow >= SLOW_RUN) this.sharpness *= Math.max(0.5, Math.min(0.85, Math.sqrt(SLOW_MS / this.costMs)));
    else if (this.quick >= QUICK_RUN) this.sharpness *= 1.25;
    else return false;
    this.slow = this.quick = 0;
    this.sharpness = Math.max(this.least, Math.min(1, this.sharpness));
    return this.sharpness !== before;
  }
}

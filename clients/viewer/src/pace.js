// How often to draw and at which resolution, from the cost of pictures: half of the time stays free. Pure.

const FAST_MS = 10; // a picture that costs no more needs no pause: 60 per second leave enough time
const SLOW_MS = 28; // pictures that cost more are drawn at a lower resolution
const SLOW_RUN = 3;
const FAST_RUN = 90; // pictures in a row before a change: a single slow one compiles a shader
const STRUGGLE_MS = 100; // pictures that cost more even at the lowest resolution: with their pauses fewer than 5 a second
const STRUGGLE_RUN = 8;
const PAUSE_MAX_MS = 700; // after a picture that took seconds, as the first one
const LOST_MS = 3000; // a picture without a signal of its end counts as finished after this

export class Pace {
    costMs = 0; // of the last picture
    begun = 0;
    drawing = false;
    restUntil = 0;
    slow = 0;
    fast = 0;
    slowest = 0; // pictures in a row that struggle
    /** this browser has drawn too slowly at every resolution */
    struggles = false;

    /** @param {number} min resolution @param {number} resolution initial, 1: all pixels of the screen */
    constructor(min, resolution = 1) {
        this.min = min;
        this.resolution = Math.max(min, resolution);
    }

    /** may the next picture begin? One at a time, with a pause as long as its cost @param {number} now ms */
    ready(now) {
        return this.drawing ? now - this.begun > LOST_MS : now >= this.restUntil;
    }

    /** @param {number} now ms */
    begin(now) {
        this.drawing = true;
        this.begun = now;
    }

    /** the picture is finished @param {number} now ms @returns {boolean} the resolution has changed */
    done(now) {
        this.drawing = false;
        this.costMs = now - this.begun;
        this.restUntil = this.costMs > FAST_MS ? now + Math.min(this.costMs, PAUSE_MAX_MS) : now;
        this.slow = this.costMs > SLOW_MS ? this.slow + 1 : 0;
        this.fast = this.costMs < FAST_MS / 2 ? this.fast + 1 : 0;
        this.slowest = this.costMs > STRUGGLE_MS && this.resolution <= this.min ? this.slowest + 1 : 0;
        this.struggles ||= this.slowest >= STRUGGLE_RUN;
        const before = this.resolution;
        // the cost is about proportional to the number of pixels
        if (this.slow >= SLOW_RUN) this.resolution *= Math.max(0.5, Math.min(0.85, Math.sqrt(SLOW_MS / this.costMs)));
        else if (this.fast >= FAST_RUN) this.resolution *= 1.25;
        else return false;
        this.slow = this.fast = 0;
        this.resolution = Math.max(this.min, Math.min(1, this.resolution));
        return this.resolution !== before;
    }
}

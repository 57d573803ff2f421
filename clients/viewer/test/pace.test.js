// Pace: slow drawing keeps half of the time free, lowers the resolution to a minimum, and raises it again.
import assert from "node:assert/strict";
import test from "node:test";
import { Pace } from "../src/pace.js";

/** draws for `ms` at 60 turns per second, each picture costs cost(resolution); returns their number and share of time */
function run(pace, ms, cost) {
    const begin = pace.restUntil;
    let n = 0;
    let spent = 0;
    let done = Infinity;
    for (let t = begin; t < begin + ms; t += 1) {
        if (t >= done) {
            pace.done(t);
            done = Infinity;
        }
        if ((t - begin) % 17 !== 0 || !pace.ready(t)) continue;
        pace.begin(t);
        const c = cost(pace.resolution);
        done = t + c;
        spent += c;
        n++;
    }
    return { n, share: spent / ms };
}

test("fast drawing uses every turn and all pixels", () => {
    const pace = new Pace(0.3);
    const { n } = run(pace, 1700, () => 4);
    assert.equal(n, 100);
    assert.equal(pace.resolution, 1);
});

test("a first picture that takes seconds to compile shaders delays the next by at most 700 ms", () => {
    const pace = new Pace(1);
    pace.begin(0);
    pace.done(8000);
    assert.equal(pace.ready(8600), false);
    assert.equal(pace.ready(8701), true);
});

test("pictures take at most half of the time", () => {
    for (const c of [12, 20, 40, 200, 700]) {
        const { n, share } = run(new Pace(1), 20000, () => c);
        assert.ok(share <= 0.5 + (2 * c) / 20000, `${c} ms: ${share}`);
        // and the pause is no longer than that, and a turn
        assert.ok(n >= Math.floor(20000 / (2 * c + 18)), `${c} ms: ${n}`);
    }
});

test("three slow pictures in a row lower the resolution, one does not", () => {
    const pace = new Pace(0.3);
    const picture = (ms) => {
        pace.begin(0);
        return pace.done(ms);
    };
    assert.equal(picture(900), false);
    assert.equal(picture(5), false);
    assert.deepEqual([picture(112), picture(112), picture(112)], [false, false, true]);
    assert.equal(pace.resolution, 0.5);
});

test("the resolution settles where pictures are fast enough, or at its minimum", () => {
    const pace = new Pace(0.2);
    run(pace, 20000, (s) => Math.round(5 + 120 * s * s));
    assert.ok(5 + 120 * pace.resolution ** 2 <= 29 && pace.resolution > 0.3, String(pace.resolution));
    const hopeless = new Pace(0.2);
    run(hopeless, 60000, () => 300);
    assert.equal(hopeless.resolution, 0.2);
    // drawing is fast again
    run(hopeless, 60000, () => 3);
    assert.equal(hopeless.resolution, 1);
});

test("a picture waits for the end of the one before, at most 3 s", () => {
    const pace = new Pace(0.3);
    pace.begin(100);
    assert.equal(pace.ready(2000), false);
    assert.equal(pace.ready(3200), true);
});

test("a browser that struggles at its lowest resolution is found, a slow picture alone is none", () => {
    const pace = new Pace(0.4, 1);
    let now = 0;
    const draw = (/** @type {number} */ ms) => {
        pace.begin(now);
        pace.done((now += ms));
        now += 1000;
    };
    draw(2000);
    for (let i = 0; i < 5; i++) draw(8);
    for (let i = 0; i < 7; i++) draw(150);
    assert.equal(pace.struggles, false, "the resolution falls first");
    for (let i = 0; i < 20; i++) draw(150);
    assert.equal(pace.struggles, true);
});

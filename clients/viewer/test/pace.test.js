// Pace: a machine that draws slowly keeps half of its time, gives up sharpness down to the least, and gets it back.
import assert from "node:assert/strict";
import test from "node:test";
import { Pace } from "../src/pace.js";

/** draws for `ms` at 60 turns a second, each picture costs cost(sharpness); gives how many and the time spent on them */
function run(pace, ms, cost) {
  const begin = pace.restUntil;
  let n = 0,
    spent = 0,
    done = Infinity;
  for (let t = begin; t < begin + ms; t += 1) {
    if (t >= done) {
      pace.done(t);
      done = Infinity;
    }
    if ((t - begin) % 17 !== 0 || !pace.ready(t)) continue;
    pace.begin(t);
    const c = cost(pace.sharpness);
    done = t + c;
    spent += c;
    n++;
  }
  return { n, share: spent / ms };
}

test("a quick machine draws every turn, all pixels", () => {
  const pace = new Pace(0.3),
    { n } = run(pace, 1700, () => 4);
  assert.equal(n, 100);
  assert.equal(pace.sharpness, 1);
});

test("a first picture that takes seconds, as its shaders are made, holds up none after it", () => {
  const pace = new Pace(1);
  pace.begin(0);
  pace.done(8000);
  assert.equal(pace.ready(8600), false);
  assert.equal(pace.ready(8701), true);
});

test("pictures take at most half of the time, up to seconds for one", () => {
  for (const c of [12, 20, 40, 200, 700]) {
    const { n, share } = run(new Pace(1), 20000, () => c);
    assert.ok(share <= 0.5 + (2 * c) / 20000, `${c} ms: ${share}`);
    // and the pause is no longer than that, and a turn
    assert.ok(n >= Math.floor(20000 / (2 * c + 18)), `${c} ms: ${n}`);
  }
});

test("one slow picture changes nothing, three do", () => {
  const pace = new Pace(0.3);
  const picture = (ms) => {
    pace.begin(0);
    return pace.done(ms);
  };
  assert.equal(picture(900), false);
  assert.equal(picture(5), false);
  assert.deepEqual([picture(112), picture(112), picture(112)], [false, false, true]);
  assert.equal(pace.sharpness, 0.5);
});

test("sharpness settles where pictures cost little enough, or at the least", () => {
  const pace = new Pace(0.2);
  run(pace, 20000, (s) => Math.round(5 + 120 * s * s));
  assert.ok(5 + 120 * pace.sharpness ** 2 <= 29 && pace.sharpness > 0.3, String(pace.sharpness));
  const hopeless = new Pace(0.2);
  run(hopeless, 60000, () => 300);
  assert.equal(hopeless.sharpness, 0.2);
  // what had slowed it is over
  run(hopeless, 60000, () => 3);
  assert.equal(hopeless.sharpness, 1);
});

test("no second picture before the first is there, unless it never comes", () => {
  const pace = new Pace(0.3);
  pace.begin(100);
  assert.equal(pace.ready(2000), false);
  assert.equal(pace.ready(3200), true);
});

// Videos: their format and their length in words.
import assert from "node:assert/strict";
import { test } from "node:test";
import { chooseVideoType, elapsedText } from "../src/video_type.js";

test("the format is the best that the browser offers, and its file has the right ending", () => {
    assert.deepEqual(
        chooseVideoType(() => true),
        { type: "video/webm;codecs=vp9", ending: ".webm" },
    );
    assert.equal(chooseVideoType((type) => !type.includes("vp9"))?.type, "video/webm;codecs=vp8");
    assert.deepEqual(
        chooseVideoType((type) => type === "video/mp4"),
        { type: "video/mp4", ending: ".mp4" },
    );
    assert.equal(
        chooseVideoType(() => false),
        null,
    );
});

test("elapsed time is minutes and seconds", () => {
    assert.deepEqual([0, 9.99, 60, 671].map(elapsedText), ["0:00", "0:09", "1:00", "11:11"]);
});

// Pictures and videos of what the page shows: the canvas with title, names, force, legend and scale bar, without panels.
import { buttonById, htmlById } from "./dom.js";
import { download } from "./download.js";
import { text } from "./text.js";
import { chooseVideoType, elapsedText } from "./video_type.js";

const SHOWN = ["#title", "#labels > span", "#force", "#legend", "#scale"];
const WIDTH_MAX = 1920; // of a video, pixels: what browsers encode while they draw
const RATE_HZ = 30; // pictures of a video
const BITS_PER_PIXEL = 0.1; // of a video: soft shading without visible blocks
const LENGTH_MAX_S = 900; // of a video, which is in memory until it is saved: about 350 MB
const REDRAW_MS = 500; // a still scene is drawn again, or the video would have no end

export class Capture {
    /** @param {import("./stage.js").Stage} stage @param {import("./app_state.js").AppState} state */
    constructor(stage, state) {
        this.stage = stage;
        this.state = state;
        /** @type {{recorder: MediaRecorder, context: CanvasRenderingContext2D, begun: number, timer: number} | null} */
        this.video = null;
        this.format =
            "MediaRecorder" in window && "captureStream" in HTMLCanvasElement.prototype
                ? chooseVideoType((type) => MediaRecorder.isTypeSupported(type))
                : null;
        buttonById("capture-picture").onclick = () => this.savePicture();
        buttonById("capture-video").hidden = !this.format;
        buttonById("capture-video").onclick = () => (this.video ? this.stop() : this.record());
        buttonById("capture-stop").onclick = () => this.stop();
    }

    /** @param {Blob} blob @param {string} ending */
    save(blob, ending) {
        download(blob, this.state.hello?.session ?? "", ending);
    }

    /** @param {number} scale pixels of a pixel of the page @returns {Promise<CanvasRenderingContext2D>} */
    async makeContext(scale) {
        this.painter = await import("./element_painter.js");
        const even = (/** @type {number} */ length) => 2 * Math.round((scale * length) / 2); // encoders need it
        const { clientWidth, clientHeight } = this.stage.canvas;
        const canvas = Object.assign(document.createElement("canvas"), {
            width: even(clientWidth),
            height: even(clientHeight),
        });
        return /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
    }

    /** right after the canvas was drawn: later it is empty @param {CanvasRenderingContext2D} context */
    paint(context) {
        const { canvas } = this.stage;
        const { width, height } = context.canvas;
        context.setTransform(1, 0, 0, 1, 0, 0);
        context.drawImage(canvas, 0, 0, width, height);
        context.setTransform(width / canvas.clientWidth, 0, 0, height / canvas.clientHeight, 0, 0);
        for (const element of document.querySelectorAll(SHOWN.join())) this.painter?.paintElement(context, element);
    }

    /** a picture with all pixels of the screen, however slowly this browser draws */
    async savePicture() {
        const context = await this.makeContext(Math.min(window.devicePixelRatio || 1, 2));
        const { pace } = this.stage;
        const before = pace.resolution;
        this.draw(1);
        this.paint(context);
        this.draw(before);
        const blob = await new Promise((resolve) => context.canvas.toBlob(resolve));
        if (blob) this.save(blob, ".png");
    }

    /** @param {number} resolution 1: all pixels of the screen */
    draw(resolution) {
        this.stage.pace.resolution = resolution;
        this.stage.sizeDue = this.stage.dirty = true;
        this.stage.draw();
    }

    async record() {
        if (!this.format || this.video) return;
        const { clientWidth } = this.stage.canvas;
        const context = await this.makeContext(Math.min(WIDTH_MAX / clientWidth, window.devicePixelRatio || 1));
        const { width, height } = context.canvas;
        const recorder = new MediaRecorder(context.canvas.captureStream(RATE_HZ), {
            mimeType: this.format.type,
            videoBitsPerSecond: BITS_PER_PIXEL * width * height * RATE_HZ,
        });
        /** @type {Blob[]} */
        const pieces = [];
        const { type, ending } = this.format;
        recorder.ondataavailable = (event) => pieces.push(event.data);
        recorder.onstop = () => this.save(new Blob(pieces, { type }), ending);
        const timer = window.setInterval(() => this.showElapsed(), REDRAW_MS);
        this.video = { recorder, context, begun: performance.now(), timer };
        recorder.start(1000); // in pieces of a second, so that memory holds them encoded
        this.showElapsed();
        this.show(true);
    }

    /** each picture that the stage has drawn is one of the video */
    drawn() {
        if (this.video) this.paint(this.video.context);
    }

    showElapsed() {
        if (!this.video) return;
        this.stage.dirty = true;
        const elapsed = (performance.now() - this.video.begun) / 1000;
        htmlById("capture-stop").textContent = text("capture.stop", { elapsed: elapsedText(elapsed) });
        if (elapsed > LENGTH_MAX_S) this.stop();
    }

    /** ends the video and saves it */
    stop() {
        if (!this.video) return;
        const { recorder, timer } = this.video;
        clearInterval(timer);
        this.video = null;
        recorder.stop();
        for (const track of recorder.stream.getTracks()) track.stop();
        this.show(false);
    }

    /** @param {boolean} recording */
    show(recording) {
        htmlById("capture-stop").hidden = !recording;
        buttonById("capture-video").setAttribute("aria-pressed", String(recording));
    }
}

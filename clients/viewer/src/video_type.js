// The format of a video. Pure.

/** best first: files of the first are smaller at the same quality; Safari makes only the last */
const TYPES = ["video/webm;codecs=vp9", "video/webm;codecs=vp8", "video/webm", "video/mp4"];

/**
 * @param {(type: string) => boolean} isSupported of MediaRecorder
 * @returns {{type: string, ending: string} | null} null: this browser records no video
 */
export function chooseVideoType(isSupported) {
    const type = TYPES.find(isSupported);
    return type ? { type, ending: type.startsWith("video/mp4") ? ".mp4" : ".webm" } : null;
}

/** minutes and seconds @param {number} seconds */
export const elapsedText = (seconds) =>
    `${Math.floor(seconds / 60)}:${String(Math.floor(seconds % 60)).padStart(2, "0")}`;

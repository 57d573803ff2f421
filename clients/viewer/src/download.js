// Files that the page makes.

/** @param {Blob} blob @param {string} session names the file @param {string} ending with the dot */
export function download(blob, session, ending) {
    const name = (session || "palpate").replace(/[^\w-]+/g, "_");
    const href = URL.createObjectURL(blob);
    Object.assign(document.createElement("a"), { href, download: name + ending }).click();
    // long enough for a slow disk; the browser holds the bytes until then
    setTimeout(() => URL.revokeObjectURL(href), 10000);
}

// What the browser keeps for the user. Without storage it lasts as long as the page.

/** @param {string} key @returns {string | null} null: nothing, or the browser keeps nothing */
export function stored(key) {
    try {
        return localStorage.getItem(key);
    } catch {
        return null;
    }
}

/** @param {string} key @param {string} value */
export function store(key, value) {
    try {
        localStorage.setItem(key, value);
    } catch {
        // the choice holds until the page is closed
    }
}

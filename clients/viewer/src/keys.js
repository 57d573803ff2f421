// The keyboard: the page's buttons, and the camera for users without a pointer.

const TURN_PX = 40;
const ZOOM_STEP = 0.85;

/**
 * @typedef {{orbit: (dx: number, dy: number) => void, zoom: (factor: number) => void, home: () => void}} View
 * @typedef {{key: string, ctrlKey: boolean, metaKey: boolean, altKey: boolean, repeat: boolean, target: unknown}} Press
 */

/** @param {View} view @returns {Record<string, () => void>} keys that repeat while they are held */
function viewKeys(view) {
    return {
        arrowleft: () => view.orbit(-TURN_PX, 0),
        arrowright: () => view.orbit(TURN_PX, 0),
        arrowup: () => view.orbit(0, -TURN_PX),
        arrowdown: () => view.orbit(0, TURN_PX),
        "+": () => view.zoom(ZOOM_STEP),
        "=": () => view.zoom(ZOOM_STEP),
        "-": () => view.zoom(1 / ZOOM_STEP),
        0: () => view.home(),
    };
}

/** does the focused element use this key itself? @param {unknown} focused @param {string} key */
function usedBy(focused, key) {
    const target = /** @type {{tagName?: string, type?: string} | null} */ (focused);
    const name = target?.tagName;
    if (name === "INPUT") return target?.type !== "checkbox" || key === " ";
    if (name === "SELECT") return true; // arrows and letters choose
    return name === "BUTTON" && (key === " " || key === "enter");
}

/**
 * Action of a key press, or null; a held key repeats camera motion only, never commands.
 * @param {Record<string, () => void>} actions by lower-case key @param {View} view
 * @returns {(press: Press) => (() => void) | null}
 */
export function keyMap(actions, view) {
    const camera = viewKeys(view);
    return (press) => {
        const key = press.key.toLowerCase();
        if (press.ctrlKey || press.metaKey || press.altKey || usedBy(press.target, key)) return null;
        return camera[key] ?? (press.repeat ? null : (actions[key] ?? null));
    };
}

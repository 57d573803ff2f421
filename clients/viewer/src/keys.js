// The keyboard: what the page's buttons do, and looking around for people without a pointer.

const TURN_PX = 40,
  NEARER = 0.85;

/**
 * @typedef {{orbit: (dx: number, dy: number) => void, zoom: (factor: number) => void, home: () => void}} View
 * @typedef {{key: string, ctrlKey: boolean, metaKey: boolean, altKey: boolean, repeat: boolean, target: any}} Press
 */

/** @param {View} view @returns {Record<string, () => void>} keys that may be held down */
function viewKeys(view) {
  return {
    arrowleft: () => view.orbit(-TURN_PX, 0),
    arrowright: () => view.orbit(TURN_PX, 0),
    arrowup: () => view.orbit(0, -TURN_PX),
    arrowdown: () => view.orbit(0, TURN_PX),
    "+": () => view.zoom(NEARER),
    "=": () => view.zoom(NEARER),
    "-": () => view.zoom(1 / NEARER),
    0: () => view.home(),
  };
}

/** does the focused element use this key itself? @param {any} target @param {string} key */
function taken(target, key) {
  const name = target?.tagName;
  if (name === "INPUT") return target.type !== "checkbox" || key === " ";
  if (name === "SELECT") return true; // arrows and letters choose
  return name === "BUTTON" && (key === " " || key === "enter");
}

/**
 * What a key press does, or null; a held key repeats the view's keys only, so that it sends no flood of commands.
 * @param {Record<string, () => void>} actions by lower-case key @param {View} view
 * @returns {(press: Press) => (() => void) | null}
 */
export function keyMap(actions, view) {
  const looking = viewKeys(view);
  return (press) => {
    const key = press.key.toLowerCase();
    if (press.ctrlKey || press.metaKey || press.altKey || taken(press.target, key)) return null;
    return looking[key] ?? (press.repeat ? null : (actions[key] ?? null));
  };
}

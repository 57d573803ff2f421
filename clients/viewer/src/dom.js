// Elements of the page, with their types.

/**
 * Element of an id; the page always has it.
 * @template {Element} T
 * @param {string} id @param {new () => T} type
 * @param {Document} page
 * @returns {T}
 */
export function byId(id, type, page = document) {
    const element = page.getElementById(id);
    if (!(element instanceof type)) throw new Error(`#${id} is not ${type.name}`);
    return element;
}

/** @param {string} id @param {Document} page */
export const htmlById = (id, page = document) => byId(id, HTMLElement, page);
/** @param {string} id @param {Document} page */
export const buttonById = (id, page = document) => byId(id, HTMLButtonElement, page);
/** @param {string} id @param {Document} page */
export const inputById = (id, page = document) => byId(id, HTMLInputElement, page);
/** @param {string} id @param {Document} page */
export const selectById = (id, page = document) => byId(id, HTMLSelectElement, page);

/** @param {string} value @param {string} text */
export function makeOption(value, text = value) {
    return Object.assign(document.createElement("option"), { value, textContent: text });
}

/**
 * Within a radio group the arrow keys choose.
 * @param {HTMLElement} group @param {() => HTMLButtonElement[]} buttons those that can be chosen now
 */
export function chooseByArrows(group, buttons) {
    group.addEventListener("keydown", (e) => {
        if (!e.key.startsWith("Arrow")) return;
        e.preventDefault();
        e.stopPropagation();
        const all = buttons();
        const now = all.findIndex((button) => button.tabIndex === 0);
        const step = e.key === "ArrowRight" || e.key === "ArrowDown" ? 1 : -1;
        const next = all[(now + step + all.length) % all.length];
        next.click();
        next.focus();
    });
}

/** @param {HTMLButtonElement} button of a radio group @param {boolean} chosen */
export function markRadio(button, chosen) {
    button.setAttribute("aria-checked", String(chosen));
    button.tabIndex = chosen ? 0 : -1;
}

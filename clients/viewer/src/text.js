// Every text that the page shows, in the language of the user. The languages are files of the same keys; English is
// complete, and a test compares the others with it. The address chooses (?lang=de), else the browser.
import { GERMAN } from "./text_de.js";
import { ENGLISH } from "./text_en.js";

/** @typedef {keyof typeof ENGLISH} TextKey */

/** @type {Record<string, Record<TextKey, string>>} */
export const LANGUAGES = { en: ENGLISH, de: GERMAN };

/**
 * The first known language of a list, by their first subtag ("de-AT" is "de").
 * @param {readonly (string | null | undefined)[]} preferred @returns {string}
 */
export function chooseLanguage(preferred) {
    for (const tag of preferred) {
        const language = (tag ?? "").toLowerCase().split("-")[0];
        if (Object.hasOwn(LANGUAGES, language)) return language;
    }
    return "en";
}

const asked = typeof location === "undefined" ? null : new URLSearchParams(location.search).get("lang");
export const language = chooseLanguage([asked, ...(typeof document === "undefined" ? [] : navigator.languages)]);

/**
 * The text of a key; {name} in it is replaced by values.name.
 * @param {TextKey} key @param {Record<string, string | number>} [values]
 */
export function text(key, values = {}) {
    return LANGUAGES[language][key].replace(/\{(\w+)\}/g, (all, name) => String(values[name] ?? all));
}

const DECIMAL_SIGNS = Object.freeze(/** @type {Record<string, string>} */ ({ de: "," }));

/** a number with the decimal sign of a language @param {string} digits as of toFixed @param {string} [of] */
export const decimal = (digits, of = language) => digits.replace(".", DECIMAL_SIGNS[of] ?? ".");

/** is there a text of this key? @param {string} key @returns {key is TextKey} */
export const isTextKey = (key) => Object.hasOwn(ENGLISH, key);

/**
 * What the server refused: its own sentence, which is English and names what it is about; in another language that of
 * the code, where there is one, with the server's behind it where it tells more.
 * @param {string} code @param {string} sentence @param {string} [of] the language
 */
export function refusalText(code, sentence, of = language) {
    const key = `refusal.${code}`;
    if (of === "en" || !isTextKey(key)) return sentence;
    return LANGUAGES[of][key].replace("{sentence}", sentence);
}

/**
 * Texts of the elements of a page: data-text is the key of its text, data-title of its tooltip, data-label of its
 * name for screen readers.
 * @param {Document} page
 */
export function fillTexts(page) {
    page.documentElement.lang = language;
    for (const element of /** @type {NodeListOf<HTMLElement>} */ (page.querySelectorAll("[data-text]")))
        element.textContent = text(/** @type {TextKey} */ (element.dataset.text));
    for (const element of /** @type {NodeListOf<HTMLElement>} */ (page.querySelectorAll("[data-title]")))
        element.title = text(/** @type {TextKey} */ (element.dataset.title));
    for (const element of /** @type {NodeListOf<HTMLElement>} */ (page.querySelectorAll("[data-label]")))
        element.ariaLabel = text(/** @type {TextKey} */ (element.dataset.label));
}

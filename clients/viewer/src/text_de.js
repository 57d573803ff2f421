// Deutsche Texte der Seite: dieselben Schlüssel wie text_en.js.
/** @type {Record<keyof typeof import("./text_en.js").ENGLISH, string>} */
export const GERMAN = {
    "tools.pull": "Ziehen",
    "tools.pull.tip": "Gewebe mit dem Instrument ziehen (1)",
};

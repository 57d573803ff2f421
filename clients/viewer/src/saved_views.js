// Views that a user has saved, and the way from one to another. Pure.

/** @typedef {{kind: "free" | "endoscope", values: Record<string, number>}} Shot a view, as numbers by name */
export {};

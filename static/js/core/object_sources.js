/** What the letters in an object's `source` say: which sensors track it. */

/** The camera tracks it. @param {{source: string}} item */
export const isImaged = (item) => item.source.includes("V");

/** More than one sensor tracks it. @param {{source: string|null}} item */
export const isTrackedByTwo = (item) => (item.source ?? "").length > 1;

/** The meaning of an object's `source`: the sensors that track it. */

/** Whether the camera tracks it. @param {{source: string|null}} item */
export const isImaged = (item) => (item.source ?? "").includes("V");

/** Whether more than one sensor tracks it. @param {{source: string|null}} item */
export const isTrackedByTwo = (item) => (item.source ?? "").length > 1;

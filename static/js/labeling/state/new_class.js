/** Class of new labels, chosen in the bar and stored in this browser. */
import { memory } from "../../core/dom.js";
import { firstClass } from "./classes.js";

export const newLabel = () => memory.read("newLabel", firstClass());

/** @param {string} label */
export const setNewLabel = (label) => memory.write("newLabel", label);

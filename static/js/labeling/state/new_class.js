/** Class of new labels, chosen in the bar and stored in this browser. */
import { memory } from "../../core/dom.js";
import { CLASSES } from "../views/cuboid.js";

export const newLabel = () => memory.read("newLabel", CLASSES[0]);

/** @param {string} label */
export const setNewLabel = (label) => memory.write("newLabel", label);

/** Keys of the whole page (keymap.js); not while somebody types, and a focused slider keeps its arrows. */
import { keymap } from "./keymap.js";

export function setUp() {
  const bindings = keymap().flatMap((group) => group.bindings);
  document.addEventListener("keydown", (event) => {
    if (event.altKey || event.defaultPrevented || isTaken(event)) return;
    const name = nameOf(event), binding = bindings.find(({ keys, isOn }) => keys.includes(name) && (isOn?.() ?? true));
    if (!binding) return;
    event.preventDefault();
    binding.act();
  });
}

/** "Shift+1" whatever the keyboard prints there, "Ctrl+z", "?", "Space". @param {KeyboardEvent} event */
function nameOf({ key, code, shiftKey, ctrlKey, metaKey }) {
  const digit = /^Digit(\d)$/.exec(code)?.[1];
  const bare = key === " " ? "Space" : shiftKey && digit ? digit : key.length === 1 && !shiftKey ? key.toLowerCase() : key;
  const isSaid = shiftKey && (digit !== undefined || bare.length > 1 || bare.toLowerCase() !== bare.toUpperCase());
  return `${ctrlKey || metaKey ? "Ctrl+" : ""}${isSaid ? "Shift+" : ""}${bare}`;
}

/** True when the focused element means the key for itself. @param {KeyboardEvent} event */
function isTaken({ target, key, ctrlKey, metaKey }) {
  if (document.querySelector("dialog[open]") || (key === "Escape" && document.querySelector(":popover-open"))) return true;
  if (!(target instanceof HTMLElement)) return false;
  if (target.matches("select, textarea, input:not([type=range]):not([type=checkbox])")) return true;
  if (ctrlKey || metaKey) return false;
  if (target.matches("input[type=range]")) return key.startsWith("Arrow") || key === "Home" || key === "End";
  return key === " " && target.matches("button, summary, input, a");
}

/** All keyboard shortcuts: their actions and their help texts. */
import { toggleAlign } from "../align/mode.js";
import * as pairs from "../align/pairs.js";
import { playback } from "../core/api.js";
import { toDifference, toEvent } from "../drive/jumps.js";
import { seekTo } from "../drive/seek.js";
import * as shuttle from "../drive/shuttle.js";
import * as help from "./help.js";
import { withOwn } from "./own_keys.js";
import { labelKeys } from "../labeling/keys.js";
import * as labeling from "../labeling/state/mode.js";
import * as sources from "../panels/open_dialog.js";
import { get, set } from "../core/store.js";
import { toggleTape } from "../views/measuring_tape.js";
import * as clip from "../timeline/clip.js";
import { addMark } from "../timeline/events_list.js";
import { fit, zoom } from "../timeline/pane.js";
import { shiftSpeed, toggleLoop, togglePlay } from "../panels/playback_bar.js";
import { redo, undo } from "../panels/undo.js";
import { grow, nextTab, toggle, toggleInspector, toggleTab } from "../workspace/panes.js";
import { share } from "../workspace/share_link.js";
import { toggleTheme } from "../workspace/theme.js";

/**
 * keys: as `nameOf` in keyboard.js returns them; isOn: whether the binding is active, the first active one wins.
 * Bindings without words are not listed in the help.
 * id: its default keys, as `own_keys.js` names it; isOwn: whether the user changed its key.
 * @typedef {{keys: string[], shown: string, words: string, act: () => unknown, isOn?: () => boolean, id?: string,
 *   isOwn?: boolean}} Binding
 */
/**
 * mode: keys of a mode take precedence while it is on.
 * @typedef {{title: string, mode?: string, bindings: Binding[]}} Group
 */

/**
 * @param {string} keys separated by spaces
 * @param {string} shown
 * @param {string} words
 * @param {() => void} act
 * @returns {Binding}
 */
const key = (keys, shown, words, act) => ({ keys: keys.split(" "), shown, words, act });
const last = () => Math.max(0, (get("state")?.count ?? 1) - 1);

/** The keymap with this person's changed keys. @returns {Group[]} */
export const keymap = () => withOwn(defaults());

/** @returns {Group[]} */
const defaults = () => [
  ...labelKeys(),
  {
    title: "Aligning by pairs",
    mode: "pairs",
    bindings: [
      { ...key("Ctrl+z", "Ctrl Z", "undo the last pair added or removed", pairs.undo), isOn: pairs.isUndoNext },
      { ...key("Escape", "Esc", "release the picked LiDAR point", pairs.release), isOn: pairs.isPicked },
    ],
  },
  {
    title: "Playback",
    bindings: [
      key("Space", "Space", "play or pause", togglePlay),
      key("ArrowLeft", "←", "previous frame", () => playback({ step: -1 })),
      key("ArrowRight", "→", "next frame", () => playback({ step: 1 })),
      key("Shift+ArrowLeft", "Shift ←", "back 10 frames", () => playback({ step: -10 })),
      key("Shift+ArrowRight", "Shift →", "forward 10 frames", () => playback({ step: 10 })),
      key("j", "J", "play backwards; again to speed up", shuttle.backward),
      key("k", "K", "pause", shuttle.stop),
      key("l", "L", "play forwards; again to speed up", shuttle.forward),
      key("Home", "Home", "first frame", () => seekTo(0)),
      key("End", "End", "last frame", () => seekTo(last())),
      key("[", "[", "slower", () => shiftSpeed(-1)),
      key("]", "]", "faster", () => shiftSpeed(1)),
      key("r", "R", "loop", toggleLoop),
    ],
  },
  {
    title: "Timeline",
    bindings: [
      key("e", "E", "next event", () => toEvent(1)),
      key("Shift+E", "Shift E", "previous event", () => toEvent(-1)),
      key("x", "X", "next difference between the two runs", () => toDifference(1)),
      key("Shift+X", "Shift X", "previous difference", () => toDifference(-1)),
      key("i", "I", "set clip start", clip.markIn),
      key("o", "O", "set clip end", clip.markOut),
      key("t", "T", "mark this frame", addMark),
      key("+ =", "+", "zoom in", () => zoom(1)),
      key("- )", "−", "zoom out", () => zoom(-1)), // ): in the place of −, where the − of French is that of the 6
      key("0", "0", "show the whole drive", fit),
    ],
  },
  {
    title: "Views",
    bindings: [
      key("1", "1", "camera", () => toggle("camera")),
      key("2", "2", "plan", () => toggleTab("plan")),
      key("3", "3", "3D", () => toggleTab("3d")),
      key("4", "4", "objects", () => toggle("objects")),
      key("5", "5", "why", () => toggle("why")),
      key("6", "6", "parameters", () => toggle("params")),
      key("7", "7", "timeline", () => toggle("timeline")),
      key("Shift+1", "Shift 1", "maximize camera", () => grow("camera")),
      key("m Shift+2", "M", "maximize plan or 3D", () => grow("plan")),
      key("Shift+4", "Shift 4", "maximize objects", () => grow("objects")),
      key("b", "B", "switch between plan and 3D", nextTab),
      key("p", "P", "show or hide Why and Parameters", toggleInspector),
      key("g", "G", "measuring tape (or Shift + drag)", toggleTape),
      key("a", "A", "align LiDAR and camera", toggleAlign),
      key("Shift+L", "Shift L", "labeling mode", labeling.toggle),
    ],
  },
  {
    title: "General",
    bindings: [
      key("Ctrl+z", "Ctrl Z", "undo your last label or parameter change", undo),
      key("Ctrl+Shift+Z Ctrl+y", "Ctrl Shift Z", "redo", redo),
      key("c", "C", "copy a link to this view", share),
      key("f", "F", "open a recording", sources.open),
      key("d", "D", "dark or light theme", toggleTheme),
      key("Escape", "Esc", "deselect", () => set("selection", null)),
      key("?", "?", "show this help", help.show),
    ],
  },
];

/** The outcome of a task, beside the answer to what was done meanwhile. */

/** The last message that was joined, and what it said before. */
let last = { whole: "", before: "" };

/**
 * @param {string} now the message that is shown
 * @param {string} note the outcome
 * @returns {string} both; the outcome of an earlier task is left out
 */
export function besides(now, note) {
  const before = now === last.whole ? last.before : now;
  last = { whole: [before, note].filter(Boolean).join(" · "), before };
  return last.whole;
}

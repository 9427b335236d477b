/**
 * Types of pairs picked by hand, as the server answers (app/web/routes/alignment/pairs.py).
 * `tests/app/page/test_page_types.py` checks every key against real messages.
 *
 * @typedef {object} PairsAnswer
 * @property {([number, number]|null)[]} present
 * @property {PairFit|null} fit
 * @property {string} text
 *
 * @typedef {object} PairFit
 * @property {Record<string, number|string>} changes
 * @property {Record<string, number>} sigmas
 * @property {([number, number]|null)[]} fitted
 * @property {number} rms_px
 * @property {number[]} outliers
 * @property {string[]} warnings
 */
export {};

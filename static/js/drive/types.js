/**
 * Types of whole-drive messages (app/web/routes/): columns, events, runs and export jobs.
 * `tests/app/page/test_page_types.py` checks every key against real messages.
 * @typedef {import("../core/types.js").AccState} AccState
 * @typedef {import("../core/types.js").ParamValue} ParamValue
 * @typedef {import("../core/types.js").ObjectSource} ObjectSource
 * @typedef {object} Columns one entry per frame; CIPV values are null without a CIPV
 * @property {(number|null)[]} cipv_id
 * @property {(ObjectSource|null)[]} source
 * @property {(boolean|null)[]} carried
 * @property {(number|null)[]} distance_m
 * @property {(number|null)[]} closing_speed_mps
 * @property {(number|null)[]} ttc_s
 * @property {(number|null)[]} path_offset_m
 * @property {(number|null)[]} speed_mps
 * @property {(number|null)[]} desired_speed_mps
 * @property {(number|null)[]} accel_mps2
 * @property {(number|null)[]} brake
 * @property {(AccState|null)[]} acc_state
 * @property {(number|null)[]} next_cipv_id
 * @property {number[]} objects
 * @property {string[]} gaps
 * @property {(number|null)[]} vl_disagreement_m
 * @property {number[]} notes
 * @typedef {{[K in keyof Columns]: Columns[K][number]}} Row one frame's value of each column
 * @typedef {object} ColumnsAnswer
 * @property {number} run
 * @property {string} uri
 * @property {number} count
 * @property {number} from
 * @property {number} done
 * @property {number[]} t_s
 * @property {number[]} clips
 * @property {Columns} columns
 * @typedef {object} DriveEvent
 * @property {string} kind
 * @property {number} index
 * @property {number} t_s
 * @property {string} text
 * @property {number[]} ids
 * @property {"info"|"notice"|"warning"|"alarm"} severity
 * @property {number|null} mark
 * @typedef {object} ObjectCurve
 * @property {number} id
 * @property {number} run
 * @property {number[]} index
 * @property {ObjectSource[]} source
 * @property {(number|null)[]} distance_m
 * @property {(number|null)[]} closing_speed_mps
 * @property {(number|null)[]} ttc_s
 * @property {(number|null)[]} path_offset_m
 * @property {boolean[]} in_path
 * @property {boolean[]} carried
 * @property {(number|null)[]} vl_gap_m
 * @typedef {object} Run
 * @property {number} id
 * @property {string} name
 * @property {string} label
 * @property {string} digest
 * @property {string} preset
 * @property {Record<string, [ParamValue, ParamValue]>} changes
 * @property {number} done
 * @property {number} total
 * @property {string} phase
 * @property {string} note
 * @property {boolean} kept
 * @property {number|null} seconds
 * @typedef {object} Metric
 * @property {string} name
 * @property {string} unit
 * @property {number|null} base
 * @property {number|null} run
 * @property {"higher"|"lower"|null} better
 * @typedef {object} Comparison
 * @property {number} base
 * @property {number} run
 * @property {number} done
 * @property {[number, number][]} differing
 * @property {number} frames_differing
 * @property {Record<string, string>} first
 * @property {Metric[]} metrics
 * @property {"labels"|"recording"|"simulator"|null} truth who judges
 * @property {number} judged
 * @typedef {object} Job
 * @property {string} id
 * @property {string} kind
 * @property {number} first
 * @property {number} last
 * @property {"waiting"|"running"|"done"|"failed"|"cancelled"} state
 * @property {number} progress
 * @property {string} note
 * @property {string|null} file
 * @property {number|null} bytes
 * @typedef {object} Series columns of one run, as far as computed
 * @property {number} run
 * @property {number} done
 * @property {Columns} columns
 * @typedef {object} Drive assembled by drive/sync.js
 * @property {string|null} uri
 * @property {number} count
 * @property {number[]} t_s
 * @property {number[]} clips frame at which each clip of the recording begins
 * @property {Series|null} now
 * @property {Series|null} base null without a comparison
 * @property {DriveEvent[]} events
 * @property {Comparison|null} comparison
 */
export {};

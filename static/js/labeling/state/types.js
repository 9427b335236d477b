/**
 * Types of label messages (app/web/routes/, pipeline/labels/model.py). `tests/app/page/test_page_types.py` checks every
 * key against real messages.
 * @typedef {"proposed"|"accepted"|"corrected"|"rejected"} LabelState
 * @typedef {number|"none"|"unknown"} Lead a track, no lead, or lead unclear
 * @typedef {"track"|"lead"|"path"|"event"|"tag"} ItemKind
 * @typedef {[number, number, number, number]} Box x1 y1 x2 y2, pixels of the full camera image
 * @typedef {object} Cuboid ego frame, metres and radians
 * @property {[number, number, number]} center
 * @property {[number, number, number]} size
 * @property {number} yaw_rad
 * @typedef {object} LabelOrigin
 * @property {"pipeline"|"person"|"import"} maker
 * @property {string} name
 * @property {number} t_unix_ms
 * @property {string|null} params
 * @property {string|null} calibration
 * @property {string} how how its position was measured, if a person only pointed at it
 * @typedef {object} LabelTrack
 * @property {number} id
 * @property {number} revision
 * @property {string} label
 * @property {LabelState} state
 * @property {LabelOrigin} origin
 * @property {string} comment why it was sent back
 * @property {string} reviewer who approved it, other than its author; "" if not reviewed
 * @property {string} author who set or accepted it, and cannot review it; "" if nobody has
 * @property {number|null} confidence of a proposal, 0–1; null for others
 * @property {""|"motion"|"lane"|"unknown"} heading what told its front from its rear; "" once somebody has looked
 * @property {{first: number, last: number, name: string, value: string}[]} attributes
 * @property {number|null} first null if the track is in no frame
 * @property {number|null} last
 * @property {number[]} keyframes
 * @property {number} sightings
 * @typedef {object} LabelSighting of one frame
 * @property {number} track
 * @property {Cuboid|null} cuboid
 * @property {Box|null} bbox
 * @property {boolean} keyframe
 * @property {boolean} box_set somebody set the box; else it follows the cuboid, if there is one
 * @property {number|null} truncation share of it outside the image, 0–1
 * @property {number|null} occlusion 0 visible, 1 partly, 2 largely hidden
 * @typedef {object} LabelClass
 * @property {string} name
 * @property {string|null} of the class that it is a kind of
 * @property {[number, number, number]|null} size usual length, width, height
 * @property {Record<string, string>} exports what formats call it
 * @typedef {object} AttributeKind
 * @property {string} name
 * @property {string[]} values
 * @typedef {object} LeadRange both ends included
 * @property {number} id
 * @property {number} revision
 * @property {number} first
 * @property {number} last
 * @property {Lead} lead
 * @property {LabelState} state
 * @property {LabelOrigin} origin
 * @property {string} comment
 * @property {string} reviewer
 * @property {string} author
 * @typedef {object} EventLabel
 * @property {number} id
 * @property {number} revision
 * @property {number} frame
 * @property {string} kind
 * @property {number[]} tracks
 * @property {LabelState} state
 * @property {LabelOrigin} origin
 * @property {string} comment
 * @property {string} reviewer
 * @property {string} author
 * @typedef {object} FrameTag both ends included
 * @property {number} id
 * @property {number} revision
 * @property {number} first
 * @property {number} last
 * @property {string} tag
 * @property {LabelOrigin} origin
 * @typedef {object} PathLabel
 * @property {number} id
 * @property {number} revision
 * @property {number} frame
 * @property {[number, number][]|null} left
 * @property {[number, number][]|null} right
 * @property {LabelState} state
 * @property {LabelOrigin} origin
 * @property {string} comment
 * @property {string} reviewer
 * @property {string} author
 * @typedef {object} LabelTask
 * @property {number} id same id as in the 202 response that started it
 * @property {"propose"|"import"} what
 * @property {number} done
 * @property {number} total
 * @property {string} note
 * @property {string|null} error why it failed
 * @property {boolean} running false: finished, kept until the next one starts
 * @typedef {object} LabelsState in the stream's state
 * @property {number} revision number of acts on the drive
 * @property {LabelTask|null} task
 * @typedef {object} LabelsAnswer what changed since a revision
 * @property {number} revision
 * @property {{id: string, uri: string, count: number}} drive
 * @property {LabelTrack[]} tracks
 * @property {LeadRange[]} leads
 * @property {PathLabel[]} paths
 * @property {EventLabel[]} events
 * @property {FrameTag[]} tags
 * @property {{kind: ItemKind, id: number}[]} removed
 * @typedef {object} SightingsAnswer
 * @property {number} revision
 * @property {Record<string, LabelSighting[]>} sightings by frame
 * @typedef {object} ActAnswer
 * @property {number} revision
 * @property {number|null} act null when nothing changed
 * @property {string} what in a few words
 * @property {LabelsAnswer|null} changed
 * @property {string} note
 * @typedef {object} Still one frame of a track's filmstrip
 * @property {number} frame
 * @property {"keyframe"|"end"|"fits worst"} why
 * @property {number|null} inside points in its cuboid
 * @property {number|null} beside points right beside it
 * @typedef {object} Problem what can hardly be so
 * @property {number} frame
 * @property {number|null} track
 * @property {string} words
 * @typedef {object} Found where there is something to do
 * @property {number|null} frame
 * @property {string} why
 * @property {{kind: ItemKind, id: number}|null} item the label, if it is a single one
 * @property {number} left number of open items in the whole drive
 * @typedef {object} PastAct
 * @property {number} act
 * @property {string} what
 * @property {string} note remark
 * @property {string} person
 * @property {number} t_unix_ms
 * @property {any} before
 * @property {any} after
 * @property {boolean} undone
 * @typedef {object} Version
 * @property {string} name
 * @property {string} person
 * @property {number} t_unix_ms
 * @property {number} tracks
 * @property {number} frames
 * @property {string} signed_by public key, empty where it is not signed
 * @typedef {object} Score
 * @property {number} revision
 * @property {number} run
 * @property {number} judged frames with a labelled lead
 * @property {import("../../drive/types.js").Metric[]} metrics
 * @property {string[]} notes what is not scored, and why
 * @property {ScoreErrors[]} errors by range and by sensor
 * @property {BadFrame[]} worst the worst first
 * @typedef {object} ScoreErrors
 * @property {string} vehicles
 * @property {string} seen_by
 * @property {number} count
 * @property {Sizes|null} distance
 * @property {Sizes|null} lateral
 * @property {Sizes|null} longitudinal
 * @property {Sizes|null} speed
 * @typedef {object} Sizes of errors, m or m/s
 * @property {number} min
 * @property {number} max
 * @property {number} mae
 * @typedef {object} BadFrame
 * @property {number} frame
 * @property {"correct"|"none"|"missed"|"false"|"wrong"} verdict
 * @property {number|null} truth_m
 * @property {number|null} error_m
 * @typedef {{kind: ItemKind, id: number, revision: number}} ItemRef
 * @typedef {{kind: string, [field: string]: any}} Act one change, as POST /api/labels/act takes it
 */
export {};

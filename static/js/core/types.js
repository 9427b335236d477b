/**
 * Types of server messages. `tests/app/page/test_page_types.py` checks every key against real messages.
 * The binary layout is in app/streaming/encode.py, routes are in app/web/routes/.
 *
 * @typedef {[number, number]} Point2
 * @typedef {(Point2|null)[]} Pixels
 * @typedef {string} ObjectSource  letters of the sensors: V camera, L LiDAR, VL both
 *
 * @typedef {object} Gate
 * @property {string} name
 * @property {number|null} value
 * @property {number|null} limit
 * @property {boolean} passed
 *
 * @typedef {object} FusedObject
 * @property {number} id
 * @property {ObjectSource} source
 * @property {string|null} type
 * @property {number|null} type_score
 * @property {[number, number, number, number]|null} bbox
 * @property {Point2[]|null} bev
 * @property {{center: number[], size: number[], yaw_rad: number}|null} cuboid
 * @property {[number, number, number]|null} closest_point
 * @property {number|null} distance_m
 * @property {number|null} distance_sigma_m
 * @property {Point2|null} velocity_mps
 * @property {number|null} speed_over_ground_mps
 * @property {number|null} speed_over_ground_sigma_mps  its standard deviation
 * @property {boolean} in_path
 * @property {number|null} existence_probability
 * @property {number|null} in_path_probability
 * @property {number|null} path_offset_m
 * @property {boolean|null} moving
 * @property {number|null} ttc_s
 * @property {boolean} carried
 * @property {""|ObjectSource} seen_by
 * @property {number} hits
 * @property {number} lidar_points
 * @property {string|null} distance_from  what measured it in this frame
 * @property {"class"|"shape"|"road"|"range"|null} height_from  what its height, on which that rests, was taken from
 * @property {number|null} lateral_mps
 * @property {number|null} crossing_s
 * @property {Gate[]} gates
 *
 * @typedef {object} Cipv
 * @property {number} id
 * @property {number} distance_m
 * @property {number|null} closing_speed_mps
 * @property {number|null} ttc_s
 * @property {string} reason
 * @property {number|null} [accel_mps2]  over ground
 * @property {number|null} [accel_sigma_mps2]
 *
 * @typedef {object} Path
 * @property {string} source
 * @property {Point2[]} center
 * @property {Point2[]} left
 * @property {Point2[]} right
 * @property {Record<string, number|null>} sigma_m
 * @property {Record<string, number|null>} weights
 * @property {number|null} confidence
 * @property {boolean} usable
 * @property {number|null} reach_m
 * @property {Record<string, Record<string, number|null>>} carried_by
 *
 * @typedef {"cruise"|"follow"|"stop"|"warn"|"partial_brake"|"full_brake"} AccState
 *
 * @typedef {object} Acc
 * @property {AccState} state
 * @property {number} desired_speed_mps
 * @property {number} accel_mps2
 * @property {number} accelerator
 * @property {number} brake
 * @property {string} reason
 * @property {number|null} object_id  object it slows down for
 *
 * @typedef {object} OwnMotion  where own speed and yaw rate are from
 * @property {"can"|"ins"|"gnss"|"lidar"} speed_from
 * @property {number|null} speed_sigma_mps
 * @property {string|null} yaw_rate_from
 * @property {number|null} yaw_rate_sigma_radps
 * @property {number[]|null} pose
 * @property {{source: string, speed_mps: number, yaw_rate_radps: number|null}[]} sources
 *
 * @typedef {object} Result
 * @property {number} version
 * @property {string} frame
 * @property {number} t_ns
 * @property {Record<string, Record<string, any>>} sensors
 * @property {{speed_mps: number, yaw_rate_radps: number|null}|null} ego
 * @property {OwnMotion|null} own_motion
 * @property {FusedObject[]} objects
 * @property {Path} path
 * @property {Cipv|null} cipv
 * @property {Cipv|null} next_cipv
 * @property {{id: number, reason: string}[]} rejected
 * @property {Acc|null} acc
 * @property {string[]} notes
 * @property {Record<string, number|null>} timing_ms
 *
 * @typedef {object} Notice
 * @property {"info"|"warning"|"error"} level
 * @property {string} text
 *
 * @typedef {object} State
 * @property {string|null} uri
 * @property {string} title
 * @property {number} rate_hz
 * @property {number} count
 * @property {number} index
 * @property {string|null} frame
 * @property {number} time_s
 * @property {number} duration_s
 * @property {boolean} playing
 * @property {number} speed
 * @property {boolean} loop
 * @property {string|null} busy
 * @property {string|null} detector
 * @property {string} preset
 * @property {number} params_revision
 * @property {number} sequence
 * @property {number} skipped
 * @property {Notice[]} notices
 * @property {string|null} lane_detector
 * @property {boolean} live
 * @property {Record<string, any>} streams
 * @property {RecordingState|null} recording
 * @property {boolean} provisional
 * @property {DriveState} drive
 * @property {boolean} can_undo
 * @property {boolean} can_redo
 * @property {import("../labeling/state/types.js").LabelsState|null} labels  null if labeling is unavailable
 *
 * @typedef {object} RecordingState
 * @property {string} file
 * @property {number} frames
 * @property {number} seconds
 * @property {number} bytes
 * @property {number} dropped
 * @property {string|null} error
 * @property {string|null} dropped_because
 * @property {string|null} trouble
 *
 * @typedef {object} DriveState
 * @property {number} revision
 * @property {number|null} run
 * @property {number|null} base
 * @property {number} done
 * @property {number} total
 * @property {boolean} running
 * @property {"detect"|"run"|"done"|"failed"} phase
 * @property {string} note
 *
 * @typedef {object} Display
 * @property {Record<string, [number, number, number, number]>} lidar_boxes
 * @property {Record<string, [number, number, number, number]>} vision_boxes
 * @property {[number, number, number, number]|null} far_view  window of the detector's second look
 * @property {[number, number, number, number]|null} lanes_far_view  the only part in which lane lines were looked for
 * @property {Record<string, Pixels>} cuboids
 * @property {{center: Pixels, left: Pixels, right: Pixels}|null} path
 * @property {{left: Pixels, right: Pixels}|null} lanes
 * @property {{left: Point2[], right: Point2[]}|null} plan_lanes
 * @property {Point2[]|null} plan_edges
 * @property {Point2[]|null} plan_drivable  edges of the drivable area in the image
 * @property {[number, number, number][]|null} plan_traffic  x, y, heading of vehicles that show where the road goes
 * @property {GroundPlanes|null} ground
 * @property {Record<string, {distance_m: number, sigma_m: number}>} vision_ranges  camera-only range estimates
 * @property {Ranked[]} ranking
 *
 * @typedef {object} GroundPlanes  n·p + d = 0 between neighbouring edges of x
 * @property {number[]} edges
 * @property {[number, number, number, number][]} planes
 *
 * @typedef {object} Ranked  a candidate for CIPV: the lead is order 1; `stopped_by` is the first gate it failed
 * @property {number} id
 * @property {number} order
 * @property {number|null} distance_m
 * @property {string|null} stopped_by
 * @property {number|null} value
 * @property {number|null} limit
 * @property {string} reason
 *
 * @typedef {object} SentImage  as sent; scale: sent pixels per camera pixel
 * @property {number} width
 * @property {number} height
 * @property {number} scale
 * @property {number} bytes
 * @property {number} full_height  pixels of the camera, as full_width
 * @property {number} full_width
 *
 * @typedef {object} Frame  one decoded message: see protocol.js
 * @property {number} madeUnixMs
 * @property {number} detectMs
 * @property {State} state
 * @property {Result} result
 * @property {Display} display
 * @property {import("../drive/types.js").Row|null} row  of live sensors only
 * @property {boolean} [isLate]
 * @property {SentImage|null} image
 * @property {ImageBitmap|null} bitmap
 * @property {number} count
 * @property {Int16Array} xyz
 * @property {Int16Array} uv
 * @property {Uint16Array} owner
 * @property {Uint8Array} kind
 * @property {Uint8Array} intensity
 * @property {Uint8Array} ring
 * @property {Uint8Array} age
 *
 * @typedef {number|string|boolean|null} ParamValue
 *
 * @typedef {object} Param
 * @property {string} key
 * @property {string} help
 * @property {"number"|"integer"|"boolean"|"choice"} kind
 * @property {number} [min]
 * @property {number} [max]
 * @property {number} [step]
 * @property {string} [unit]
 * @property {string[]} [choices]
 * @property {boolean} nullable
 *
 * @typedef {object} ParamsAnswer
 * @property {string} preset
 * @property {string[]} presets
 * @property {number} revision
 * @property {{name: string, help: string, params: Param[]}[]} sections
 * @property {Record<string, ParamValue>} values
 * @property {Record<string, ParamValue>} base
 * @property {Record<string, number>} effective
 * @property {boolean} can_undo
 * @property {boolean} can_redo
 *
 * @typedef {object} AlignmentScore
 * @property {number|null} score
 * @property {number|null} sigmas
 * @property {number} borders
 * @property {Record<string, number>} better
 * @property {string} brief
 * @property {string} text
 * @property {number} columns
 * @property {number} rows
 * @property {MatchRegion[]} regions
 * @property {MatchRange[]} ranges
 *
 * @typedef {object} MatchRegion
 * @property {number} borders
 * @property {number|null} score
 * @property {[number, number]|null} shift_px
 *
 * @typedef {object} MatchRange
 * @property {number} borders
 * @property {number|null} score
 * @property {[number, number]|null} shift_px
 * @property {number} from_m
 * @property {number|null} to_m
 *
 * @typedef {object} FitProgress
 * @property {"none"|"waiting"|"running"|"done"|"failed"|"cancelled"} state
 * @property {number} progress
 * @property {string} note
 *
 * @typedef {object} AlignmentFitResult
 * @property {Record<string, number|string>} changes
 * @property {Record<string, number>} sigmas
 * @property {number} frames
 * @property {number} pairs
 * @property {number|null} iou_before
 * @property {number} iou_after
 * @property {string} text
 * @property {string[]} warnings
 *
 * @typedef {object} AlignmentImport
 * @property {string} format
 * @property {Record<string, number|string>} changes
 * @property {string} text
 * @property {string[]} warnings
 *
 * @typedef {object} TimeFitResult
 * @property {Record<string, number>} changes
 * @property {Record<string, number>} sigmas
 * @property {number} images
 * @property {number} speeds
 * @property {string[]} warnings
 *
 * @typedef {object} AlignmentVersion
 * @property {number} id
 * @property {string} saved_at
 * @property {string} drive
 * @property {string} note
 * @property {Record<string, ParamValue>} values
 * @property {number|null} match
 * @property {number|null} iou
 * @property {boolean} is_present
 */
export {};

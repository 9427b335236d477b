/**
 * Shapes of what the server sends; see app/encode.py for the message and the contract for the result.
 *
 * @typedef {[number, number]} Point2
 * @typedef {{name: string, value: number|null, limit: number|null, passed: boolean}} Gate
 * @typedef {{id: number, source: "V"|"L"|"VL", type: string|null, type_score: number|null, bbox: number[]|null,
 *   bev: Point2[]|null, cuboid: object|null, closest_point: number[]|null, distance_m: number|null,
 *   distance_sigma_m: number|null, velocity_mps: Point2|null, speed_over_ground_mps: number|null, in_path: boolean,
 *   in_path_probability: number|null, path_offset_m: number|null, moving: boolean|null, ttc_s: number|null,
 *   carried: boolean, hits: number, lidar_points: number, gates: Gate[]}} FusedObject
 * @typedef {{id: number, distance_m: number, closing_speed_mps: number|null, ttc_s: number|null, reason: string}} Cipv
 * @typedef {{source: string, center: Point2[], left: Point2[], right: Point2[]}} Path
 * @typedef {{state: string, desired_speed_mps: number, accel_mps2: number, accelerator: number, brake: number,
 *   reason: string}} Acc
 * @typedef {{frame: string, t_ns: number, objects: FusedObject[], path: Path, cipv: Cipv|null,
 *   rejected: {id: number, reason: string}[], acc: Acc|null, notes: string[], timing_ms: Record<string, number>,
 *   ego: {speed_mps: number, yaw_rate_radps: number|null}|null, sensors: Record<string, Record<string, number|null>>
 *   }} Result
 * @typedef {{uri: string|null, title: string, rate_hz: number, count: number, index: number, frame: string|null,
 *   time_s: number, duration_s: number, playing: boolean, speed: number, loop: boolean, busy: string|null,
 *   detector: string|null, preset: string, params_revision: number, sequence: number, skipped: number,
 *   notices: {level: string, text: string}[]}} State
 * @typedef {(Point2|null)[]} Pixels
 * @typedef {{lidar_boxes: Record<string, number[]>, vision_boxes: Record<string, number[]>,
 *   cuboids: Record<string, Pixels>, path: {center: Pixels, left: Pixels, right: Pixels}|null}} Display
 * @typedef {{madeUnixMs: number, detectMs: number, state: State, result: Result, display: Display,
 *   isLate?: boolean,
 *   picture: {width: number, height: number, scale: number}|null, bitmap: ImageBitmap|null,
 *   count: number, xyz: Int16Array, uv: Int16Array, owner: Uint16Array, kind: Uint8Array}} Frame
 */
export {};

/** The selected object over the whole drive, for the curves. */
import { newestOnly, request } from "../core/api.js";
import { get, on, set } from "../core/store.js";

let known = "";

const fetchCurve = newestOnly(async (/** @type {{id: number, run: number}} */ { id, run }) => {
  const curve = await request(`api/drive/object/${id}`).catch(() => null); // the run may have been deleted meanwhile
  if (get("selection") === id) set("curve", curve?.run === run ? curve : null);
});

export function setUp() {
  on(["selection", "drive"], follow);
}

function follow() {
  const id = get("selection"),
    now = get("drive")?.now;
  const key = `${id} ${now?.run} ${now?.done}`;
  if (key === known) return;
  known = key;
  if (get("curve")?.id !== id) set("curve", null);
  if (id !== null && now) fetchCurve({ id, run: now.run });
}

/** What this browser draws 3D with. */

/** Parts of the names of renderers that use no graphics card. */
const SOFTWARE = /swiftshader|llvmpipe|softpipe|software/i;

/** @returns {"none"|"software"|"card"} none: there is no WebGL 2; software: the processor draws, slowly */
export function webGl() {
  const found = document.createElement("canvas").getContext("webgl2");
  if (!found) return "none";
  const details = found.getExtension("WEBGL_debug_renderer_info");
  const renderer = details ? String(found.getParameter(details.UNMASKED_RENDERER_WEBGL)) : "";
  found.getExtension("WEBGL_lose_context")?.loseContext(); // a browser keeps only a few
  return SOFTWARE.test(renderer) ? "software" : "card";
}

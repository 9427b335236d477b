/** What this browser draws 3D with. */

/** After the name of a view. */
export const NEEDS_WEBGL = "needs WebGL 2, which this browser lacks or has switched off.";
/** Parts of the names of renderers that use no graphics card. */
const SOFTWARE = /swiftshader|llvmpipe|softpipe|software/i;

/** @returns {"none"|"software"|"card"} none: there is no WebGL 2; software: the processor draws, slowly */
export function webGl() {
  const found = document.createElement("canvas").getContext("webgl2");
  if (!found) return "none";
  const renderer = rendererOf(found);
  found.getExtension("WEBGL_lose_context")?.loseContext(); // a browser keeps only a few
  return SOFTWARE.test(renderer) ? "software" : "card";
}

/**
 * Its name: Firefox gives it at once, and warns of the extension that Chromium and Safari need for it.
 * @param {WebGL2RenderingContext} gl
 */
function rendererOf(gl) {
  const said = String(gl.getParameter(gl.RENDERER));
  const details = said.startsWith("WebKit") ? gl.getExtension("WEBGL_debug_renderer_info") : null;
  return details ? String(gl.getParameter(details.UNMASKED_RENDERER_WEBGL)) : said;
}

// How finely a picture is drawn: with fewer pixels, and without smoothing edges, where the
// browser draws by software.

const SOFTWARE = /swiftshader|llvmpipe|software|basic render/i;
const SOFTWARE_SHARE = 0.6;

// A WebGL context, or null, and how many pixels it draws for each of the page's.
export function openCanvas(canvas) {
  const software = SOFTWARE.test(renderer());
  const gl = canvas.getContext("webgl2", { antialias: !software });
  const ratio = () => (software ? SOFTWARE_SHARE : Math.min(devicePixelRatio, 2));
  return { gl, ratio };
}

// What draws, as far as the browser says: asked of a canvas of its own.
function renderer() {
  const gl = document.createElement("canvas").getContext("webgl2");
  const info = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = info ? gl.getParameter(info.UNMASKED_RENDERER_WEBGL) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return name;
}

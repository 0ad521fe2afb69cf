// Looks of colours, wherever pictures are shown: as the server's PNG, plainly, by stops.

import { serversView } from "../layers/display.js";

export const LOOKS = [["display", "As the PNG"], ["srgb", "Plain sRGB"], ["false", "False colour"]];
export const KEY_STOPS = 0.5; // of exposure
export const EXPOSE_AFTER_S = 0.06; // a slider that is dragged causes a request for its last position only

// Resolves to the look that paint() needs for a layer; the server's view is fetched when it is first used. `files` are
// settings of the job's files, whose exposure the PNG has too.
export async function lookOf(look, layer, stops, channel = "rgb", files = {}) {
  const asPng = look === "display" && layer.kind === "color" && layer.isLight;
  const view = asPng ? await serversView(layer.space, files) : null;
  const own = asPng && Number.isFinite(files.exposure) ? files.exposure : 0;
  return { stops: stops + own, channel, isFalse: look === "false", view };
}

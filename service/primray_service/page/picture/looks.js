// How colours are looked at, wherever pictures are shown: as the server's PNG, plainly, by stops.

import { serversView } from "../layers/display.js";

export const LOOKS = [["display", "As the PNG"], ["srgb", "Plain sRGB"], ["false", "False colour"]];
export const KEY_STOPS = 0.5; // of exposure
export const EXPOSE_AFTER_S = 0.06; // a slider that is dragged asks for the last place only

// What paint() wants to know of how a layer is looked at; the server's view is fetched when light is first seen through it.
export async function lookOf(look, layer, stops, channel = "rgb") {
  const view = look === "display" && layer.kind === "color" && layer.isLight ? await serversView(layer.space) : null;
  return { stops, channel, isFalse: look === "false", view };
}

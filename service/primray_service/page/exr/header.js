// Reads the headers of an OpenEXR file: its parts with channels, windows, compression and attributes. Flat scanline parts are
// supported, one or several, as the renderer writes them ("OpenEXR File Layout", openexr.com, version 2).

const MAGIC = 20000630;
const [TILED, DEEP, MULTIPART] = [0x200, 0x800, 0x1000];

export class BadExr extends Error {}

// The headers are longer than the bytes so far: fetch more.
export class NeedsMore extends Error {}

// Returns {parts, end, isMultipart}; the tables of offsets begin at `end`.
export function readHeaders(buffer) {
  const cursor = reading(buffer);
  if (cursor.u32() !== MAGIC) throw new BadExr("The file is no OpenEXR file.");
  const version = cursor.u32();
  if ((version & 0xff) !== 2 || version & (TILED | DEEP)) throw new BadExr("Only flat scanlines of OpenEXR 2 are shown here.");
  const isMultipart = (version & MULTIPART) !== 0;
  const parts = [];
  for (;;) {
    const attributes = header(cursor);
    if (attributes.size === 0) break; // an empty header ends the headers of several parts
    parts.push(part(attributes));
    if (!isMultipart) break;
  }
  return { parts, end: cursor.at(), isMultipart };
}

function header(cursor) {
  const attributes = new Map();
  for (let name = cursor.text(); name !== ""; name = cursor.text()) {
    const type = cursor.text();
    attributes.set(name, { type, view: cursor.bytes(cursor.u32()) });
  }
  return attributes;
}

function part(attributes) {
  const [x, y, right, bottom] = box(attributes, "dataWindow");
  const [left, top, farRight, farBottom] = box(attributes, "displayWindow");
  const [width, height] = [right - x + 1, bottom - y + 1];
  const channels = channelsOf(needed(attributes, "channels"));
  const compression = needed(attributes, "compression").getUint8(0);
  if (!(width > 0 && height > 0 && width <= 2 ** 17 && height <= 2 ** 17)) throw new BadExr("A part has an impossible size.");
  const rows = { 0: 1, 2: 1, 3: 16 }[compression];
  if (rows === undefined) throw new BadExr(`Compression number ${compression} is not read here.`);
  const strings = new Map();
  for (const [name, { type, view }] of attributes) if (type === "string") strings.set(name, textOf(view));
  return {
    name: strings.get("name") ?? "",
    x, y, width, height,
    frame: { x: left, y: top, width: farRight - left + 1, height: farBottom - top + 1 },
    channels,
    isPacked: compression !== 0,
    rows, // of one chunk
    chunks: Math.ceil(height / rows),
    strings,
  };
}

function needed(attributes, name) {
  const found = attributes.get(name);
  if (!found) throw new BadExr(`A part has no ${name}.`);
  return found.view;
}

function box(attributes, name) {
  const view = needed(attributes, name);
  return [0, 4, 8, 12].map((at) => view.getInt32(at, true));
}

const TYPES = ["uint", "half", "float"];

function channelsOf(view) {
  const cursor = reading(view.buffer, view.byteOffset);
  const found = [];
  for (let name = cursor.text(); name !== ""; name = cursor.text()) {
    const type = TYPES[cursor.u32()];
    cursor.bytes(4); // whether it is perceptually linear
    if (!type || cursor.u32() !== 1 || cursor.u32() !== 1) throw new BadExr("Channels with fewer samples than pixels are not read here.");
    found.push({ name, type });
  }
  return found;
}

const textOf = (view) => new TextDecoder().decode(new Uint8Array(view.buffer, view.byteOffset, view.byteLength));

function reading(buffer, start = 0) {
  const view = new DataView(buffer);
  let at = start;
  const take = (count) => {
    if (at + count > view.byteLength) throw new NeedsMore();
    at += count;
    return at - count;
  };
  return {
    at: () => at,
    u32: () => view.getUint32(take(4), true),
    bytes: (count) => new DataView(buffer, take(count), count),
    text: () => {
      const begin = at;
      while (view.getUint8(take(1)) !== 0);
      return textOf(new DataView(buffer, begin, at - 1 - begin));
    },
  };
}

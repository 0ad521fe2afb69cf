// Writes a zip of stored entries (no compression: USD's binary files and textures hardly shrink, and crates want to be
// mapped). The files' bytes are not copied: the result is a Blob that refers to them. APPNOTE.TXT 6.3.10, sections 4.3 and 4.4.

const TABLE = Uint32Array.from({ length: 256 }, (_, byte) => {
  let value = byte;
  for (let bit = 0; bit < 8; bit += 1) value = value & 1 ? 0xedb88320 ^ (value >>> 1) : value >>> 1;
  return value >>> 0;
});

export function crc32(bytes, previous = 0) {
  let value = ~previous;
  for (let at = 0; at < bytes.length; at += 1) value = TABLE[(value ^ bytes[at]) & 0xff] ^ (value >>> 8);
  return ~value >>> 0;
}

const LOCAL = 0x04034b50;
const CENTRAL = 0x02014b50;
const END = 0x06054b50;
const NAMES_ARE_UTF8 = 1 << 11;
// Equal files must give equal bytes, and so the same scene: the time is 1980-01-01, the first day that a zip can express.
const DATE = 0x21;
const MOST_BYTES = 0xffffffff; // more would need Zip64
const MOST_ENTRIES = 0xffff;

function record(size, fields) {
  const view = new DataView(new ArrayBuffer(size));
  let at = 0;
  for (const [width, value] of fields) {
    if (width === 2) view.setUint16(at, value, true);
    else view.setUint32(at, value, true);
    at += width;
  }
  return new Uint8Array(view.buffer);
}

// `entries` are [{path, file}]; `onProgress(bytes)` is called as they are read.
export async function stored(entries, onProgress = () => {}, signal = undefined) {
  const total = entries.reduce((sum, { file, path }) => sum + file.size + 2 * path.length * 3 + 76, 22);
  if (entries.length > MOST_ENTRIES) throw new Error(`${entries.length} files: one upload takes at most ${MOST_ENTRIES}.`);
  if (total > MOST_BYTES) throw new Error("More than 4 GiB: too large for one upload from the page.");
  const parts = [];
  const directory = [];
  let offset = 0;
  let done = 0;
  for (const { path, file } of entries) {
    const name = new TextEncoder().encode(path);
    let crc = 0;
    for await (const chunk of chunks(file)) {
      signal?.throwIfAborted();
      crc = crc32(chunk, crc);
      done += chunk.length;
      onProgress(done);
    }
    const shared = [
      [2, NAMES_ARE_UTF8],
      [2, 0], // stored
      [2, 0], // time
      [2, DATE],
      [4, crc],
      [4, file.size],
      [4, file.size],
      [2, name.length],
      [2, 0], // no extra field
    ];
    parts.push(record(30, [[4, LOCAL], [2, 20], ...shared]), name, file);
    const place = [[2, 0], [2, 0], [2, 0], [4, 0], [4, offset]]; // no comment, first disk, no attributes
    directory.push(record(46, [[4, CENTRAL], [2, 20], [2, 20], ...shared, ...place]), name);
    offset += 30 + name.length + file.size;
  }
  const size = directory.reduce((sum, part) => sum + part.length, 0);
  const counts = [[2, entries.length], [2, entries.length]];
  const end = record(22, [[4, END], [2, 0], [2, 0], ...counts, [4, size], [4, offset], [2, 0]]);
  return new Blob([...parts, ...directory, end], { type: "application/zip" });
}

async function* chunks(file) {
  const reader = file.stream().getReader();
  for (;;) {
    const { done, value } = await reader.read();
    if (done) return;
    yield value;
  }
}

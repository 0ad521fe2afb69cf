// Makes one file to upload of what was dropped or chosen: a scene or package as it is, several files or a folder packed into a
// zip.

import { stored } from "./zip.js";

const SCENE = /\.(usd|usda|usdc|usdz|zip)$/i;
const PICTURE = /\.(usd|usda|usdc|usdz)$/i;
// The server recognises these formats by name and first bytes, and says how to convert them.
const OTHER = /\.(glb|gltf|fbx|obj|stl|ply|abc|blend|ma|mb|max|c4d|hip|hiplc|hipnc|vdb)$/i;
const HEAD_BYTES = 256;
// Desktops leave these files in folders.
const LITTER = /(^|\/)(\.DS_Store|Thumbs\.db|desktop\.ini|\._[^/]*|__MACOSX\/.*|\.git\/.*)$/;

// Resolves to [{path, file}] of a drop; must be called while the drop event is handled.
export async function filesOfDrop(transfer) {
  const entries = [...transfer.items].map((item) => item.webkitGetAsEntry?.()).filter(Boolean);
  if (entries.length === 0) return filesOfInput(transfer.files);
  const found = [];
  for (const entry of entries) await collect(entry, "", found);
  return found;
}

export function filesOfInput(files) {
  return [...files].map((file) => ({ path: file.webkitRelativePath || file.name, file }));
}

async function collect(entry, above, found) {
  const path = above + entry.name;
  if (entry.isFile) {
    found.push({ path, file: await new Promise((resolve, reject) => entry.file(resolve, reject)) });
    return;
  }
  const reader = entry.createReader();
  for (;;) {
    const batch = await new Promise((resolve, reject) => reader.readEntries(resolve, reject));
    if (batch.length === 0) return; // each call returns at most 100, and none at the end
    for (const inner of batch) await collect(inner, `${path}/`, found);
  }
}

// Returns {name, blob, notes}; throws an Error with a sentence if there is nothing that can be rendered.
export async function packed(files, onProgress, signal) {
  const litter = files.filter(({ path }) => LITTER.test(path));
  const usable = files.filter(({ path }) => !LITTER.test(path));
  const notes = litter.length ? [`Left out: ${litter.map(({ path }) => path).join(", ")}`] : [];
  if (usable.length === 0) throw new Error("Nothing that was dropped is a file.");
  if (usable.length === 1 && SCENE.test(usable[0].file.name)) return { name: usable[0].file.name, blob: usable[0].file, notes };
  if (!usable.some(({ path }) => PICTURE.test(path))) {
    const other = usable.find(({ path }) => OTHER.test(path));
    if (other) return { name: other.file.name, blob: other.file.slice(0, HEAD_BYTES), notes };
    throw new Error("None of these files is a USD layer (.usd, .usda, .usdc or .usdz).");
  }
  const { entries, folder } = rooted(usable);
  // The order is always the same, so that equal files are the same scene.
  entries.sort((a, b) => (a.path < b.path ? -1 : a.path > b.path ? 1 : 0));
  const blob = await stored(entries, onProgress, signal);
  return { name: `${folder || entries.find(({ path }) => PICTURE.test(path)).path.replace(/\.\w+$/, "")}.zip`, blob, notes };
}

// Returns the paths below the one folder that contains everything.
function rooted(files) {
  const folder = files[0].path.split("/")[0];
  const inside = files.every(({ path }) => path.startsWith(`${folder}/`));
  if (!inside) return { entries: files, folder: "" };
  return { entries: files.map(({ path, file }) => ({ path: path.slice(folder.length + 1), file })), folder };
}

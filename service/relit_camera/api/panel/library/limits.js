// What the camera takes as a file: so large, and with these endings. It is told before a file is sent.

import { Refused } from "../api.js";

const MIB = 1024 ** 2;
const VIDEOS = [".mp4", ".mov", ".m4v", ".mkv", ".webm", ".avi"];

/** Bytes and endings by the path that takes the file; without endings the camera looks into the file. */
export const LIMITS = Object.freeze({
  environments: { bytes: 64 * MIB, endings: [".hdr", ".exr", ".png", ".jpg", ".jpeg"] },
  backgrounds: { bytes: 64 * MIB, endings: null },
  subjects: { bytes: 1024 * MIB, endings: [".relit"] },
  "captures/film": { bytes: 4096 * MIB, endings: VIDEOS },
  "captures/expressions/video": { bytes: 4096 * MIB, endings: VIDEOS },
});

/** Throws `Refused` where the camera would not take the file. */
export function checkFile(file, path) {
  const { bytes, endings } = LIMITS[path];
  const ending = file.name.match(/\.[^.]*$/)?.[0].toLowerCase() ?? "";
  if (endings && !endings.includes(ending)) {
    throw new Refused(`“${file.name}” is of another kind`, `files that end in ${endings.join(", ")} are taken`);
  }
  if (file.size > bytes) {
    throw new Refused(`“${file.name}” has ${sizeText(file.size)}`, `the largest file that is taken here has ${sizeText(bytes)}`);
  }
  if (file.size === 0) throw new Refused(`“${file.name}” is empty`, "choose another file");
}

function sizeText(bytes) {
  return bytes >= 1024 * MIB ? `${(bytes / MIB / 1024).toFixed(1)} GiB` : `${Math.ceil(bytes / MIB)} MiB`;
}

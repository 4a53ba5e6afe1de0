// Loads what the viewer shows: the container's own files, and the shader package that decodes them.
import {blob, bytes, get, text} from "./api.js";

// DXGI formats in DDS files: bytes of a texel, or of a block of 4 x 4.
const FORMATS = {
  2: {name: "RGBA32_FLOAT", texel: 16}, 10: {name: "RGBA16_FLOAT", texel: 8}, 42: {name: "R32_UINT", texel: 4},
  57: {name: "R16_UINT", texel: 2}, 95: {name: "BC6H_UF16", block: 16}, 96: {name: "BC6H_SF16", block: 16}
};
const MAX_SIDE = 65536;

export class DamagedFile extends Error {
  constructor(file, what) {
    super(`${file}: ${what}. Bake the asset again, or fetch the container again; \`patina validate\` says what else is wrong.`);
  }
}

// {format, width, height, levels: [{width, height, bytes}]} of a DDS file with a DX10 header.
export function parseDds(buffer, file) {
  const view = new DataView(buffer);
  if (buffer.byteLength < 148 || view.getUint32(0, true) !== 0x20534444 || view.getUint32(84, true) !== 0x30315844)
    throw new DamagedFile(file, "byte 0: is no DDS file with a DX10 header");
  const format = FORMATS[view.getUint32(128, true)];
  if (!format) throw new DamagedFile(file, `byte 128: has DXGI format ${view.getUint32(128, true)}, which containers do not have`);
  const height = view.getUint32(12, true), width = view.getUint32(16, true), count = view.getUint32(28, true);
  if (width < 1 || height < 1 || width > MAX_SIDE || height > MAX_SIDE || count < 1 || count > 17)
    throw new DamagedFile(file, `byte 12: has ${width} x ${height} texels and ${count} levels`);
  const levels = [];
  let at = 148;
  for (let level = 0; level < count; ++level) {
    const w = Math.max(1, width >> level), h = Math.max(1, height >> level);
    const size = format.block ? Math.ceil(w / 4) * Math.ceil(h / 4) * format.block : w * h * format.texel;
    if (at + size > buffer.byteLength)
      throw new DamagedFile(file, `byte ${buffer.byteLength}: the file ends within level ${level}, which ends at byte ${at + size}`);
    levels.push({width: w, height: h, bytes: new Uint8Array(buffer, at, size)});
    at += size;
  }
  if (at !== buffer.byteLength) throw new DamagedFile(file, `byte ${at}: ${buffer.byteLength - at} bytes too many`);
  return {format: format.name, width, height, levels};
}

// The maps that a material was baked from, where the server has them; else null.
async function loadSource(base, said) {
  const source = await get(`${base}/source/source.json`);
  if (!source) return null;
  const textures = [];
  for (let texture = 0; texture < source.textures; ++texture) {
    said(`Loading the source, ${texture + 1} of ${source.textures}`);
    textures.push(await Promise.all(source.levels.map(async ({width, height}, level) => {
      const file = `${texture}_${level}.bin`;
      const halves = new Uint16Array(await bytes(`${base}/source/${file}`));
      if (halves.length !== width * height * 4) throw new DamagedFile(file, `has ${halves.length} halves`);
      return {width, height, halves};
    })));
  }
  return {...source, textures};
}

// `patina view` serves a container here, and maybe its source; a daemon serves those of its assets.
export const ONE_CONTAINER = "/v1/container";

// base: ONE_CONTAINER or "/v1/assets/<name>/revisions/<revision>". said(text): how far it is.
export async function loadContainer(base, said) {
  said("Loading manifest.json");
  const manifest = await get(`${base}/files/manifest.json`);
  if (!["material", "brdf", "svbrdf"].includes(manifest.kind)) {
    throw new Error(`manifest.json: /kind: ${JSON.stringify(manifest.kind)} is nothing that this viewer shows; ` +
      "open it with the version of Patina that baked it");
  }
  said("Loading the decoder");
  const bindings = await get(`${base}/shader/bindings.json`);
  const shader = (await text(`${base}/shader/${bindings.shader}`)).text;
  const constants = bindings.constants ? await bytes(`${base}/shader/${bindings.constants.file}`) : null;
  if (constants && constants.byteLength !== bindings.constants.bytes)
    throw new DamagedFile(bindings.constants.file, `has ${constants.byteLength} bytes, bindings.json calls for ${bindings.constants.bytes}`);
  const textures = [];
  for (const [number, listed] of bindings.textures.entries()) {
    said(`Loading textures, ${number + 1} of ${bindings.textures.length}`);
    const file = listed.container_file || listed.file;
    const dds = parseDds(await bytes(listed.container_file ? `${base}/files/${file}` : `${base}/shader/${file}`), file);
    if (dds.format !== listed.format || dds.width !== listed.width || dds.height !== listed.height || dds.levels.length !== listed.levels)
      throw new DamagedFile(file, `byte 12: holds ${dds.width} x ${dds.height} ${dds.format}, manifest.json calls for ${listed.width} x ${listed.height} ${listed.format}`);
    textures.push({name: listed.name, ...dds});
  }
  const source = manifest.kind === "material" && base === ONE_CONTAINER ? await loadSource(base, said) : null;
  const hasPreview = manifest.payloads.some(payload => payload.name === "preview.png");
  const preview = hasPreview ? await blob(`${base}/files/preview.png`) : null;
  return {manifest, bindings, shader, constants, textures, source, preview};
}

// The maps of a material in the manifest's order: {map, kind: "color", "normal", "data" or "other", channels: [indices]}.
export function mapsOf(manifest) {
  const maps = [];
  for (const [index, channel] of (manifest.channels || []).entries()) {
    const last = maps[maps.length - 1];
    if (last && last.map === channel.map) last.channels.push(index);
    else maps.push({map: channel.map, channels: [index]});
  }
  for (const map of maps) {
    const isNormal = manifest.channels[map.channels[0]].encoding === "normal_xy";
    map.kind = isNormal && map.channels.length === 2 ? "normal" : { 1: "data", 3: "color" }[map.channels.length] || "other";
  }
  return maps;
}

// BC6H blocks to half floats, for browsers without EXT_texture_compression_bptc and for textures whose sides WebGL does not
// take as blocks. The bits are those of the format's specification (formats/FORMATS.md, section 4).

// Per mode: mode bits, their number, regions, endpoint bits, delta bits of r, g, b (0: endpoints as they are), and the fields
// that follow, from the lowest bit up; a range whose first bit is the smaller one is stored the other way round.
const MODES = [
  [0x00, 2, 2, 10, [5, 5, 5], "g2[4] b2[4] b3[4] r0[9:0] g0[9:0] b0[9:0] r1[4:0] g3[4] g2[3:0] g1[4:0] b3[0] g3[3:0] b1[4:0] b3[1] b2[3:0] r2[4:0] b3[2] r3[4:0] b3[3]"],
  [0x01, 2, 2, 7, [6, 6, 6], "g2[5] g3[4] g3[5] r0[6:0] b3[0] b3[1] b2[4] g0[6:0] b2[5] b3[2] g2[4] b0[6:0] b3[3] b3[5] b3[4] r1[5:0] g2[3:0] g1[5:0] g3[3:0] b1[5:0] b2[3:0] r2[5:0] r3[5:0]"],
  [0x02, 5, 2, 11, [5, 4, 4], "r0[9:0] g0[9:0] b0[9:0] r1[4:0] r0[10] g2[3:0] g1[3:0] g0[10] b3[0] g3[3:0] b1[3:0] b0[10] b3[1] b2[3:0] r2[4:0] b3[2] r3[4:0] b3[3]"],
  [0x06, 5, 2, 11, [4, 5, 4], "r0[9:0] g0[9:0] b0[9:0] r1[3:0] r0[10] g3[4] g2[3:0] g1[4:0] g0[10] g3[3:0] b1[3:0] b0[10] b3[1] b2[3:0] r2[3:0] b3[0] b3[2] r3[3:0] g2[4] b3[3]"],
  [0x0A, 5, 2, 11, [4, 4, 5], "r0[9:0] g0[9:0] b0[9:0] r1[3:0] r0[10] b2[4] g2[3:0] g1[3:0] g0[10] b3[0] g3[3:0] b1[4:0] b0[10] b2[3:0] r2[3:0] b3[1] b3[2] r3[3:0] b3[4] b3[3]"],
  [0x0E, 5, 2, 9, [5, 5, 5], "r0[8:0] b2[4] g0[8:0] g2[4] b0[8:0] b3[4] r1[4:0] g3[4] g2[3:0] g1[4:0] b3[0] g3[3:0] b1[4:0] b3[1] b2[3:0] r2[4:0] b3[2] r3[4:0] b3[3]"],
  [0x12, 5, 2, 8, [6, 5, 5], "r0[7:0] g3[4] b2[4] g0[7:0] b3[2] g2[4] b0[7:0] b3[3] b3[4] r1[5:0] g2[3:0] g1[4:0] b3[0] g3[3:0] b1[4:0] b3[1] b2[3:0] r2[5:0] r3[5:0]"],
  [0x16, 5, 2, 8, [5, 6, 5], "r0[7:0] b3[0] b2[4] g0[7:0] g2[5] g2[4] b0[7:0] g3[5] b3[4] r1[4:0] g3[4] g2[3:0] g1[5:0] g3[3:0] b1[4:0] b3[1] b2[3:0] r2[4:0] b3[2] r3[4:0] b3[3]"],
  [0x1A, 5, 2, 8, [5, 5, 6], "r0[7:0] b3[1] b2[4] g0[7:0] b2[5] g2[4] b0[7:0] b3[5] b3[4] r1[4:0] g3[4] g2[3:0] g1[4:0] b3[0] g3[3:0] b1[5:0] b2[3:0] r2[4:0] b3[2] r3[4:0] b3[3]"],
  [0x1E, 5, 2, 6, null, "r0[5:0] g3[4] b3[0] b3[1] b2[4] g0[5:0] g2[5] b2[5] b3[2] g2[4] b0[5:0] g3[5] b3[3] b3[5] b3[4] r1[5:0] g2[3:0] g1[5:0] g3[3:0] b1[5:0] b2[3:0] r2[5:0] r3[5:0]"],
  [0x03, 5, 1, 10, null, "r0[9:0] g0[9:0] b0[9:0] r1[9:0] g1[9:0] b1[9:0]"],
  [0x07, 5, 1, 11, [9, 9, 9], "r0[9:0] g0[9:0] b0[9:0] r1[8:0] r0[10] g1[8:0] g0[10] b1[8:0] b0[10]"],
  [0x0B, 5, 1, 12, [8, 8, 8], "r0[9:0] g0[9:0] b0[9:0] r1[7:0] r0[10:11] g1[7:0] g0[10:11] b1[7:0] b0[10:11]"],
  [0x0F, 5, 1, 16, [4, 4, 4], "r0[9:0] g0[9:0] b0[9:0] r1[3:0] r0[10:15] g1[3:0] g0[10:15] b1[3:0] b0[10:15]"]
].map(([bits, count, regions, precision, deltas, layout]) => ({bits, count, regions, precision, deltas, places: placesOf(layout)}));

// For each stored bit which endpoint (3 * number + channel) it belongs to, and which bit of it it is. A run like r0[9:0]
// stands with its lowest bit first, one like r0[10:15] with bit 15 first.
function placesOf(layout) {
  const places = [];
  for (const [, channel, number, from, to] of layout.matchAll(/([rgb])([0-3])\[(\d+)(?::(\d+))?\]/g)) {
    const endpoint = 3 * Number(number) + "rgb".indexOf(channel);
    const high = Number(from), low = to === undefined ? high : Number(to);
    if (high >= low) for (let bit = low; bit <= high; ++bit) places.push([endpoint, bit]);
    else for (let bit = low; bit >= high; --bit) places.push([endpoint, bit]);
  }
  return places;
}

const PARTITIONS = ("CCCC 8888 EEEE ECC8 C880 FEEC FEC8 EC80 C800 FFEC FE80 E800 FFE8 FF00 FFF0 F000 " +
  "F710 008E 7100 08CE 008C 7310 3100 8CCE 088C 3110 6666 366C 17E8 0FF0 718E 399C").split(" ").map(word => parseInt(word, 16));
const ANCHORS = [...Array(17).fill(15), 2, 8, 2, 2, 8, 8, 15, 2, 8, 2, 2, 8, 8, 2, 2];
const WEIGHTS3 = [0, 9, 18, 27, 37, 46, 55, 64];
const WEIGHTS4 = [0, 4, 9, 13, 17, 21, 26, 30, 34, 38, 43, 47, 51, 55, 60, 64];

const extend = (value, bits) => value << (32 - bits) >> (32 - bits);

function unquantize(value, bits, isSigned) {
  if (!isSigned) {
    if (bits >= 15 || value === 0) return value;
    return value === (1 << bits) - 1 ? 65535 : (value * 65536 + 32768) >> bits;
  }
  if (bits >= 16 || value === 0) return value;
  const size = Math.abs(value);
  const wide = size >= (1 << (bits - 1)) - 1 ? 32767 : (size * 32768 + 16384) >> (bits - 1);
  return value < 0 ? -wide : wide;
}

function finish(value, isSigned) {
  if (!isSigned) return value * 31 >> 6;
  const size = Math.abs(value) * 31 >> 5;
  return value < 0 && size > 0 ? 0x8000 | size : size;
}

// One block, 16 bytes at `at`, to 16 texels of 3 halves.
function decodeBlock(bytes, at, isSigned, texels) {
  const low = bytes[at] & 3;
  const code = low < 2 ? low : bytes[at] & 31;
  const mode = MODES.find(one => one.bits === code && one.count === (low < 2 ? 2 : 5));
  if (!mode) return texels.fill(0);
  let place = mode.count;
  const take = count => {
    let value = 0;
    for (let i = 0; i < count; ++i, ++place) value |= (bytes[at + (place >> 3)] >> (place & 7) & 1) << i;
    return value;
  };
  const ends = new Int32Array(12);
  for (const [endpoint, bit] of mode.places) ends[endpoint] |= take(1) << bit;
  for (let channel = 0; channel < 3; ++channel) {
    if (isSigned) ends[channel] = extend(ends[channel], mode.precision);
    for (let number = 1; number < 2 * mode.regions; ++number) {
      let value = ends[3 * number + channel];
      if (mode.deltas) {
        value = ends[channel] + extend(value, mode.deltas[channel]) & (2 ** mode.precision - 1);
      }
      ends[3 * number + channel] = isSigned ? extend(value, mode.precision) : value;
    }
  }
  for (let i = 0; i < 6 * mode.regions; ++i) ends[i] = unquantize(ends[i], mode.precision, isSigned);
  const partition = mode.regions === 2 ? take(5) : 0;
  const [width, weights] = mode.regions === 2 ? [3, WEIGHTS3] : [4, WEIGHTS4];
  for (let texel = 0; texel < 16; ++texel) {
    const region = mode.regions === 2 ? PARTITIONS[partition] >> texel & 1 : 0;
    const isAnchor = texel === 0 || (region === 1 && texel === ANCHORS[partition]);
    const weight = weights[take(isAnchor ? width - 1 : width)];
    for (let channel = 0; channel < 3; ++channel) {
      const a = ends[6 * region + channel], b = ends[6 * region + 3 + channel];
      texels[3 * texel + channel] = finish(a * (64 - weight) + b * weight + 32 >> 6, isSigned);
    }
  }
}

// A level of width x height texels to halves [y][x][4], the fourth being 1.
export function decodeLevel(bytes, width, height, isSigned) {
  const halves = new Uint16Array(width * height * 4);
  const across = Math.ceil(width / 4), texels = new Uint16Array(48);
  for (let block = 0; block < across * Math.ceil(height / 4); ++block) {
    decodeBlock(bytes, 16 * block, isSigned, texels);
    const left = block % across * 4, top = Math.floor(block / across) * 4;
    for (let texel = 0; texel < 16; ++texel) {
      const x = left + texel % 4, y = top + (texel >> 2);
      if (x >= width || y >= height) continue;
      const to = (y * width + x) * 4;
      halves.set(texels.subarray(3 * texel, 3 * texel + 3), to);
      halves[to + 3] = 0x3C00;
    }
  }
  return halves;
}

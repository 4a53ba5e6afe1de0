// WebGL 2 in small: context, programs, textures, geometry, and reading back.
import {decodeLevel} from "./view_bc6h.js";

// Smooth edges cost nothing worth mentioning on a graphics card, and much without one.
function hasCard() {
  const gl = typeof OffscreenCanvas === "function" ? new OffscreenCanvas(1, 1).getContext("webgl2") : null;
  const names = gl && gl.getExtension("WEBGL_debug_renderer_info");
  const isSoft = Boolean(names) && /swiftshader|llvmpipe|software|basic render/i.test(gl.getParameter(names.UNMASKED_RENDERER_WEBGL));
  if (gl) gl.getExtension("WEBGL_lose_context")?.loseContext();
  return !isSoft;
}

export function openContext(canvas) {
  const gl = canvas.getContext("webgl2", {alpha: true, antialias: hasCard(), premultipliedAlpha: true, powerPreference: "high-performance"});
  if (!gl) {
    throw new Error("This browser gives the page no WebGL 2. Turn on hardware acceleration in its settings, update it or the " +
      "graphics driver, or start Chromium with --enable-unsafe-swiftshader, which needs no graphics card. Until then the " +
      "container's own pictures are below, and report.html has more of them.");
  }
  const extensions = {
    bptc: gl.getExtension("EXT_texture_compression_bptc"),
    floats: gl.getExtension("EXT_color_buffer_float")
  };
  return {gl, extensions};
}

function shaderOf(gl, kind, source) {
  const shader = gl.createShader(kind);
  gl.shaderSource(shader, source);
  gl.compileShader(shader);
  return shader;
}

// A program with its uniforms by name. Errors are only asked for where linking fails: asking earlier would wait for each.
export function makeProgram(gl, vertex, fragment) {
  const program = gl.createProgram();
  const shaders = [shaderOf(gl, gl.VERTEX_SHADER, vertex), shaderOf(gl, gl.FRAGMENT_SHADER, fragment)];
  for (const shader of shaders) gl.attachShader(program, shader);
  for (const [place, name] of ["a_position", "a_normal", "a_tangent", "a_uv"].entries()) gl.bindAttribLocation(program, place, name);
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
    const log = shaders.map(shader => gl.getShaderInfoLog(shader)).concat(gl.getProgramInfoLog(program)).filter(line => line).join("\n");
    throw new Error(`The graphics driver does not take the decoder's shader:\n${log.slice(0, 1000)}`);
  }
  for (const shader of shaders) gl.deleteShader(shader);
  const uniforms = {};
  const count = gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS) || 0;
  for (let i = 0; i < count; ++i) {
    const name = gl.getActiveUniform(program, i).name.replace(/\[0\]$/, "");
    uniforms[name] = gl.getUniformLocation(program, name);
  }
  return {program, uniforms};
}

function newTexture(gl, address, isFiltered) {
  const texture = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, texture);
  const edge = address === "clamp" ? gl.CLAMP_TO_EDGE : gl.REPEAT;
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, edge);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, edge);
  setFilter(gl, isFiltered);
  return texture;
}

function setFilter(gl, isSmooth) {
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, isSmooth ? gl.LINEAR_MIPMAP_LINEAR : gl.NEAREST_MIPMAP_NEAREST);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, isSmooth ? gl.LINEAR : gl.NEAREST);
}

export function setFilters(gl, textures, isSmooth) {
  for (const texture of textures) {
    gl.bindTexture(gl.TEXTURE_2D, texture);
    setFilter(gl, isSmooth);
  }
}

function upload(gl, levels, storage, put) {
  gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
  gl.texStorage2D(gl.TEXTURE_2D, levels.length, storage, levels[0].width, levels[0].height);
  levels.forEach(put);
}

// Half floats [y][x][4] of each level.
export function halfTexture(gl, levels, address, isFiltered) {
  const texture = newTexture(gl, address, isFiltered);
  upload(gl, levels, gl.RGBA16F, (level, i) =>
    gl.texSubImage2D(gl.TEXTURE_2D, i, 0, 0, level.width, level.height, gl.RGBA, gl.HALF_FLOAT, level.halves));
  return texture;
}

function dataTexture(gl, dds) {
  const texture = newTexture(gl, "clamp", false);
  const [{width, height, bytes}] = dds.levels;
  const copy = bytes.slice().buffer;
  const [storage, layout, type, values] = {
    RGBA32_FLOAT: [gl.RGBA32F, gl.RGBA, gl.FLOAT, Float32Array], RGBA16_FLOAT: [gl.RGBA16F, gl.RGBA, gl.HALF_FLOAT, Uint16Array],
    R32_UINT: [gl.R32UI, gl.RED_INTEGER, gl.UNSIGNED_INT, Uint32Array], R16_UINT: [gl.R16UI, gl.RED_INTEGER, gl.UNSIGNED_SHORT, Uint16Array]
  }[dds.format];
  upload(gl, dds.levels, storage, () => gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, width, height, layout, type, new values(copy)));
  return texture;
}

// A texture of a container, filtered if it holds features. BC6H as blocks where the browser takes it, else decoded here to
// the same half floats: {texture, inPage: why that was so, or ""}.
export function containerTexture({gl, extensions}, dds, address, isFeature) {
  if (!isFeature) return {texture: dataTexture(gl, dds), inPage: ""};
  if (dds.format === "RGBA16_FLOAT") {
    const levels = dds.levels.map(({width, height, bytes}) => ({width, height, halves: new Uint16Array(bytes.slice().buffer)}));
    return {texture: halfTexture(gl, levels, address, true), inPage: ""};
  }
  const isSigned = dds.format === "BC6H_SF16";
  // WebGL takes blocks only where they fill the finest level.
  const inPage = !extensions.bptc ? "this browser has no EXT_texture_compression_bptc"
    : dds.width % 4 !== 0 || dds.height % 4 !== 0 ? "WebGL takes BC6H only in multiples of 4 texels" : "";
  if (inPage) {
    const levels = dds.levels.map(({width, height, bytes}) => ({width, height, halves: decodeLevel(bytes, width, height, isSigned)}));
    return {texture: halfTexture(gl, levels, address, true), inPage};
  }
  const format = isSigned ? extensions.bptc.COMPRESSED_RGB_BPTC_SIGNED_FLOAT_EXT : extensions.bptc.COMPRESSED_RGB_BPTC_UNSIGNED_FLOAT_EXT;
  const texture = newTexture(gl, address, true);
  upload(gl, dds.levels, format, ({width, height, bytes}, i) =>
    gl.compressedTexSubImage2D(gl.TEXTURE_2D, i, 0, 0, width, height, format, bytes));
  return {texture, inPage: ""};
}

// Geometry with the attributes of makeProgram: {positions, normals, tangents, uvs, triangles}; colors in place of tangents.
export function makeMesh(gl, shape) {
  const array = gl.createVertexArray();
  gl.bindVertexArray(array);
  const buffers = [];
  for (const [place, [values, size]] of [[shape.positions, 3], [shape.normals, 3], [shape.tangents, 3], [shape.uvs, 2]].entries()) {
    buffers.push(gl.createBuffer());
    gl.bindBuffer(gl.ARRAY_BUFFER, buffers[place]);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(values), gl.STATIC_DRAW);
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, size, gl.FLOAT, false, 0, 0);
  }
  buffers.push(gl.createBuffer());
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffers[4]);
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(shape.triangles), gl.STATIC_DRAW);
  gl.bindVertexArray(null);
  return {
    draw() {
      gl.bindVertexArray(array);
      gl.drawElements(gl.TRIANGLES, shape.triangles.length, gl.UNSIGNED_INT, 0);
      gl.bindVertexArray(null);
    },
    remove() {
      gl.deleteVertexArray(array);
      buffers.forEach(buffer => gl.deleteBuffer(buffer));
    }
  };
}

// A texture of floats [y][x][4] that is read by texel.
export function floatTexture(gl, width, height, values) {
  const texture = newTexture(gl, "clamp", false);
  gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32F, width, height);
  gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, width, height, gl.RGBA, gl.FLOAT, values);
  return texture;
}

// Runs draw() into floats and returns them, [y][x][4].
export function readFloats(gl, width, height, draw) {
  const target = newTexture(gl, "clamp", false);
  gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32F, width, height);
  const frame = gl.createFramebuffer();
  gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, target, 0);
  gl.viewport(0, 0, width, height);
  gl.disable(gl.BLEND);
  gl.disable(gl.DEPTH_TEST);
  draw();
  const values = new Float32Array(width * height * 4);
  gl.readPixels(0, 0, width, height, gl.RGBA, gl.FLOAT, values);
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  gl.deleteFramebuffer(frame);
  gl.deleteTexture(target);
  return values;
}

// A container on the graphics card: draws it, and reads values back.
import {containerTexture, floatTexture, halfTexture, makeMesh, makeProgram, openContext, readFloats, setFilters} from "./view_gl.js";
import {brdfProbe, brdfShaders, lobeShaders, materialProbe, materialShaders} from "./view_shaders.js";
import {cube, hemisphere, plane, sphere} from "./view_shapes.js";

const LOBE_ACROSS = 96, LOBE_DOWN = 48;

function turned({yaw, pitch}) {
  const [a, b, c, d] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch)];
  return [a, b * d, -b * c, 0, c, d, b, -a * d, a * c];
}

// Where the light is: over the point (x, y) of the picture, both -1 to 1.
export function lightPlace({lightX, lightY}) {
  const z = Math.max(0.35, Math.sqrt(Math.max(0, 1 - lightX * lightX - lightY * lightY)));
  const scale = 2.6 / Math.hypot(lightX, lightY, z);
  return [lightX * scale, lightY * scale, z * scale];
}

// Texels of what varies over the surface, at the full size; of a BRDF that does not, one.
export function sizeOf({manifest, bindings}) {
  if (manifest.kind === "material") return manifest.source;
  return bindings.textures.find(({name}) => name === "patina_feature_0") || {width: 1, height: 1, levels: 1};
}

export class Scene {
  constructor(canvas, container) {
    this.canvas = canvas;
    this.container = container;
    this.kind = container.manifest.kind;
    this.begin();
  }

  // Everything that a lost context takes with it.
  begin() {
    const context = openContext(this.canvas);
    const {gl} = context;
    this.gl = gl;
    this.canProbe = Boolean(context.extensions.floats);
    const {bindings, textures, source} = this.container;
    const shaders = this.kind === "material" ? materialShaders(this.container) : brdfShaders(this.container);
    this.names = shaders.names;
    this.program = makeProgram(gl, shaders.vertex, shaders.fragment);
    this.others = new Map();
    this.inPage = "";
    const isFeature = ({name}) => name.startsWith("patina_feature");
    this.textures = textures.map(dds => {
      const {texture, inPage} = containerTexture(context, dds, bindings.address, isFeature(dds));
      this.inPage = this.inPage || inPage;
      return {name: dds.name, texture};
    });
    this.features = this.textures.filter(isFeature).map(({texture}) => texture);
    this.isSmooth = true;
    if (source) {
      source.textures.forEach((levels, i) =>
        this.textures.push({name: `u_source_${i}`, texture: halfTexture(gl, levels, bindings.address, true)}));
    }
    if (this.container.constants) {
      this.constants = gl.createBuffer();
      gl.bindBuffer(gl.UNIFORM_BUFFER, this.constants);
      gl.bufferData(gl.UNIFORM_BUFFER, this.container.constants, gl.STATIC_DRAW);
    }
    const {width, height} = sizeOf(this.container);
    const aspect = width / height;
    this.turns = bindings.address === "clamp" || aspect > 1 ? 1 : 2;
    this.shapes = {plane: plane(aspect), sphere: sphere(this.turns), cube: cube()};
    this.meshes = new Map();
    this.lobe = null;
    const error = gl.getError();
    if (error !== gl.NO_ERROR && !gl.isContextLost()) {
      throw new Error(`The graphics driver refuses the container's textures (error 0x${error.toString(16)}); ` +
        "they may be larger than it can hold. Close other pages, or bake with a smaller --profile.");
    }
  }

  use({program, uniforms}) {
    const gl = this.gl;
    gl.useProgram(program);
    this.textures.forEach(({name, texture}, unit) => {
      if (!uniforms[name]) return;
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.uniform1i(uniforms[name], unit);
    });
    const block = this.constants ? gl.getUniformBlockIndex(program, this.container.bindings.constants.name) : gl.INVALID_INDEX;
    if (block !== gl.INVALID_INDEX) {
      gl.uniformBlockBinding(program, block, 0);
      gl.bindBufferBase(gl.UNIFORM_BUFFER, 0, this.constants);
    }
    gl.activeTexture(gl.TEXTURE0 + this.textures.length);
    return uniforms;
  }

  meshOf(name) {
    if (!this.meshes.has(name)) this.meshes.set(name, makeMesh(this.gl, this.shapes[name]));
    return this.meshes.get(name);
  }

  otherProgram(name, make) {
    if (!this.others.has(name)) {
      const {vertex, fragment} = make(this.container);
      this.others.set(name, makeProgram(this.gl, vertex, fragment));
    }
    return this.others.get(name);
  }

  // state: what viewer.js keeps.
  draw(state) {
    const gl = this.gl;
    const {width, height} = this.canvas;
    if (this.isSmooth !== state.smooth) {
      this.isSmooth = state.smooth;
      setFilters(gl, this.features, state.smooth);
    }
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    const isLobe = state.shape === "lobe";
    const program = isLobe ? this.otherProgram("lobe", lobeShaders) : this.program;
    const u = this.use(program);
    gl.uniformMatrix3fv(u.u_turn, false, turned(state));
    gl.uniform4f(u.u_frame, state.zoom, state.panX, state.panY, width / height);
    const repeat = state.repeat;
    gl.uniform2f(u.u_repeat, repeat, repeat);
    if (isLobe) {
      this.lobe.draw();
      return;
    }
    gl.uniform1f(u.u_exposure, 2 ** state.exposure);
    gl.uniform1f(u.u_light, state.light);
    gl.uniform1f(u.u_studio, state.studio);
    gl.uniform3fv(u.u_light_place, lightPlace(state));
    gl.uniform1i(u.u_show, Math.max(0, this.names.indexOf(state.show)));
    gl.uniform1i(u.u_compare, ["decoded", "source", "wipe", "difference"].indexOf(state.compare));
    gl.uniform1f(u.u_wipe, state.wipe * width);
    gl.uniform1f(u.u_gain, state.gain);
    gl.uniform1f(u.u_mip, state.mip);
    // The far side of what is closed is not shaded to be covered again.
    if (state.shape !== "plane") gl.enable(gl.CULL_FACE);
    this.meshOf(state.shape).draw();
    gl.disable(gl.CULL_FACE);
  }

  // Milliseconds of a frame, each to its last pixel: the mean of at most `count`, fewer where they take more than a second.
  measure(state, count) {
    const gl = this.gl, pixel = new Uint8Array(4);
    const frame = () => {
      this.draw(state);
      gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
    };
    frame();
    const begin = performance.now();
    let drawn = 0;
    while (drawn < count && (drawn === 0 || performance.now() - begin < 1000)) {
      frame();
      ++drawn;
    }
    return (performance.now() - begin) / drawn;
  }

  probe(name, make, places, width, height, rows, place = [0, 0, 0]) {
    const gl = this.gl;
    const program = this.otherProgram(name, make);
    const texture = floatTexture(gl, width, rows, places);
    const values = readFloats(gl, width, height, () => {
      const u = this.use(program);
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.uniform1i(u.u_places, this.textures.length);
      if (u.u_place) gl.uniform3fv(u.u_place, place);
      gl.drawArrays(gl.TRIANGLES, 0, 3);
    });
    gl.deleteTexture(texture);
    return values;
  }

  // Physical values of all channels at (u, v) and a mip: those of the container, or of the source.
  valuesAt(u, v, mip, ofSource) {
    const channels = this.container.manifest.channels.length, rows = Math.ceil(channels / 4);
    return [...this.probe("values", materialProbe, new Float32Array([u, v, mip, ofSource ? 1 : 0]), 1, rows, 1)].slice(0, channels);
  }

  // f of a pair of directions at [u, v, mip].
  brdfAt(wi, wo, place) {
    return [...this.probe("brdf", brdfProbe, new Float32Array([...wi, 0, ...wo, 0]), 1, 1, 2, place)].slice(0, 3);
  }

  // The lobe of light that comes in at an angle, at [u, v, mip]: f cos over all directions out, as a sheet. Returns its largest value.
  makeLobe(thetaDegrees, phiDegrees, isLogarithmic, place) {
    const angle = degrees => degrees * Math.PI / 180;
    const direction = (theta, phi) => [Math.sin(theta) * Math.cos(phi), Math.sin(theta) * Math.sin(phi), Math.cos(theta)];
    const wi = direction(angle(thetaDegrees), angle(phiDegrees));
    const width = LOBE_ACROSS + 1, height = LOBE_DOWN + 1;
    const directions = [], places = new Float32Array(width * height * 8);
    for (let row = 0; row < height; ++row) {
      for (let column = 0; column < width; ++column) {
        const wo = direction(Math.PI / 2 * row / LOBE_DOWN, 2 * Math.PI * column / LOBE_ACROSS);
        directions.push(wo);
        places.set([...wi, 0], (2 * row * width + column) * 4);
        places.set([...wo, 0], ((2 * row + 1) * width + column) * 4);
      }
    }
    const f = this.probe("brdf", brdfProbe, places, width, height, 2 * height, place);
    const size = i => Math.max(f[4 * i], f[4 * i + 1], f[4 * i + 2], 0) * Math.max(directions[i][2], 0);
    let most = 1e-9;
    for (let i = 0; i < directions.length; ++i) most = Math.max(most, size(i));
    const shape = hemisphere(LOBE_ACROSS, LOBE_DOWN, (row, column) => {
      const i = row * width + column, [x, y, z] = directions[i];
      const radius = isLogarithmic ? Math.log1p(1000 * size(i) / most) / Math.log1p(1000) : size(i) / most;
      const peak = Math.max(f[4 * i], f[4 * i + 1], f[4 * i + 2], 1e-9);
      // The normal of the surface is up on the picture.
      return {place: [x * radius * 1.1, z * radius * 1.4 - 0.6, y * radius * 1.1], color: [0, 1, 2].map(c => Math.max(f[4 * i + c], 0) / peak)};
    });
    if (this.lobe) this.lobe.remove();
    this.lobe = makeMesh(this.gl, shape);
    return most;
  }
}

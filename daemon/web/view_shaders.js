// The shaders of the viewer around the decoder, which is the text that `patina shader` makes for the container.
import {mapsOf} from "./view_container.js";

const VERSION = "#version 300 es\n";

export const VERTEX = `${VERSION}
in vec3 a_position, a_normal, a_tangent;
in vec2 a_uv;
uniform mat3 u_turn;
uniform vec4 u_frame;     // zoom, pan, width / height
uniform vec2 u_repeat;
out vec3 v_place, v_normal, v_tangent;
out vec2 v_uv;
void main() {
  v_place = u_turn * a_position;
  v_normal = u_turn * a_normal;
  v_tangent = u_turn * a_tangent;
  v_uv = a_uv * u_repeat;
  // A camera at (0, 0, 4) that looks at the origin with a field of view of 30 degrees.
  float depth = 4.0 - v_place.z;
  vec2 at = v_place.xy * 3.6 * u_frame.x + u_frame.yz * depth;
  at *= u_frame.w > 1.0 ? vec2(1.0 / u_frame.w, 1.0) : vec2(1.0, u_frame.w);
  gl_Position = vec4(at, (depth - 4.0) * 0.5 * depth, depth);
}`;

const COVER = `${VERSION}
void main() {
  gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
}`;

// Light and display, for materials and BRDFs. The studio is computed: a gradient from ground to sky, and three soft lamps,
// each an exponential lobe: direction, sharpness and radiance of its middle.
const STUDIO = `
uniform float u_exposure, u_light, u_studio;
uniform vec3 u_light_place;
const vec3 kEye = vec3(0.0, 0.0, 4.0);
const vec3 kLampAt[3] = vec3[3](vec3(-0.640, 0.640, 0.426), vec3(0.800, 0.267, 0.537), vec3(0.124, 0.620, -0.775));
const vec4 kLamp[3] = vec4[3](vec4(7.0, 6.6, 6.1, 28.0), vec4(2.2, 2.5, 3.0, 18.0), vec4(5.0, 5.0, 5.2, 14.0));
const vec3 kGround = vec3(0.105, 0.098, 0.092), kSky = vec3(0.44, 0.47, 0.52);

vec3 coded(vec3 v) {
  vec3 high = 1.055 * pow(max(v, vec3(1e-6)), vec3(1.0 / 2.4)) - 0.055;
  return mix(high, 12.92 * v, lessThanEqual(v, vec3(0.0031308)));
}

// Bright colours roll off towards white without changing their hue: Khronos PBR Neutral.
vec3 tone(vec3 c) {
  float low = min(c.r, min(c.g, c.b));
  c -= low < 0.08 ? low - 6.25 * low * low : 0.04;
  float peak = max(c.r, max(c.g, c.b));
  if (peak < 0.76) return c;
  float squeezed = 1.0 - 0.0576 / (peak - 0.52);
  return mix(c * squeezed / peak, vec3(squeezed), 1.0 - 1.0 / (0.15 * (peak - squeezed) + 1.0));
}

float gradient_at(float height, float blur) { return smoothstep(-0.08 - blur, 0.08 + blur, height); }

// Radiance from a direction, blurred as by a lobe of GGX of that alpha.
vec3 studio_mirrored(vec3 d, float alpha) {
  vec3 sum = mix(kGround, kSky, gradient_at(d.y, alpha));
  float lobe = 0.5 / max(alpha * alpha, 1e-4);
  for (int i = 0; i < 3; ++i) {
    float sharp = kLamp[i].w * lobe / (kLamp[i].w + lobe);
    sum += kLamp[i].rgb * sharp / kLamp[i].w * exp(sharp * (dot(d, kLampAt[i]) - 1.0));
  }
  return sum;
}

// Irradiance over pi.
vec3 studio_scattered(vec3 n) {
  vec3 sum = mix(kGround, kSky, 0.5 + 0.5 * n.y);
  for (int i = 0; i < 3; ++i)
    sum += kLamp[i].rgb * 2.0 / kLamp[i].w * max(0.15 + 0.85 * dot(n, kLampAt[i]), 0.0);
  return sum;
}`;

// Measured light: GGX with Smith's shadowing and Schlick's approximation (glTF 2.0, appendix B), and for the studio the fit
// of its directional albedo by Karis (2014).
const SURFACE = `
struct Look {
  vec3 base, normal, emissive;
  float roughness, metalness, ao, opacity, coat, coat_roughness;
};

float ggx(float nh, float nl, float nv, float alpha) {
  float a2 = alpha * alpha;
  float d = (nh * a2 - nh) * nh + 1.0;
  float smith = nl * sqrt(nv * nv * (1.0 - a2) + a2) + nv * sqrt(nl * nl * (1.0 - a2) + a2);
  return a2 / (d * d) / 3.14159265 * 0.5 / max(smith, 1e-4);
}

vec2 studio_share(float rough, float nv) {
  vec4 r = rough * vec4(-1.0, -0.0275, -0.572, 0.022) + vec4(1.0, 0.0425, 1.04, -0.04);
  return vec2(-1.04, 1.04) * (min(r.x * r.x, exp2(-9.28 * nv)) * r.x + r.y) + r.zw;
}

vec3 lit(Look look, vec3 place, vec3 n, vec3 t) {
  vec3 b = cross(n, t);
  vec3 normal = normalize(look.normal.x * t + look.normal.y * b + look.normal.z * n);
  vec3 v = normalize(kEye - place), l = normalize(u_light_place - place), h = normalize(l + v);
  float nl = dot(normal, l), nv = max(abs(dot(normal, v)), 1e-3);
  float rough = clamp(look.roughness, 0.045, 1.0), alpha = rough * rough;
  vec3 f0 = mix(vec3(0.04), look.base, look.metalness), diffuse = look.base * (1.0 - look.metalness);
  float bend = pow(1.0 - clamp(dot(h, v), 0.0, 1.0), 5.0);
  vec3 fresnel = f0 + (1.0 - f0) * bend;
  vec3 sum = vec3(0.0);
  if (nl > 0.0) {
    float nh = max(dot(normal, h), 0.0);
    sum = u_light * nl * ((1.0 - fresnel) * diffuse + 3.14159265 * fresnel * ggx(nh, nl, nv, alpha));
  }
  vec2 share = studio_share(rough, nv);
  vec3 mirrored = f0 * share.x + share.y;
  float shade = mix(1.0, look.ao, 0.7);
  sum += u_studio * (look.ao * (1.0 - mirrored) * diffuse * studio_scattered(normal) +
                     shade * mirrored * studio_mirrored(reflect(-v, normal), alpha));
  if (look.coat > 0.0) {
    float coat_rough = clamp(look.coat_roughness, 0.045, 1.0), coat_alpha = coat_rough * coat_rough;
    float geometric = max(dot(n, v), 1e-3);
    vec2 coat_share = studio_share(coat_rough, geometric);
    float part = look.coat * (0.04 * coat_share.x + coat_share.y);
    sum = sum * (1.0 - part) + u_studio * part * studio_mirrored(reflect(-v, n), coat_alpha);
    float light = max(dot(n, l), 0.0);
    sum += u_light * light * look.coat * (0.04 + 0.96 * bend) * 3.14159265 * ggx(max(dot(n, h), 0.0), light, geometric, coat_alpha);
  }
  return sum + look.emissive;
}`;

const number = value => {
  const text = String(value);
  return /[.e]/.test(text) ? text : `${text}.0`;
};

// Linear colour of the working space to linear Rec.709.
const TO_REC709 = {
  acescg: "mat3(1.70505, -0.13026, -0.02400, -0.62179, 1.14080, -0.12897, -0.08326, -0.01055, 1.15297) * ",
  lin_rec709: ""
};

// Values of maps as GLSL, with what the viewer takes for a map that is not there.
function lookOf(manifest, maps) {
  const scene = manifest.scene || {};
  const factors = new Map((scene.factors || []).map(factor => [factor.map, factor.value]));
  const parameters = new Map((scene.parameters || []).map(parameter => [parameter.name, parameter.value]));
  const find = name => maps.find(map => map.map === name);
  const factorOf = name => {
    const value = factors.get(name);
    return value === undefined ? "" : Array.isArray(value)
      ? (value.length === 3 ? `vec3(${value.map(number).join(", ")}) * ` : `${number(value[0])} * `) : `${number(value)} * `;
  };
  const color = (name, other) => {
    const map = find(name);
    if (!map) return `vec3(${other})`;
    const values = map.channels.map(i => `m.value[${i}]`);
    return map.channels.length === 3 ? `${TO_REC709[manifest.working_space] || ""}(${factorOf(name)}vec3(${values.join(", ")}))`
      : `${factorOf(name)}vec3(${values[0]})`;
  };
  const scalar = (name, other) => find(name) ? `${factorOf(name)}m.value[${find(name).channels[0]}]` : number(other);
  const normal = find("normal");
  const strength = number(Number(parameters.get("normal_scale") ?? 1));
  const tangent = normal && normal.kind === "normal"
    ? `normalize(vec3(${strength} * vec2(m.value[${normal.channels[0]}], m.value[${normal.channels[1]}]), ` +
      `patina_normal_z(m.value[${normal.channels[0]}], m.value[${normal.channels[1]}])))` : "vec3(0.0, 0.0, 1.0)";
  return `Look look_of(PatinaMaterial m) {
  return Look(${color("albedo", "0.6")}, ${tangent}, ${color("emissive", "0.0")}, ${scalar("roughness", 0.6)},
    ${scalar("metalness", 0)}, ${scalar("ao", 1)}, ${scalar("opacity", 1)}, ${scalar("clearcoat", 0)}, ${scalar("clearcoat_roughness", 0)});
}`;
}

// What is shown of each map and channel, as display values: colours coded as sRGB, normals as their codes, data as they are.
function shownOf(manifest, maps) {
  const cases = [];
  for (const map of maps) {
    const at = map.channels.map(i => `m.value[${i}]`);
    const shown = map.kind === "color" ? `coded(u_exposure * (${TO_REC709[manifest.working_space] || ""}vec3(${at.join(", ")})))`
      : map.kind === "normal" ? `0.5 + 0.5 * vec3(${at.join(", ")}, patina_normal_z(${at.join(", ")}))`
      : map.kind === "data" ? `vec3(u_exposure * ${at[0]})` : "";
    if (shown) cases.push([`map:${map.map}`, shown]);
    if (map.channels.length > 1) {
      for (const i of map.channels) {
        const {component, encoding} = manifest.channels[i];
        const value = `m.value[${i}]`;
        cases.push([`channel:${i}`, map.kind === "color" && encoding !== "linear" ? `coded(vec3(u_exposure * ${value}))`
          : encoding === "normal_xy" ? `vec3(0.5 + 0.5 * ${value})` : `vec3(u_exposure * ${value})`, component]);
      }
    }
  }
  const body = cases.map(([, shown], i) => `  if (u_show == ${i + 1}) return ${shown};`).join("\n");
  return {names: ["lit", ...cases.map(([name]) => name)], text: `vec3 shown_of(PatinaMaterial m) {\n${body}\n  return vec3(0.0);\n}`};
}

// The source as a second decoder with the same result.
function sourceOf(manifest, source) {
  if (!source) return "";
  const words = {srgb: "PATINA_SRGB", normal_xy: "PATINA_NORMAL_XY", signed_log: "PATINA_SIGNED_LOG", linear: "PATINA_SCALED"};
  const values = source.channels.map((channel, i) => {
    // What the source has none of is shown as the container has it: no difference.
    if (!channel) return `  material.value[${i}] = decoded.value[${i}];`;
    const value = channel.constant === undefined ? `texel${channel.texture}[${channel.lane}]` : number(channel.constant);
    return `  material.value[${i}] = ${words[channel.encoding]}(${value}, ${number(channel.scale)});`;
  });
  return `${source.textures.map((_, i) => `uniform highp sampler2D u_source_${i};`).join("\n")}
PatinaMaterial source_material(vec2 uv, float s, PatinaMaterial decoded) {
  float level = clamp(s - ${number(source.first_mip)}, 0.0, ${number(source.levels.length - 1)});
${source.textures.map((_, i) => `  vec4 texel${i} = textureLod(u_source_${i}, uv, level);`).join("\n")}
  PatinaMaterial material;
${values.join("\n")}
  return material;
}`;
}

// The decoder of a material with the layers of its network written out, product by product in the same order: software
// renderers take several times as long for arrays that a loop walks through. Weights in a texture keep their loops.
function writtenOut(shader) {
  const found = /#define PATINA_MATERIAL_LAYERS(.*)/.exec(shader);
  if (!found || shader.includes("#define PATINA_MATERIAL_WEIGHTS_SHIFT")) return shader;
  const layers = [...found[1].matchAll(/_LAYER\((\d+), (\d+), (\d+), (\d+)\)/g)].map(([, ...numbers]) => {
    const [inputs, outputs, m, v] = numbers.map(Number);
    const lines = [];
    for (let o = 0; o < outputs; ++o) {
      let sum = `PATINA_MATERIAL_VECTOR(${v + o})`;
      for (let i = 0; i < inputs; ++i) sum += ` + PATINA_MUL(PATINA_MATERIAL_MATRIX(${m + o * inputs + i}), x[${i}])`;
      lines.push(`y[${o}] = ${sum};`);
    }
    for (let o = 0; o < outputs; ++o) lines.push(`x[${o}] = max(y[${o}], vec4(0.0));`);
    return lines.join(" ");
  });
  return shader.replace(found[0], `#define PATINA_MATERIAL_LAYERS ${layers.join(" ")}`);
}

// {vertex, fragment, names: what u_show = 0, 1, ... is} for a material.
export function materialShaders({manifest, shader, source}) {
  const maps = mapsOf(manifest);
  const shown = shownOf(manifest, maps);
  const scene = manifest.scene || {};
  const cutoff = scene.alpha_mode === "mask" ? `  if (u_show == 0 && look_of(m).opacity < ${number(scene.alpha_cutoff ?? 0.5)}) discard;` : "";
  const hasAlpha = maps.some(map => map.map === "opacity") && scene.alpha_mode !== "opaque" && scene.alpha_mode !== "mask";
  const fragment = `${VERSION}#define PATINA_DERIVATIVES
${writtenOut(shader)}
uniform int u_show, u_compare;   // u_compare: 0 decoded, 1 source, 2 wipe, 3 difference
uniform float u_wipe, u_gain, u_mip;
in vec3 v_place, v_normal, v_tangent;
in vec2 v_uv;
out vec4 o_color;
${STUDIO}
${SURFACE}
${lookOf(manifest, maps)}
${shown.text}
${sourceOf(manifest, source)}
vec3 display(PatinaMaterial m, vec3 n, vec3 t) {
  if (u_show > 0) return clamp(shown_of(m), 0.0, 1.0);
  Look look = look_of(m);
  return coded(tone(u_exposure * ${scene.unlit ? "look.base" : "lit(look, v_place, n, t)"}));
}
void main() {
  float s = patina_material_scale(dFdx(v_uv), dFdy(v_uv));
  if (u_mip >= 0.0) s = u_mip;
  vec3 n = normalize(v_normal), t = normalize(v_tangent - n * dot(n, v_tangent));
  if (dot(n, kEye - v_place) < 0.0) n = -n;   // the back of the plane
  PatinaMaterial m = patina_material_lod(v_uv, s);
${source ? `  if (u_compare == 3) {
    o_color = vec4(min(u_gain * abs(display(m, n, t) - display(source_material(v_uv, s, m), n, t)), 1.0), 1.0);
    return;
  }
  if (u_compare == 1 || (u_compare == 2 && gl_FragCoord.x < u_wipe)) m = source_material(v_uv, s, m);` : ""}
${cutoff}
  float alpha = ${hasAlpha ? "u_show == 0 ? clamp(look_of(m).opacity, 0.0, 1.0) : 1.0" : "1.0"};
  o_color = vec4(display(m, n, t) * alpha, alpha);
}`;
  return {vertex: VERTEX, fragment, names: shown.names};
}

// Where the neural texture of a BRDF that varies is looked at: its level where one texel is as large as a pixel.
const LEVEL = `
uniform float u_mip;
float level_of(vec2 uv) {
  vec2 size = vec2(textureSize(patina_feature_0, 0)), x = dFdx(uv) * size, y = dFdy(uv) * size;
  return u_mip >= 0.0 ? u_mip : max(0.5 * log2(max(max(dot(x, x), dot(y, y)), 1e-12)), 0.0);
}`;

const isVarying = ({manifest}) => manifest.kind === "svbrdf";

// A measured BRDF under the light and the middles of the studio's lamps; one that varies, over its texture.
export function brdfShaders(container) {
  const {manifest, shader} = container;
  const fragment = `${VERSION}${shader}
in vec3 v_place, v_normal, v_tangent;
in vec2 v_uv;
out vec4 o_color;
${STUDIO}
${isVarying(container) ? LEVEL : ""}
void main() {
${isVarying(container) ? "  float level = level_of(v_uv);" : ""}
  vec3 n = normalize(v_normal), t = normalize(v_tangent - n * dot(n, v_tangent));
  if (dot(n, kEye - v_place) < 0.0) n = -n;
  mat3 local = transpose(mat3(t, cross(n, t), n));
  vec3 wo = local * normalize(kEye - v_place);
  vec3 sum = vec3(0.0);
  int lamps = u_studio > 0.0 ? 3 : 0;
  for (int i = -1; i < lamps; ++i) {
    vec3 wi = local * (i < 0 ? normalize(u_light_place - v_place) : kLampAt[max(i, 0)]);
    vec3 power = i < 0 ? vec3(3.14159265 * u_light) : u_studio * kLamp[max(i, 0)].rgb * 6.2831853 / kLamp[max(i, 0)].w;
    sum += power * ${isVarying(container) ? "patina_svbrdf(wi, wo, v_uv, level)" : "patina_brdf(wi, wo)"} * max(wi.z, 0.0);
  }
  sum = max(${TO_REC709[manifest.working_space] || ""}sum, 0.0);
  o_color = vec4(coded(tone(u_exposure * sum)), 1.0);
}`;
  return {vertex: VERTEX, fragment, names: ["lit"]};
}

// A sheet of values over directions, colours in place of tangents.
export function lobeShaders() {
  const fragment = `${VERSION}precision highp float;
in vec3 v_place, v_normal;
in vec2 v_uv;
in vec3 v_color;
out vec4 o_color;
void main() {
  vec3 n = normalize(v_normal);
  float shade = 0.55 + 0.45 * abs(dot(n, normalize(vec3(-0.3, 0.5, 0.8))));
  o_color = vec4(pow(clamp(v_color, 0.0, 1.0), vec3(1.0 / 2.2)) * shade, 1.0);
}`;
  const vertex = VERTEX.replace("out vec2 v_uv;", "out vec2 v_uv;\nout vec3 v_color;").replace("v_uv = a_uv * u_repeat;", "v_uv = a_uv * u_repeat;\n  v_color = a_tangent;");
  return {vertex, fragment};
}

// Values at places, as floats: column x is place x, row y channels 4y to 4y + 3.
export function materialProbe({manifest, shader, source}) {
  const count = manifest.channels.length;
  return {vertex: COVER, fragment: `${VERSION}${writtenOut(shader)}
uniform highp sampler2D u_places;   // u, v, mip, 1 for the source
out vec4 o_values;
${sourceOf(manifest, source)}
void main() {
  vec4 place = texelFetch(u_places, ivec2(int(gl_FragCoord.x), 0), 0);
  PatinaMaterial m = patina_material_lod(place.xy, place.z);
${source ? "  if (place.w > 0.0) m = source_material(place.xy, place.z, m);" : ""}
  int first = 4 * int(gl_FragCoord.y);
  vec4 values = vec4(0.0);
  for (int i = 0; i < 4; ++i)
    if (first + i < ${count}) values[i] = m.value[first + i];
  o_values = values;
}`};
}

// Values of f at pairs of directions, wi in the upper row and wo in the lower one; of a BRDF that varies all at one place.
export function brdfProbe(container) {
  return {vertex: COVER, fragment: `${VERSION}${container.shader}
uniform highp sampler2D u_places;
uniform vec3 u_place;   // u, v, mip
out vec4 o_values;
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  vec3 wi = texelFetch(u_places, ivec2(at.x, 2 * at.y), 0).xyz, wo = texelFetch(u_places, ivec2(at.x, 2 * at.y + 1), 0).xyz;
  o_values = vec4(${isVarying(container) ? "patina_svbrdf(wi, wo, u_place.xy, u_place.z)" : "patina_brdf(wi, wo)"}, 1.0);
}`};
}

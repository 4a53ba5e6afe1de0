// Accuracy against time as a line in SVG, in the manner of the report pages.
import {decibels, duration, h, svg} from "./dom.js";

const HEIGHT = 260, LEFT = 52, RIGHT = 16, TOP = 12, BOTTOM = 42;

// Round steps: 1, 2 or 5 times a power of ten, so that there are about `wanted`.
function steps(low, high, wanted) {
  const span = Math.max(high - low, 1e-6);
  const power = 10 ** Math.floor(Math.log10(span / wanted));
  const step = [1, 2, 5, 10].map(factor => factor * power).find(size => span / size <= wanted) || 10 * power;
  const values = [];
  for (let at = Math.ceil(low / step - 1e-9) * step; at <= high + step * 1e-9; at += step) values.push(Number(at.toPrecision(12)));
  return values;
}

// points: [{time_s, psnr_db}], in order of time. room: pixels across; the text keeps its size.
export function accuracyPlot(points, isLive, room) {
  const WIDTH = Math.min(Math.max(room, 300), 680);
  const first = points[0], last = points[points.length - 1];
  const from = 0;
  const to = Math.max(last.time_s, 0.1);
  const values = points.map(point => point.psnr_db);
  let low = Math.min(...values), high = Math.max(...values);
  const margin = Math.max((high - low) * 0.08, 0.25);
  low -= margin;
  high += 2.5 * margin;  // room for the last figure
  const x = time => LEFT + (time - from) / (to - from) * (WIDTH - LEFT - RIGHT);
  const y = value => TOP + (high - value) / (high - low) * (HEIGHT - TOP - BOTTOM);
  const said = `From ${decibels(first.psnr_db)} at ${duration(first.time_s)} to ${decibels(last.psnr_db)} at ${duration(last.time_s)}`;
  const path = points.map((point, i) => `${i === 0 ? "M" : "L"}${x(point.time_s).toFixed(1)} ${y(point.psnr_db).toFixed(1)}`).join("");
  return h("figure", {class: "plot"},
    svg("svg", {viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": `Accuracy against time. ${said}.`},
      steps(low, high, 5).map(value => [
        svg("line", {class: "grid", x1: LEFT, x2: WIDTH - RIGHT, y1: y(value), y2: y(value)}),
        svg("text", {class: "tick", x: LEFT - 8, y: y(value) + 4.5, "text-anchor": "end"}, String(value))]).flat(),
      steps(from, to, WIDTH > 450 ? 6 : 4).map(value => [
        svg("line", {class: "axis", x1: x(value), x2: x(value), y1: HEIGHT - BOTTOM, y2: HEIGHT - BOTTOM + 5}),
        svg("text", {class: "tick", x: x(value), y: HEIGHT - BOTTOM + 19, "text-anchor": "middle"}, String(value))]).flat(),
      svg("path", {class: "axis", d: `M${LEFT} ${HEIGHT - BOTTOM}H${WIDTH - RIGHT}`}),
      svg("text", {class: "tick", x: WIDTH - RIGHT, y: HEIGHT - 4, "text-anchor": "end"}, "seconds since the job began"),
      svg("text", {class: "tick", x: LEFT + 6, y: TOP + 6}, "dB"),
      svg("g", {class: "c0"}, svg("path", {class: "line", d: path}),
        svg("circle", {class: "point", cx: x(last.time_s), cy: y(last.psnr_db), r: 4})),
      svg("text", {class: "note", x: x(last.time_s), y: y(last.psnr_db) - 12, "text-anchor": x(last.time_s) < LEFT + 80 ? "start" : "end"}, decibels(last.psnr_db))),
    h("figcaption", {}, `${said}, on held-out samples${isLive ? "; still learning" : ""}.`));
}

// What a material is put on: {positions, normals, tangents, uvs, triangles}. u runs to the right and v downwards.

function quad(shape, corner, across, down, normal, uv) {
  const first = shape.positions.length / 3;
  for (const [x, y] of [[0, 0], [1, 0], [1, 1], [0, 1]]) {
    shape.positions.push(...corner.map((value, i) => value + x * across[i] + y * down[i]));
    shape.normals.push(...normal);
    shape.tangents.push(...across);
    shape.uvs.push(x * uv[0], y * uv[1]);
  }
  shape.triangles.push(first, first + 2, first + 1, first, first + 3, first + 2);
}

const empty = () => ({positions: [], normals: [], tangents: [], uvs: [], triangles: []});

// aspect: width of the texture over its height.
export function plane(aspect) {
  const shape = empty();
  const w = Math.min(1, aspect), h = Math.min(1, 1 / aspect);
  quad(shape, [-w, h, 0], [2 * w, 0, 0], [0, -2 * h, 0], [0, 0, 1], [1, 1]);
  return shape;
}

export function cube() {
  const shape = empty(), s = 0.62;
  quad(shape, [-s, s, s], [2 * s, 0, 0], [0, -2 * s, 0], [0, 0, 1], [1, 1]);
  quad(shape, [s, s, -s], [-2 * s, 0, 0], [0, -2 * s, 0], [0, 0, -1], [1, 1]);
  quad(shape, [s, s, s], [0, 0, -2 * s], [0, -2 * s, 0], [1, 0, 0], [1, 1]);
  quad(shape, [-s, s, -s], [0, 0, 2 * s], [0, -2 * s, 0], [-1, 0, 0], [1, 1]);
  quad(shape, [-s, s, -s], [2 * s, 0, 0], [0, 0, 2 * s], [0, 1, 0], [1, 1]);
  quad(shape, [-s, -s, s], [2 * s, 0, 0], [0, 0, -2 * s], [0, -1, 0], [1, 1]);
  return shape;
}

// turns: how often the texture goes round.
export function sphere(turns, across = 80, down = 40) {
  const shape = empty();
  for (let row = 0; row <= down; ++row) {
    const theta = Math.PI * row / down;
    for (let column = 0; column <= across; ++column) {
      const phi = 2 * Math.PI * column / across - Math.PI;
      const normal = [Math.sin(theta) * Math.sin(phi), Math.cos(theta), Math.sin(theta) * Math.cos(phi)];
      shape.normals.push(...normal);
      shape.positions.push(...normal);
      shape.tangents.push(Math.cos(phi), 0, -Math.sin(phi));
      shape.uvs.push(turns * column / across, row / down);
      if (row === down || column === across) continue;
      const at = row * (across + 1) + column, below = at + across + 1;
      shape.triangles.push(at, below, below + 1, at, below + 1, at + 1);
    }
  }
  return shape;
}

// A sheet over directions of a hemisphere: at(theta, phi) gives [x, y, z] and a colour [r, g, b], which stands in place of
// the tangent. Normals are those of the sheet.
export function hemisphere(across, down, at) {
  const shape = empty();
  for (let row = 0; row <= down; ++row) {
    for (let column = 0; column <= across; ++column) {
      const {place, color} = at(row, column);
      shape.positions.push(...place);
      shape.tangents.push(...color);
      shape.uvs.push(column / across, row / down);
      if (row === down || column === across) continue;
      const first = row * (across + 1) + column, below = first + across + 1;
      shape.triangles.push(first, below, below + 1, first, below + 1, first + 1);
    }
  }
  const point = i => shape.positions.slice(3 * i, 3 * i + 3);
  for (let row = 0; row <= down; ++row) {
    for (let column = 0; column <= across; ++column) {
      const index = (r, c) => Math.min(Math.max(r, 0), down) * (across + 1) + (c + across) % across;
      const [n, s, w, e] = [index(row - 1, column), index(row + 1, column), index(row, column - 1), index(row, column + 1)].map(point);
      const a = s.map((value, i) => value - n[i]), b = e.map((value, i) => value - w[i]);
      const cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
      const length = Math.hypot(...cross) || 1;
      shape.normals.push(...cross.map(value => value / length));
    }
  }
  return shape;
}

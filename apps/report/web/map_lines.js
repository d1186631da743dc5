// (b) The map: what is drawn in the scene.

const LANDMARK_COLORS = {
  camera: {
    legend: list => make(
        'span', {}, swatch('var(--soft)', 'found by the stereo pair'),
        list.camera.includes(1) ? swatch('var(--truth)', 'by the fisheye') : '')
  },
  'time of birth': {
    value: (list, i) => list.born[i] / 65535,
    legend: list => rampLegend(seconds(list.born_from), seconds(list.born_to))
  },
  views: {
    value: (list, i) => Math.log2(Math.max(1, list.views[i] - 1)) / 5,
    legend: () => rampLegend('2', '33 or more keyframes')
  },
  'sigma': {
    value: (list, i) => list.sigma[i] === 65535 ?
        1 :
        Math.log(Math.max(list.sigma[i], 1) / list.low) / Math.log(list.high / list.low),
    legend: list => rampLegend(
        withUnit(list.low * list.sigma_unit_mm, 'mm'),
        withUnit(list.high * list.sigma_unit_mm, 'mm') + ' (1 sigma, poses taken for exact)')
  },
};

function landmarkColors(by) {
  const list = data.landmarks, colors = new Uint8Array(4 * list.count);
  if (by === 'sigma' && list.low === undefined) {
    const sorted = Uint16Array.from(list.sigma).sort();
    list.low = Math.max(1, sorted[Math.floor(0.05 * sorted.length)] || 1);
    list.high =
        Math.max(2 * list.low, Math.min(65534, sorted[Math.floor(0.95 * sorted.length)] || 2));
  }
  const plain = [bytes('--soft'), bytes('--truth')], value = LANDMARK_COLORS[by].value;
  for (let i = 0; i < list.count; ++i) {
    const color = value ? ramp(value(list, i)) : plain[list.camera[i]];
    colors[4 * i] = color[0];
    colors[4 * i + 1] = color[1];
    colors[4 * i + 2] = color[2];
    colors[4 * i + 3] = 255;
  }
  return colors;
}

const bytes = variable =>
    (cssColor(variable).match(/[0-9a-f]{2}/gi) || ['80', '80', '80']).map(hex => parseInt(hex, 16));

class LineSet {
  constructor() {
    this.positions = [];
    this.colors = [];
  }
  add(a, b, color) {
    this.positions.push(...a, ...b);
    this.colors.push(...color, 255, ...color, 255);
  }
}

// Names of the components that poses are in, and a colour of each; the colours come again after
// seven.
const COMPONENTS = [];
function findComponents() {
  COMPONENTS.splice(
      0, COMPONENTS.length, ...[...new Set(frames.component)].filter(known).sort((a, b) => a - b));
}
findComponents();
const COMPONENT_COLORS =
    ['--s-map', '--s-odometry', '--s-relocalised', '--truth', '--s-lost', '--s-starting', '--ink'];
const componentVariable = component =>
    COMPONENT_COLORS[Math.max(0, COMPONENTS.indexOf(component)) % COMPONENT_COLORS.length];

// How a path is coloured: the colour of frame i.
const PATH_COLORS = {
  state: () => {
    const colors = frames.states.map(state => bytes(stateVariable(state)));
    return i => colors[frames.state[i]];
  },
  component: () => {
    const colors = new Map(COMPONENTS.map(name => [name, bytes(componentVariable(name))]));
    return i => colors.get(frames.component[i]) || bytes('--soft');
  },
};

// The path of a camera; a gap where it was lost or another component goes on.
function pathLines(camera, color) {
  const lines = new LineSet();
  let last = -1;
  for (let i = 0; i < frames.count; ++i) {
    if (frames.camera[i] !== camera) continue;
    const joined = last >= 0 && hasPose(i) && hasPose(last) &&
        (Object.is(frames.component[i], frames.component[last]) ||
         Number.isNaN(frames.component[last]));
    if (joined) lines.add(positionOf(frames, last), positionOf(frames, i), color(i));
    last = i;
  }
  return lines;
}

// Its frames, which can be clicked on.
function pathDots(camera, color) {
  const dots = {positions: [], colors: []};
  for (let i = 0; i < frames.count; ++i) {
    if (frames.camera[i] !== camera || !hasPose(i)) continue;
    dots.positions.push(...positionOf(frames, i));
    dots.colors.push(...color(i), 255);
  }
  return dots;
}

// The middle and the size of what is drawn: most landmarks, and all of the paths.
function sceneExtent() {
  const list = data.landmarks, points = [];
  const step = Math.max(1, Math.floor(list.count / 4000));
  for (let i = 0; i < list.count; i += step) points.push(positionOf(list, i));
  const path = [];
  for (let i = 0; i < frames.count; ++i)
    if (hasPose(i)) path.push(positionOf(frames, i));
  for (let i = 0; i < data.keyframes.count; ++i) path.push(positionOf(data.keyframes, i));
  const low = [], high = [];
  for (let k = 0; k < 3; ++k) {
    const values = points.map(point => point[k]), own = path.map(point => point[k]);
    low[k] = Math.min(
        values.length ? quantile(values, 0.1) : Infinity,
        ...own.length ? [own.reduce((a, b) => Math.min(a, b))] : []);
    high[k] = Math.max(
        values.length ? quantile(values, 0.9) : -Infinity,
        ...own.length ? [own.reduce((a, b) => Math.max(a, b))] : []);
    if (!(low[k] <= high[k])) {
      low[k] = -1;
      high[k] = 1;
    }
  }
  return {
    middle: low.map((value, k) => (value + high[k]) / 2),
    size: Math.max(0.05, Math.hypot(...high.map((value, k) => value - low[k])))
  };
}

const CORNERS = [[-0.5, -0.375], [0.5, -0.375], [0.5, 0.375], [-0.5, 0.375]];
function addFrustum(lines, position, rotation, size, color) {
  const corners =
      CORNERS.map(([x, y]) => plus(position, turned(rotation, [x * size, y * size, 0.7 * size])));
  corners.forEach((corner, k) => {
    lines.add(position, corner, color);
    lines.add(corner, corners[(k + 1) % 4], color);
  });
}

// Axes of a symmetric 3x3 matrix (xx xy xz yy yz zz), each as long as its standard deviation
// (Jacobi).
function ellipsoidAxes(c) {
  const a = [[c[0], c[1], c[2]], [c[1], c[3], c[4]], [c[2], c[4], c[5]]],
        v = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
  for (let sweep = 0; sweep < 12; ++sweep)
    for (const [p, q] of [[0, 1], [0, 2], [1, 2]]) {
      if (Math.abs(a[p][q]) < 1e-30) continue;
      const angle = 0.5 * Math.atan2(2 * a[p][q], a[q][q] - a[p][p]), s = Math.sin(angle),
            co = Math.cos(angle);
      for (let k = 0; k < 3; ++k) {
        const x = a[k][p], y = a[k][q];
        a[k][p] = co * x - s * y;
        a[k][q] = s * x + co * y;
      }
      for (let k = 0; k < 3; ++k) {
        const x = a[p][k], y = a[q][k];
        a[p][k] = co * x - s * y;
        a[q][k] = s * x + co * y;
      }
      for (let k = 0; k < 3; ++k) {
        const x = v[k][p], y = v[k][q];
        v[k][p] = co * x - s * y;
        v[k][q] = s * x + co * y;
      }
    }
  return [0, 1, 2].map(k => v.map(row => row[k] * Math.sqrt(Math.max(0, a[k][k]))));
}

function ellipseLines(size) {
  const list = data.keyframes, lines = new LineSet(), all = [];
  for (let i = 0; i < list.count; ++i) {
    const c = list.covariance.subarray(6 * i, 6 * i + 6);
    if (list.camera[i] === 0 && Number.isFinite(c[0])) all.push([i, ellipsoidAxes(c)]);
  }
  const longest = axes => Math.max(...axes.map(axis => Math.hypot(...axis)));
  const largest = quantile(all.map(([, axes]) => longest(axes)), 0.9);
  if (!(largest > 0)) return {lines, factor: 0};
  const factor = roundUp(0.5 * size * 0.06 / largest), color = bytes('--truth');
  const every = Math.ceil(all.length / 200);
  all.forEach(([i, axes], n) => {
    if (n % every || factor * longest(axes) > size)
      return;  // beyond all bounds: the timeline has it
    const middle = positionOf(list, i);
    for (const [p, q] of [[0, 1], [0, 2], [1, 2]])
      for (let k = 0; k < 24; ++k) {
        const point = step => plus(
            plus(middle, axes[p], factor * Math.cos(step * Math.PI / 12)), axes[q],
            factor * Math.sin(step * Math.PI / 12));
        lines.add(point(k), point(k + 1), color);
      }
  });
  return {lines, factor};
}

// Outlines of what the chosen keyframe's neighbours saw are in the coverage; here the grid as a
// carpet.
function loopLines() {
  const lines = new LineSet();
  for (const loop of data.loops) {
    if (loop.outcome !== 'accepted') continue;
    const ends = [loop.time, loop.match_time].map(time => frameNear(time, 0));
    if (ends.every(i => i >= 0 && hasPose(i)))
      lines.add(positionOf(frames, ends[0]), positionOf(frames, ends[1]), bytes('--s-lost'));
  }
  return lines;
}

function truthLines() {
  const lines = new LineSet(), list = data.truth, last = [-1, -1], color = bytes('--ink');
  for (let i = 0; i < list.count; ++i) {
    const before = last[list.camera[i]];
    if (before >= 0) lines.add(positionOf(list, before), positionOf(list, i), color);
    last[list.camera[i]] = i;
  }
  return lines;
}

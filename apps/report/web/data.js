'use strict';
// The report's data, decoded, and numbers as people read them.

const begun = performance.now();

const TYPES = {
  f64: Float64Array,
  f32: Float32Array,
  u32: Uint32Array,
  u16: Uint16Array,
  u8: Uint8Array
};

// {"type": ..., "data": base64} becomes a typed array, wherever it stands.
function decoded(value) {
  if (Array.isArray(value)) return value.map(decoded);
  if (value === null || typeof value !== 'object') return value;
  if (value.type in TYPES && typeof value.data === 'string') {
    const text = atob(value.data);
    const bytes = new Uint8Array(text.length);
    for (let i = 0; i < text.length; ++i) bytes[i] = text.charCodeAt(i);
    return new TYPES[value.type](bytes.buffer);
  }
  return Object.fromEntries(Object.entries(value).map(([key, part]) => [key, decoded(part)]));
}

const data = decoded(JSON.parse(document.getElementById('data').textContent));
const frames = data.frames;
let start =
    frames.count > 0 ? frames.time[0] : (data.keyframes.count > 0 ? data.keyframes.time[0] : 0);
const CAMERAS = ['stereo', 'fisheye'];
const STATES = ['map', 'odometry', 'relocalised', 'starting', 'lost'];

// Of element i: what a camera did, in words.
const stateOf = i => frames.states[frames.state[i]];
const hasPose = i => Number.isFinite(frames.position[3 * i]);
const positionOf = (list, i) => list.position.subarray(3 * i, 3 * i + 3);
const known = value => value !== null && value !== undefined && Number.isFinite(value);

function number(value, digits = 3) {
  if (!known(value)) return '–';
  if (Number.isInteger(value)) return String(value);
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-4 || size >= 1e7)) return value.toExponential(digits - 1);
  return size >= 10 ** digits ? value.toFixed(0) : String(Number(value.toPrecision(digits)));
}
const withUnit = (value, unit, digits = 3) =>
    known(value) ? number(value, digits) + (unit ? ' ' + unit : '') : '–';
const length = metres => !known(metres) ? '–' :
    Math.abs(metres) < 1                ? withUnit(1000 * metres, 'mm') :
                                          withUnit(metres, 'm', 4);
const seconds = time => (time - start).toFixed(2) + ' s';

// a.b.c of an object; undefined where there is none.
const at = (object, path) => path.split('.').reduce(
    (value, key) => value === null || value === undefined ? undefined : value[key], object);

// The unit that a key of summary.json names at its end.
function unitOf(key) {
  if (/_mm\.|_mm$/.test(key)) return 'mm';
  if (/translation_m\.|position_m\.|_m$/.test(key) && !/count$/.test(key)) return 'm';
  if (/_m2$/.test(key)) return 'm²';
  if (/_ms\./.test(key)) return 'ms';
  if (/_mm_per_px$/.test(key)) return 'mm/px';
  if (/_px$/.test(key)) return 'px';
  if (/_sigmas$/.test(key)) return 'standard deviations';
  if (/rotation_deg\.|_deg$/.test(key) && !/count$/.test(key)) return '°';
  if (/(^|\.)seconds$|_s$/.test(key)) return 's';
  if (/_mrad$/.test(key)) return 'mrad';
  if (/\.rate$/.test(key)) return 'Hz';
  return '';
}

function quantile(values, share) {
  const sorted = values.filter(known).sort((a, b) => a - b);
  return sorted.length ? sorted[Math.floor(share * (sorted.length - 1))] : NaN;
}

// An element: name, attributes (functions are listeners), children (text or elements).
function make(name, attributes = {}, ...children) {
  const svg =
      ['svg', 'g', 'path', 'rect', 'line', 'text', 'circle', 'title', 'polyline'].includes(name);
  const element = svg ? document.createElementNS('http://www.w3.org/2000/svg', name) :
                        document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (typeof value === 'function')
      element.addEventListener(key, value);
    else if (value !== undefined && value !== false)
      element.setAttribute(key, value === true ? '' : value);
  }
  element.append(...children.flat(Infinity).filter(child => child !== null && child !== undefined));
  return element;
}

// Dark to bright, even in lightness: viridis at nine places.
const RAMP = [
  [68, 1, 84], [72, 40, 120], [62, 74, 137], [49, 104, 142], [38, 130, 142], [31, 158, 137],
  [53, 183, 121], [109, 205, 89], [180, 222, 44], [253, 231, 37]
];
function ramp(share) {
  const x = Math.min(1, Math.max(0, share)) * (RAMP.length - 1),
        i = Math.min(RAMP.length - 2, Math.floor(x)), f = x - i;
  return RAMP[i].map((from, k) => Math.round(from + f * (RAMP[i + 1][k] - from)));
}
const rgb = color => 'rgb(' + color.join(',') + ')';
const RAMP_STYLE = 'background:linear-gradient(90deg,' + RAMP.map(rgb).join(',') + ')';
const rampLegend = (low, high) =>
    make('span', {}, low, make('span', {class: 'ramp', style: RAMP_STYLE}), high);

const cssColor = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const stateVariable = state => STATES.includes(state) ? '--s-' + state : '--s-out';

// Which frame is chosen; all views follow.
const selection = {
  frame: -1,
  listeners: [],  // [[section, function], ...]
  section: '',    // that is being made: who listens belongs to it
  listen(listener) {
    this.listeners.push([this.section, listener]);
  },
  forget(section) {
    this.listeners = this.listeners.filter(([of]) => of !== section);
  },
  set(i) {
    if (i < 0 || i >= frames.count || i === this.frame) return;
    this.frame = i;
    for (const [, listener] of this.listeners) listener(i);
  },
  step(by) {
    const camera = this.frame < 0 ? 0 : frames.camera[this.frame];
    for (let i = (this.frame < 0 ? (by > 0 ? -1 : frames.count) : this.frame) + by;
         i >= 0 && i < frames.count; i += by) {
      if (frames.camera[i] === camera) return this.set(i);
    }
  },
};

// The frame of a camera (0, 1; -1: any) nearest to a time.
function frameNear(time, camera = -1) {
  let best = -1, distance = Infinity;
  for (let i = 0; i < frames.count; ++i) {
    const off = Math.abs(frames.time[i] - time);
    if ((camera < 0 || frames.camera[i] === camera) && off < distance) {
      best = i;
      distance = off;
    }
  }
  return best;
}

const pictureSource = picture => 'data:image/jpeg;base64,' + picture.jpeg;
const picturesAt = time => data.pictures.filter(picture => Math.abs(picture.time - time) < 1e-3);

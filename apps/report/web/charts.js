// Charts over time as SVG, which follow the theme and print sharply.

// As wide as the page, so that text in the charts is as large as elsewhere.
const WIDTH = Math.min(1100, Math.max(680, document.documentElement.clientWidth - 40)), LEFT = 118,
      RIGHT = 12;
const timeline = {
  from: start,
  to: frames.count > 1 ? Math.max(...frames.time) : start + 1,
  x(time) {
    return LEFT + (WIDTH - LEFT - RIGHT) * (time - this.from) / Math.max(1e-9, this.to - this.from);
  },
  time(x) {
    return this.from + (x - LEFT) / (WIDTH - LEFT - RIGHT) * (this.to - this.from);
  },
};

// 1, 2 or 5 times a power of ten, at least `length`.
function roundUp(length) {
  if (!(length > 0)) return 1;
  const power = 10 ** Math.floor(Math.log10(length));
  return [1, 2, 5, 10].find(step => step * power >= length * (1 - 1e-9)) * power;
}

function timeAxis(svg, height) {
  const step = roundUp((timeline.to - timeline.from) / 10);
  for (let t = 0; t <= timeline.to - timeline.from + 1e-9; t += step) {
    const x = timeline.x(timeline.from + t);
    svg.append(
        make('line', {class: 'axis', x1: x, x2: x, y1: 0, y2: height}),
        make('text', {x, y: height + 13, 'text-anchor': 'middle'}, number(t) + ' s'));
  }
}

// A chart that shows and sets the chosen frame.
function chartFrame(height, label) {
  const svg =
      make('svg', {viewBox: `0 -4 ${WIDTH} ${height + 22}`, role: 'img', 'aria-label': label});
  timeAxis(svg, height);
  const cursor = make('line', {class: 'cursor', y1: 0, y2: height, x1: -9, x2: -9});
  const choose = event => {
    const box = svg.getBoundingClientRect();
    selection.set(frameNear(timeline.time((event.clientX - box.left) * WIDTH / box.width)));
  };
  svg.addEventListener('pointerdown', choose);
  svg.addEventListener('pointermove', event => {
    if (event.buttons & 1) choose(event);
  });
  selection.listen(i => {
    const x = timeline.x(frames.time[i]);
    cursor.setAttribute('x1', x);
    cursor.setAttribute('x2', x);
  });
  queueMicrotask(() => svg.append(cursor));  // above all else
  return svg;
}

// From 0 to nearly the largest value; in powers of ten where most of the values span more than two.
function verticalAxis(values, height, limit) {
  const most = quantile(values, 0.995), all = Math.max(...values);
  const high = Math.max(1e-12, all < 2 * most ? all : most, limit ? limit.value : 0),
        low = quantile(values.filter(value => value > 0), 0.02);
  if (low > 0 && high / low > 100) {
    const from = Math.floor(Math.log10(low)), to = Math.ceil(Math.log10(high));
    const y = value => height -
        height *
            Math.min(1, Math.max(0, (Math.log10(Math.max(value, 1e-30)) - from) / (to - from)));
    return {
      y,
      top: 10 ** to,
      ticks: Array.from({length: to - from + 1}, (_, k) => 10 ** (from + k))
    };
  }
  const top = roundUp(high * 1.02);
  return {
    y: value => height - height * Math.min(1, Math.max(0, value / top)),
    top,
    ticks: [0, top / 2, top]
  };
}

// series: [{name, unit, color, values: (i) => number, camera, marks}]; one vertical axis.
// limit: {value, name}, a line across.
function lineChart(title, unit, series, limit) {
  const height = 110;
  const values = series.map(one => {
    const points = [];
    for (let i = 0; i < frames.count; ++i) {
      if (one.camera !== undefined && frames.camera[i] !== one.camera) continue;
      points.push([frames.time[i], one.values(i)]);
    }
    return points;
  });
  const all = values.flat().map(point => point[1]).filter(known);
  if (!all.length) return null;
  const {y, ticks, top} = verticalAxis(all, height, limit);
  const svg = chartFrame(height, title);
  for (const tick of ticks) {
    svg.append(
        make('line', {class: 'axis', x1: LEFT, x2: WIDTH - RIGHT, y1: y(tick), y2: y(tick)}),
        make('text', {x: LEFT - 6, y: y(tick) + 4, 'text-anchor': 'end'}, withUnit(tick, unit)));
  }
  const beyond = all.filter(value => value > top).length;
  values.forEach((points, k) => {
    let path = '', before = false;
    for (const [time, value] of points) {
      if (!known(value)) {
        before = false;
        continue;
      }
      const place = timeline.x(time).toFixed(1) + ' ' + y(value).toFixed(1);
      path += (before ? 'L' : 'M') + place + (before ? '' : 'h.01');
      before = true;
    }
    svg.append(make('path', {
      d: path,
      fill: 'none',
      stroke: series[k].color,
      'stroke-width': 1.6,
      'stroke-linecap': 'round',
      'stroke-dasharray': series[k].dash || undefined
    }));
  });
  if (limit) {
    svg.append(
        make('line', {
          x1: LEFT,
          x2: WIDTH - RIGHT,
          y1: y(limit.value),
          y2: y(limit.value),
          stroke: 'var(--bad)',
          'stroke-dasharray': '6 3'
        }),
        make(
            'text', {class: 'label', x: WIDTH - RIGHT, y: y(limit.value) - 4, 'text-anchor': 'end'},
            limit.name));
  }
  const legend = series.map(
      one => make(
          'span', {}, make('span', {class: 'swatch line', style: 'background:' + one.color}),
          one.name + '  '));
  return make(
      'div', {class: 'chart'},
      make(
          'h3', {}, title + (unit ? ' [' + unit + ']' : ''), ' ',
          make(
              'small', {}, legend,
              beyond ? `· ${beyond === 1 ? 'one value is' : beyond + ' values are'} beyond the chart, at most ${
                           withUnit(Math.max(...all), unit)}` :
                       '')),
      svg);
}

// Stretches of the same word, as rectangles: rows of {name, runs: [[from, to, color, text]]}.
function bandChart(title, rows) {
  const rowHeight = 18, height = Math.max(1, rows.length) * rowHeight;
  const svg = chartFrame(height, title);
  rows.forEach((row, k) => {
    svg.append(make('text', {x: LEFT - 6, y: k * rowHeight + 13, 'text-anchor': 'end'}, row.name));
    for (const [from, to, color, text] of row.runs) {
      const x = timeline.x(from);
      svg.append(make(
          'rect', {
            x,
            y: k * rowHeight + 2,
            width: Math.max(1.5, timeline.x(to) - x),
            height: rowHeight - 4,
            fill: color
          },
          make('title', {}, text)));
    }
  });
  return make('div', {class: 'chart'}, title ? make('h3', {}, title) : null, svg);
}

// [[from, to, word, first]] of frames of a camera whose word is the same.
function runsOf(camera, word) {
  const runs = [];
  for (let i = 0; i < frames.count; ++i) {
    if (frames.camera[i] !== camera) continue;
    const now = word(i), last = runs[runs.length - 1];
    if (last) last[1] = frames.time[i];
    if (!last || last[2] !== now)
      runs.push([frames.time[i], frames.time[i] + (data.period_s || 0), now, i]);
  }
  return runs;
}

// bars: [{name, value, mark, text}], a mark being a second value as a tick; `limit` likewise over
// all.
function barChart(bars, limit) {
  const rowHeight = 20, left = 150, width = 700, height = bars.length * rowHeight;
  const longest = Math.max(1e-9, ...bars.map(bar => Math.max(bar.value, bar.mark)));
  // One that is very long leaves the others, and the limit, something to be seen of.
  const top = limit ? Math.max(limit.value, Math.min(longest, 5 * limit.value)) : longest;
  const x = value => left + (width - left - 240) * Math.min(1, value / top);
  const svg = make('svg', {viewBox: `0 0 ${width} ${height + 18}`, role: 'img'});
  if (limit) {
    svg.append(
        make('line', {
          x1: x(limit.value),
          x2: x(limit.value),
          y1: 0,
          y2: height,
          stroke: 'var(--bad)',
          'stroke-dasharray': '6 3'
        }),
        make(
            'text', {class: 'label', x: x(limit.value), y: height + 13, 'text-anchor': 'middle'},
            limit.name));
  }
  bars.forEach((bar, k) => {
    const y = k * rowHeight;
    svg.append(
        make('text', {class: 'label', x: left - 6, y: y + 14, 'text-anchor': 'end'}, bar.name),
        make('rect', {
          x: left,
          y: y + 4,
          width: Math.max(0.5, x(bar.value) - left),
          height: 12,
          fill: 'var(--s-map)'
        }),
        make(
            'text', {class: 'label', x: Math.max(x(bar.value), x(bar.mark)) + 6, y: y + 14},
            (bar.mark > top ? '→ ' : '') + bar.text));
    if (bar.mark <= top)
      svg.append(make('line', {
        x1: x(bar.mark),
        x2: x(bar.mark),
        y1: y + 2,
        y2: y + 18,
        stroke: 'var(--ink)',
        'stroke-width': 2
      }));
  });
  return svg;
}

function histogram(values, unit, bins = 24) {
  const finite = values.filter(known);
  if (!finite.length) return null;
  const low = quantile(finite, 0.005), high = Math.max(quantile(finite, 0.995), low + 1e-9);
  const counts = new Array(bins).fill(0);
  for (const value of finite)
    counts[Math.min(bins - 1, Math.max(0, Math.floor((value - low) / (high - low) * bins)))] += 1;
  const width = 460, height = 120, most = Math.max(...counts);
  const svg = make(
      'svg', {viewBox: `0 -14 ${width} ${height + 32}`, role: 'img', style: 'max-width:34rem'});
  counts.forEach(
      (count, k) => svg.append(make(
          'rect', {
            x: k * width / bins + 1,
            y: height - height * count / most,
            width: width / bins - 2,
            height: height * count / most,
            fill: 'var(--s-map)'
          },
          make(
              'title', {},
              `${withUnit(low + k * (high - low) / bins, unit)} to ${
                  withUnit(low + (k + 1) * (high - low) / bins, unit)}: ${count}`))));
  svg.append(
      make('line', {class: 'axis', x1: 0, x2: width, y1: height, y2: height}),
      make('text', {x: 0, y: height + 14}, withUnit(low, unit)),
      make('text', {x: width, y: height + 14, 'text-anchor': 'end'}, withUnit(high, unit)),
      make('text', {x: 0, y: -3}, 'most in a bin: ' + most));
  return svg;
}

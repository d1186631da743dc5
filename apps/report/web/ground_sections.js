// (d) Coverage.

// Where a point lies in the grid, in cells from its upper left corner.
function placeInGrid(point) {
  const grid = data.coverage_grid,
        along = axis => axis[0] * point[0] + axis[1] * point[1] + axis[2] * point[2];
  return [
    (along(grid.axes[0]) - grid.corner_m[0]) / grid.cell_m,
    grid.rows - (along(grid.axes[1]) - grid.corner_m[1]) / grid.cell_m
  ];
}

// The stereo pair's way over the ground, a line per stretch with poses.
function pathInGrid() {
  const stretches = [];
  let open = false;
  for (let i = 0; i < frames.count; ++i) {
    if (frames.camera[i] !== 0) continue;
    if (hasPose(i) && !open) stretches.push([]);
    open = hasPose(i);
    if (open) stretches[stretches.length - 1].push(placeInGrid(positionOf(frames, i)));
  }
  return stretches.map(
      points => make('polyline', {
        class: 'way',
        points: points.map(([x, y]) => x.toFixed(2) + ',' + y.toFixed(2)).join(' ')
      }));
}

// The nearest stereo frame to a place in the grid, seen from above.
function frameAbove(x, y) {
  let best = -1, distance = Infinity;
  for (let i = 0; i < frames.count; ++i) {
    if (frames.camera[i] !== 0 || !hasPose(i)) continue;
    const [u, v] = placeInGrid(positionOf(frames, i)), off = Math.hypot(u - x, v - y);
    if (off < distance) [best, distance] = [i, off];
  }
  return best;
}

// A picture of the grid, with the way over it; `readout` says what is under the pointer, a click
// chooses the frame above it.
function gridPanel(values, low, high, text, readout) {
  const grid = data.coverage_grid;
  const svg = make(
      'svg', {
        viewBox: `0 0 ${grid.columns} ${grid.rows}`,
        'aria-hidden': 'true',
      },
      pathInGrid());
  const cell = event => {
    const box = svg.getBoundingClientRect(),
          scale = Math.min(box.width / grid.columns, box.height / grid.rows);
    return [
      (event.clientX - box.left - (box.width - scale * grid.columns) / 2) / scale,
      (event.clientY - box.top - (box.height - scale * grid.rows) / 2) / scale
    ];
  };
  svg.addEventListener('pointermove', event => readout(...cell(event)));
  svg.addEventListener('click', event => selection.set(frameAbove(...cell(event))));
  return make('div', {class: 'grid-box'}, gridCanvas(values, low, high, text), svg);
}

// What the files say of the cell at a place, in one line.
function cellText(x, y) {
  const grid = data.coverage_grid, column = Math.floor(x), row = grid.rows - 1 - Math.floor(y),
        i = row * grid.columns + column;
  const inside = column >= 0 && column < grid.columns && row >= 0 && row < grid.rows;
  const place = `${length(grid.corner_m[0] + (column + 0.5) * grid.cell_m)} right, ${
      length(grid.corner_m[1] + (row + 0.5) * grid.cell_m)} up`;
  if (!inside || grid.stereo_views[i] + grid.fisheye_views[i] === 0) return `${place}: not seen`;
  return `${place}: seen by ${grid.stereo_views[i]} stereo and ${
             grid.fisheye_views[i]} fisheye keyframes, ` +
      `${withUnit(grid.resolution_mm_per_px[i], 'mm/px')}, landmarks ` +
      (known(grid.sigma_mm[i]) ? `uncertain by ${withUnit(grid.sigma_mm[i], 'mm')}` : 'none');
}

function gridCanvas(values, low, high, text) {
  const
      grid = data.coverage_grid,
      canvas = make(
          'canvas',
          {class: 'grid', width: grid.columns, height: grid.rows, role: 'img', 'aria-label': text});
  const context = canvas.getContext('2d'), image = context.createImageData(grid.columns, grid.rows);
  for (let row = 0; row < grid.rows; ++row)
    for (let column = 0; column < grid.columns; ++column) {
      const value = values(row * grid.columns + column);
      if (!known(value)) continue;
      image.data.set(
          [...ramp((value - low) / Math.max(1e-12, high - low)), 255],
          4 * ((grid.rows - 1 - row) * grid.columns + column));
    }
  context.putImageData(image, 0, 0);
  return canvas;
}

function coverageSection() {
  const grid = data.coverage_grid;
  if (!grid) return null;
  const total = i => grid.stereo_views[i] + grid.fisheye_views[i], seen = i => total(i) > 0;
  const figures = data.coverage, all = [...Array(grid.columns * grid.rows).keys()].filter(seen);
  const size = `${length(grid.columns * grid.cell_m)} by ${
      length(grid.rows * grid.cell_m)}, cells of ${length(grid.cell_m)}`;
  const under = make(
      'p', {class: 'soft', 'aria-live': 'polite', id: 'under'},
      'Point at a place of these pictures: its figures are shown here. A click chooses the frame above it.');
  const readout = (x, y) => under.textContent = cellText(x, y);
  const panel = (title, unit, value, low, high, more = '') => make(
      'div', {}, make('h3', {}, title),
      gridPanel(i => seen(i) ? value(i) : NaN, low, high, title, readout),
      make('p', {class: 'soft'}, rampLegend(withUnit(low, unit), withUnit(high, unit) + more)));
  const resolution = i => grid.resolution_mm_per_px[i], sigma = i => grid.sigma_mm[i];
  const panels = [panel(
      'Overlap: keyframes that saw it', '', total, 1,
      Math.max(2, Math.min(9, quantile(all.map(total), 0.95))), ' keyframes or more')];
  if (grid.fisheye_views.some(views => views > 0))
    panels.push(make(
        'div', {}, make('h3', {}, 'By the fisheye'),
        gridPanel(
            i => grid.fisheye_views[i] > 0 ? grid.fisheye_views[i] : NaN, 1, 9, 'By the fisheye',
            readout),
        make('p', {class: 'soft'}, rampLegend('1', '9 keyframes or more'))));
  panels.push(panel(
      'Ground resolution, the finest', 'mm/px', resolution, quantile(all.map(resolution), 0.02),
      quantile(all.map(resolution), 0.98)));
  panels.push(panel(
      'Landmarks uncertain by, 1 sigma (median of the cell)', 'mm', sigma,
      quantile(all.map(sigma), 0.05), quantile(all.map(sigma), 0.95)));
  const list = data.keyframes, distances = [];
  for (let i = 0; i < list.count; ++i)
    if (list.camera[i] === 0) distances.push(list.distance_m[i]);
  return make(
      'section', {}, tiles([
        ['ground seen', withUnit(figures.area_m2, 'm²'), 'coverage.area_m2'],
        ['by the stereo pair', withUnit(figures.stereo_area_m2, 'm²'), 'coverage.stereo_area_m2'],
        [
          'by the fisheye',
          figures.fisheye_area_m2 > 0 ? withUnit(figures.fisheye_area_m2, 'm²') : '–',
          'coverage.fisheye_area_m2'
        ],
        [
          'of it by one keyframe only', withUnit(100 * figures.seen_once_share, '%'),
          'coverage.seen_once_share'
        ],
        [
          'ground resolution, median', withUnit(figures.resolution_mm_per_px, 'mm/px'),
          'coverage.resolution_mm_per_px'
        ],
        ['distance of the stereo pair, median', length(figures.distance_m), 'coverage.distance_m'],
        [
          'landmarks uncertain by, median', withUnit(data.landmark_sigma_mm.median, 'mm'),
          'landmark_sigma_mm.median'
        ]
      ]),
      make(
          'p', {class: 'soft'},
          `Seen along the normal of the plane in which the landmarks spread most: ${
              size}, right and up as in the picture from above. A keyframe's footprint is the hull of the landmarks that it sees. Blank: not seen. Line: the way of the stereo pair. Weak is what few keyframes saw, what is blank between them, and where landmarks are uncertain.`),
      under,
      make('div', {class: 'pair'}, panels),
      make(
          'div', {class: 'pair'},
          make(
              'div', {}, make('h3', {}, 'Distance to the ground, stereo keyframes'),
              histogram(distances, 'm'))));
}

// (e) Residuals and calibration.

function residualGrid(grid) {
  const width = 460, height = width * grid.height / Math.max(1, grid.width),
        cell = width / grid.columns;
  const svg = make(
      'svg', {viewBox: `0 0 ${width} ${height}`, role: 'img', style: 'max-width:34rem'},
      make('rect', {class: 'axis', x: 0, y: 0, width, height}));
  const value = (k, j) => grid.values[3 * k + j],
        used = [...grid.count.keys()].filter(k => grid.count[k] >= 5);
  if (!used.length) return make('p', {class: 'soft'}, 'Too few observations.');
  const high = quantile(used.map(k => value(k, 2)), 0.98), low = 0;
  const longest = Math.max(...used.map(k => Math.hypot(value(k, 0), value(k, 1)))),
        scale = roundUp(0.4 * cell / Math.max(1e-9, longest) * grid.width / width);
  for (const k of used) {
    const column = k % grid.columns, row = Math.floor(k / grid.columns), x = (column + 0.5) * cell,
          y = (row + 0.5) * height / grid.rows, f = scale * width / grid.width;
    svg.append(
        make(
            'rect', {
              x: column * cell,
              y: row * height / grid.rows,
              width: cell,
              height: height / grid.rows,
              fill: rgb(ramp((value(k, 2) - low) / Math.max(1e-9, high - low))),
              'fill-opacity': 0.55
            },
            make(
                'title', {},
                `${grid.count[k]} observations, mean ${number(value(k, 0))}, ${
                    number(value(k, 1))} px, RMS ${withUnit(value(k, 2), 'px')}`)),
        make('line', {
          x1: x,
          y1: y,
          x2: x + f * value(k, 0),
          y2: y + f * value(k, 1),
          stroke: 'var(--ink)',
          'stroke-width': 1.6
        }),
        make('circle', {cx: x, cy: y, r: 1.8, fill: 'var(--ink)'}));
  }
  return make(
      'div', {}, make('h3', {}, `${grid.camera}: residuals over the image`), svg,
      make(
          'p', {class: 'soft'},
          rampLegend(withUnit(low, 'px'), withUnit(high, 'px') + ' RMS or more. '),
          `Lines: mean of the cell, ${number(scale)} times as long; the longest is ${
              withUnit(longest, 'px')}.`));
}

// calibration.csv: what of the residuals is systematic, by place in the image.
function floorPanels() {
  const panels = [
    ['stereo', 'floor_px', 'noise floor (systematic part of the residuals)'],
    ['stereo', 'floor_disparity_px', 'noise floor of the disparities'],
    ['stereo', 'mean_row_px', 'rows, left less right, mean'],
    ['fisheye', 'floor_px', 'noise floor (systematic part of the residuals)']
  ];
  return panels.map(([camera, key, title]) => {
    const cells = data.calibration_cells.filter(cell => cell.camera === camera && known(cell[key]));
    return cells.length ? cellPanel(cells, key, `${camera}: ${title}`) : null;
  });
}

function cellPanel(cells, key, title) {
  const columns = Math.max(...cells.map(cell => cell.column)) + 1,
        rows = Math.max(...cells.map(cell => cell.row)) + 1, side = 57;
  const high = Math.max(1e-3, ...cells.map(cell => Math.abs(cell[key])));
  const svg = make(
      'svg', {
        viewBox: `0 0 ${columns * side} ${rows * side}`,
        role: 'img',
        'aria-label': title,
        style: 'max-width:34rem'
      },
      cells.map(cell => [
        make('rect', {
          x: cell.column * side,
          y: cell.row * side,
          width: side,
          height: side,
          fill: rgb(ramp(Math.abs(cell[key]) / high)),
          'fill-opacity': 0.55
        },
             make('title', {}, `${withUnit(cell[key], 'px')}, ${cell.count} observations`)),
        make('text', {
          class: 'label',
          x: (cell.column + 0.5) * side,
          y: (cell.row + 0.5) * side + 4,
          'text-anchor': 'middle'
        },
             cell[key].toFixed(3))
      ]));
  return make('div', {}, make('h3', {}, title + ' [px]'), svg);
}

const PARAMETERS = {
  rectified_stereo: ['fx [px]', 'fy [px]', 'cx [px]', 'cy [px]', 'baseline [m]'],
  pinhole: ['fx [px]', 'fy [px]', 'cx [px]', 'cy [px]'],
  kannala_brandt: ['fx [px]', 'fy [px]', 'cx [px]', 'cy [px]', 'k1', 'k2', 'k3', 'k4']
};
function calibrationSection() {
  const grids = data.residual_grids.filter(grid => grid.count.some(count => count > 0));
  if (!grids.length) return null;
  const rows = Object.entries(data.residuals)
                   .map(
                       ([camera, r]) =>
                           [camera, String(r.observations), withUnit(r.rms_px, 'px'),
                            withUnit(r.rms_right_px, 'px'), withUnit(r.assumed_sigma_px, 'px'),
                            number(r.rms_sigmas), number(r.median_sigmas)]);
  const summary = data.summary || {};
  const found = summary.calibration || {}, out = found.taken_out;
  return make(
      'section', {}, tiles([
        [
          'should the rig be calibrated again?',
          found.doubtful === undefined ? '–' :
              found.doubtful           ? 'yes' :
                                         'nothing says so',
          'calibration.doubtful'
        ],
        [
          'disparities off by, and 1 sigma of it',
          known(found.disparity_offset_sigma_px) ?
              `${number(summary.disparity_offset_px)} ± ${
                  withUnit(found.disparity_offset_sigma_px, 'px')}` :
              withUnit(summary.disparity_offset_px, 'px'),
          'disparity_offset_px'
        ],
        [
          'rows off by, by place in the image', withUnit(found.rows_px, 'px'), 'calibration.rows_px'
        ],
        [
          'frames with a doubtful calibration',
          summary.causes ? String(summary.causes.calibration_doubtful || 0) : '–'
        ]
      ]),
      (found.reasons || []).map(reason => make('p', {}, '! ' + reason)),
      out ? table(
                ['taken out of the right images', ''],
                [
                  ['turned about x', withUnit(out.pitch_deg, '°')],
                  ['turned about z', withUnit(out.roll_deg, '°')],
                  ['focal length, right / left', number(out.focal_ratio, 6)],
                  ['which moves rows by, RMS', withUnit(out.rows_px, 'px')],
                  ['1 sigma of the row of a match', withUnit(out.row_sigma_px, 'px')]
                ],
                [1]) :
            '',
      table(
          [
            'camera', 'observations', 'RMS, left u and v', 'RMS, right u', 'assumed, median',
            'RMS / assumed', 'median / assumed'
          ],
          rows, [1, 2, 3, 4, 5, 6]),
      make(
          'p', {class: 'soft'},
          'Assumed: the standard deviation of a keypoint, and the noise floor below with it, where the run used that. The ratio is 1 where measurements are as good as that, a little less since the map was fitted to them. A pattern in the lines means that the camera model does not hold there.'),
      make('div', {class: 'pair'}, grids.map(residualGrid)),
      make('div', {class: 'pair'}, floorPanels()), make('h3', {}, 'Calibration'),
      ...data.cameras.map(
          camera => make(
              'p', {},
              `${camera.model}, ${camera.width} x ${camera.height} px: ` +
                  camera.parameters
                      .map(
                          (value, k) => `${(PARAMETERS[camera.model] || [])[k] || 'p' + k} ${
                              number(value, 6)}`)
                      .join(', '))),
      make(
          'p', {class: 'soft'},
          'A run takes these numbers for exact, so they have no sigma. What it finds of them by itself, with its sigma, is above; docs/calibration.md says how, and what no run can see.'));
}

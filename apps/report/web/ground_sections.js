// (d) Coverage.

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
  const panel = (title, unit, value, low, high, more = '') => make(
      'div', {}, make('h3', {}, title), gridCanvas(i => seen(i) ? value(i) : NaN, low, high, title),
      make('p', {class: 'soft'}, rampLegend(withUnit(low, unit), withUnit(high, unit) + more)));
  const resolution = i => grid.resolution_mm_per_px[i], sigma = i => grid.sigma_mm[i];
  const panels = [panel(
      'Overlap: keyframes that saw it', '', total, 1,
      Math.max(2, Math.min(9, quantile(all.map(total), 0.95))), ' keyframes or more')];
  if (grid.fisheye_views.some(views => views > 0))
    panels.push(make(
        'div', {}, make('h3', {}, 'By the fisheye'),
        gridCanvas(
            i => grid.fisheye_views[i] > 0 ? grid.fisheye_views[i] : NaN, 1, 9, 'By the fisheye'),
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
              size}. A keyframe's footprint is the hull of the landmarks that it sees. Blank: not seen.`),
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
  return make(
      'section', {}, tiles([
        ['disparities off by', withUnit(summary.disparity_offset_px, 'px'), 'disparity_offset_px'],
        [
          'frames with a doubtful calibration',
          summary.causes ? String(summary.causes.calibration_doubtful || 0) : '–'
        ]
      ]),
      table(
          [
            'camera', 'observations', 'RMS, left u and v', 'RMS, right u', 'assumed, median',
            'RMS / assumed', 'median / assumed'
          ],
          rows, [1, 2, 3, 4, 5, 6]),
      make(
          'p', {class: 'soft'},
          'The noise floor is what is assumed of a keypoint; the ratio is 1 where measurements are as good as that, a little less since the map was fitted to them. A pattern in the lines means that the camera model does not hold there.'),
      make('div', {class: 'pair'}, grids.map(residualGrid)), make('h3', {}, 'Calibration'),
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
          'A run takes the calibration for exact: it is not refined, so there is no sigma of it. What it would be wrong by shows above.'));
}

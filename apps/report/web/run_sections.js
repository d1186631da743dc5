// (f) Loops.

function loopsSection() {
  if (!data.loops.length)
    return make('section', {}, make('p', {class: 'soft'}, 'No place was proposed as a loop.'));
  const outcomes = new Map();
  for (const loop of data.loops) outcomes.set(loop.outcome, (outcomes.get(loop.outcome) || 0) + 1);
  const accepted = data.loops.filter(loop => loop.outcome === 'accepted');
  const picture = time => {
    const found =
        data.pictures.find(one => one.camera === 'stereo' && Math.abs(one.time - time) < 1e-3);
    return found ? pictureFigure(found) : null;
  };
  const pairs = accepted.map(loop => [picture(loop.time), picture(loop.match_time)])
                    .filter(pair => pair[0] && pair[1]);
  return make(
      'section', {},
      table(
          ['outcome', 'places'], [...outcomes].map(([name, count]) => [name, String(count)]), [1]),
      accepted.length ?
          table(
              [
                'closed at', 'seen before at', 'matches', 'map was off by', 'and turned by',
                'joined parts'
              ],
              accepted.map(
                  loop =>
                      [make(
                           'a', {href: '#map', click: () => selection.set(frameNear(loop.time, 0))},
                           seconds(loop.time)),
                       seconds(loop.match_time), number(loop.final_matches, 6), length(loop.off_m),
                       withUnit(loop.off_deg, '°'),
                       loop.joins ? 'yes: two components became one' : 'no']),
              [2, 3, 4]) :
          '',
      make('div', {class: 'matches'}, pairs.map(pair => make('div', {}, pair))));
}

// (g) Against the truth.

function truthSection() {
  const ate = at(data.summary, 'ate');
  if (!ate)
    return make(
        'section', {},
        make(
            'p', {class: 'soft'},
            'The dataset has no truth: how far off the poses are is not known. Their own estimate of it is in the timeline.'));
  const p = ate.position_m, arm = at(data.summary, 'fisheye.relative_pose_error');
  const cameras = [0, 1].filter(camera => frames.camera.includes(camera));
  const rows = data.error_by_state.map(
      ({camera, state, position_m: e}) =>
          [camera, state, String(e.count), length(e.rmse), length(e.median), length(e.max)]);
  const chart = lineChart(
      'Distance from the truth', 'mm',
      cameras.map(camera => ({
                    name: CAMERAS[camera],
                    camera,
                    color: camera ? 'var(--second)' : 'var(--s-map)',
                    dash: camera ? '5 3' : '',
                    values: i => 1000 * frames.error_m[i]
                  })));
  return make(
      'section', {}, tiles([
        ['RMSE of the position (ATE)', length(p.rmse), 'ate.position_m.rmse'],
        ['median', length(p.median), 'ate.position_m.median'],
        ['worst', length(p.max), 'ate.position_m.max'],
        ['frames compared', String(p.count), 'ate.position_m.count'],
        ['true length of the way', length(ate.true_length_m), 'ate.true_length_m'],
        ['length, estimate / truth', number(ate.length_ratio, 5), 'ate.length_ratio'],
        ['fisheye in the left camera, median', arm ? length(arm.translation_m.median) : '–'],
        ['turned by, median', arm ? withUnit(arm.rotation_deg.median, '°') : '–']
      ]),
      make(
          'p', {class: 'soft'},
          'Both cameras after the best rigid alignment (SE3) of the left camera’s path.'),
      chart || '',
      rows.length ?
          table(['camera', 'state', 'frames', 'RMSE', 'median', 'worst'], rows, [2, 3, 4, 5]) :
          '');
}

// (h) Time.

function timeSection() {
  const period = data.period_s ? 1000 * data.period_s : null,
        stages = data.timing ? Object.entries(data.timing) : [];
  if (!stages.length) return null;
  const limit =
      known(period) ? {value: period, name: 'frame period ' + withUnit(period, 'ms')} : null;
  const most = Math.max(...stages.map(([, t]) => t.p95)),
        shown = limit && limit.value < 20 * most ? limit : null;
  const summary = data.summary || {}, behind = data.behind_ms;
  return make(
      'section', {}, tiles([
        ['the run took', withUnit(summary.seconds, 's', 4), 'seconds'],
        ['the images span', withUnit(data.span_s, 's', 4)],
        ['frame period, median', withUnit(period, 'ms', 4)],
        ['mode', String(at(summary, 'options.mode') || '–'), 'options.mode'],
        ['frames dropped', String(at(summary, 'frames.dropped') ?? '–'), 'frames.dropped'],
        ['CPU time per stereo frame, mean', withUnit(at(data, 'cpu_ms.mean'), 'ms'), 'cpu_ms.mean'],
        ['behind, median', behind ? withUnit(behind.median, 'ms') : '–', 'behind_ms.median'],
        ['behind, 95 % at most', behind ? withUnit(behind.p95, 'ms') : '–', 'behind_ms.p95']
      ]),
      make(
          'p', {class: 'soft'},
          'Each stage, wherever it ran: mean (bar), 95th percentile (tick). Stages may run side by side.' +
              (limit && !shown ?
                   ` The frame period, ${withUnit(period, 'ms')}, is beyond the chart.` :
                   shown && most > 5 * shown.value ? ' →: longer than the chart.' :
                                                     '')),
      make(
          'div', {style: 'max-width:56rem'},
          barChart(
              stages.map(([name, t]) => ({
                           name,
                           value: t.mean,
                           mark: t.p95,
                           text: `${withUnit(t.mean, 'ms')} (p95 ${withUnit(t.p95, 'ms')}, ${
                               t.count} times)`
                         })),
              shown)),
      lineChart(
          'CPU time per stereo frame, all threads', 'ms',
          [{name: 'stereo', camera: 0, color: 'var(--s-map)', values: i => frames.cpu_ms[i]}]) ||
          '');
}

// (i) What was run.

function flattened(value, prefix, rows) {
  if (value !== null && typeof value === 'object' && Object.keys(value).length)
    for (const [key, part] of Object.entries(value))
      flattened(part, prefix ? prefix + '.' + key : key, rows);
  else
    rows.push([
      prefix,
      value !== null && typeof value === 'object' ? 'none' :
          value === null                          ? 'none' :
                                                    String(value)
    ]);
  return rows;
}

// What the command line says where it says nothing.
const USUAL = {
  mode: 'every-frame',
  rate: 0,
  limit: 0,
  start: 0,
  every: 1,
  loops: true,
  map: null,
  localize: false
};

function runSection() {
  const summary = data.summary || {}, given = summary.options || {};
  const changed = summary.options_changed && {
    ...Object.fromEntries(Object.keys(USUAL)
                              .filter(name => name in given && given[name] !== USUAL[name])
                              .map(name => [name, String(given[name])])),
    ...summary.options_changed
  };
  const parts = [
    [
      'program',
      data.map_program || (summary.git_commit ? 'hybrid_slam, commit ' + summary.git_commit : '–')
    ],
    ['dataset', summary.dataset || '–'], ['sequence', summary.sequence || '–'],
    ['layout', summary.layout || '–'],
    ['images (XXH3 of the pixels read)', summary.images_xxh3 || '–'],
    ['seed', summary.seed === undefined ? '–' : String(summary.seed)],
    ['SIFT', summary.sift_engine || '–'], ['BLAS', summary.blas || '–']
  ];
  return make(
      'section', {},
      make(
          'dl', {},
          parts.filter(part => part[1] !== '–')
              .map(([name, value]) => [make('dt', {}, name), make('dd', {}, value)])),
      changed ? make('h3', {}, 'Options that differ from the defaults') : '',
      changed ? (Object.keys(changed).length ? table(['option', 'value'], Object.entries(changed)) :
                                               make('p', {}, 'none')) :
                '',
      data.map_options ? make(
                             'details', {}, make('summary', {}, 'All options'),
                             make('pre', {}, data.map_options)) :
                         '',
      data.summary ?
          make(
              'details', {id: 'all-figures'}, make('summary', {}, 'All figures of summary.json'),
              make(
                  'table', {},
                  make(
                      'tbody', {},
                      flattened(data.summary, '', [])
                          .map(
                              ([key, value]) => make(
                                  'tr', {}, make('td', {}, key),
                                  make('td', {class: 'n', 'data-key': key}, value),
                                  make('td', {}, unitOf(key))))))) :
          '');
}

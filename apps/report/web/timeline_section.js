// (c) The timeline.

function timelineSection() {
  if (!frames.count) return null;
  const section = make('section', {});
  const cameras = [0, 1].filter(camera => frames.camera.includes(camera));
  section.append(
      bandChart('State', cameras.map(camera => ({
                                       name: CAMERAS[camera],
                                       runs: runsOf(camera, stateOf)
                                                 .map(
                                                     ([from, to, state]) =>
                                                         [from, to, `var(${stateVariable(state)})`,
                                                          `${CAMERAS[camera]}: ${state}, ${
                                                              seconds(from)} to ${seconds(to)}`])
                                     }))),
      make(
          'p', {class: 'soft'},
          frames.states.map(state => swatch(`var(${stateVariable(state)})`, state))));
  const causes = new Map();
  for (const [i, text] of Object.entries(frames.causes))
    for (const part of text.split(';')) {
      const [name, value] = part.split('=');
      if (!causes.has(name)) causes.set(name, []);
      causes.get(name).push([
        frames.time[i], frames.time[i] + (data.period_s || 0), 'var(--second)',
        `${CAMERAS[frames.camera[i]]}, ${seconds(frames.time[i])}: ${name} ${value}`
      ]);
    }
  if (causes.size)
    section.append(
        bandChart('What may be wrong (causes)', [...causes].map(([name, runs]) => ({name, runs}))));
  if (causes.size)
    section.append(make(
        'p', {class: 'soft'},
        [...causes.keys()].map(name => `${name} (${causes.get(name).length} frames)`).join(', ') +
            '. docs/reliability.md says when each is named.'));
  const lines = (key, scale = 1) => cameras.map(camera => ({
                                                  name: CAMERAS[camera],
                                                  camera,
                                                  color: camera ? 'var(--second)' : 'var(--s-map)',
                                                  dash: camera ? '5 3' : '',
                                                  values: i => scale * frames[key][i]
                                                }));
  for (const chart
           of [lineChart('Inliers', '', lines('inliers')),
               lineChart('Features', '', lines('features')),
               lineChart(
                   'Rows of the pair apart by, median of the matches', 'px',
                   lines('row_error_px').slice(0, 1)),
               lineChart(
                   'Behind: from when the pair was due until it was tracked', 'ms',
                   lines('behind_ms').slice(0, 1)),
               lineChart('Position uncertain by, 1 sigma', 'mm', lines('sigma_position', 1000)),
               lineChart('Turned by, 1 sigma', '°', lines('sigma_rotation_deg'))])
    if (chart) section.append(chart);
  if (data.losses.length) {
    section.append(
        make('h3', {}, 'Where there was no pose'),
        table(
            ['camera', 'from', 'to', 'frames', 'cause'],
            data.losses.map(
                loss =>
                    [loss.camera,
                     make(
                         'a', {
                           href: '#map',
                           click: () =>
                               selection.set(frameNear(loss.from, CAMERAS.indexOf(loss.camera)))
                         },
                         seconds(loss.from)),
                     seconds(loss.to), String(loss.frames), loss.cause]),
            [3]));
  }
  if (data.pictures.length)
    section.append(
        make('h3', {}, 'Moments'),
        make(
            'div', {class: 'pictures'},
            data.pictures.filter(picture => !picture.why.startsWith('loop')).map(pictureFigure)));
  else
    section.append(make(
        'p', {class: 'soft'}, 'No images: the dataset was not there when the report was made.'));
  return section;
}

// (b) The map: its controls, and the chosen frame beside it.

const mapView = {
  update: null  // draws what the data have become
};

function mapSection() {
  if (!data.live && !data.landmarks.count && !frames.count && !data.keyframes.count) return null;
  const canvas = make('canvas', {
    id: 'map-canvas',
    tabindex: 0,
    'aria-label':
        'Map in three dimensions. Drag to turn, shift and drag to move, wheel to come closer; keys W A S D, arrows, + and -.'
  });
  const legend = make('div', {class: 'legend'}), bar = make('i'), barText = make('span'),
        scale = make('div', {class: 'scale'}, barText, bar);
  const detail = make(
      'div', {id: 'detail', tabindex: 0, 'aria-live': 'polite'},
      make(
          'p', {class: 'soft'},
          'Choose a frame: click on a path or on the timeline, or press ← and →.'));
  const box = make('div', {class: 'map-box'}, canvas, legend, scale);
  const up = data.coverage_grid ? data.coverage_grid.axes[2] : [0, -1, 0];
  const scene = new Scene(canvas, up);
  let extent = sceneExtent(), keyframeSize = 0.025 * extent.size;
  const section = make(
      'section', {}, make('div', {class: 'controls'}),
      make('div', {class: 'map-frame'}, box, detail));
  const controls = section.firstChild,
        colorBy = make(
            'select', {id: 'color-by', 'aria-label': 'Colour of the landmarks'},
            Object.keys(LANDMARK_COLORS)
                .filter(name => !data.live || name !== 'sigma')
                .map(name => make('option', {value: name}, name))),
        pathBy = make(
            'select', {id: 'path-by', 'aria-label': 'Colour of the paths'},
            Object.keys(PATH_COLORS).map(name => make('option', {value: name}, name)));
  if (COMPONENTS.length > 1) pathBy.value = 'component';
  if (!scene.gl)
    box.replaceChildren(make(
        'p', {class: 'soft', style: 'padding:1rem'},
        'This browser shows no WebGL: the map cannot be drawn. All other sections are complete; map.png shows the map from above.'));
  const layers = [], offers = [], follow = make('input', {type: 'checkbox'});
  const hidden = new Set(['error ellipses']);  // what is not ticked
  let factor = 0;
  const paint = () => {
    findComponents();
    scene.set(
        'landmarks', 'points', data.landmarks.position, landmarkColors(colorBy.value),
        data.landmarks.count > 30000 ? 1.6 : 2.4);
    const pathColor = PATH_COLORS[pathBy.value]();
    for (const camera of [0, 1]) {
      const lines = pathLines(camera, pathColor);
      scene.set('path' + camera, 'lines', lines.positions, lines.colors);
      const dots = pathDots(camera, pathColor);
      scene.set('dots' + camera, 'points', dots.positions, dots.colors, camera ? 4 : 5);
    }
    const cameras = new LineSet(), list = data.keyframes,
          byCamera = [bytes('--s-map'), bytes('--truth')],
          color = pathBy.value === 'component' ? i => bytes(componentVariable(list.component[i])) :
                                                 i => byCamera[list.camera[i]];
    for (let i = 0; i < list.count; ++i)
      addFrustum(
          cameras, positionOf(list, i), list.rotation.subarray(4 * i, 4 * i + 4),
          keyframeSize * (list.camera[i] ? 0.7 : 1), color(i));
    scene.set('keyframes', 'lines', cameras.positions, cameras.colors);
    const loops = loopLines(), truth = truthLines(), ellipses = ellipseLines(extent.size);
    scene.set('loops', 'lines', loops.positions, loops.colors);
    scene.set('truth', 'lines', truth.positions, truth.colors);
    scene.set('ellipses', 'lines', ellipses.lines.positions, ellipses.lines.colors);
    factor = ellipses.factor;
    mark(selection.frame);
    showLegend();
  };
  // Of what is shown.
  const showLegend = () => {
    const states = frames.states.filter(state => STATES.includes(state) && state !== 'lost');
    legend.replaceChildren(
        hidden.has('landmarks') ?
            '' :
            make('div', {}, 'landmarks: ', LANDMARK_COLORS[colorBy.value].legend(data.landmarks)),
        frames.count ?
            make(
                'div', {}, `paths by ${pathBy.value}: `,
                pathBy.value === 'state' ?
                    states.map(state => swatch(`var(${stateVariable(state)})`, state)) :
                    COMPONENTS.map(
                        name => swatch(`var(${componentVariable(name)})`, String(name)))) :
            '',
        data.keyframes.count && pathBy.value === 'state' && !hidden.has('keyframes') ?
            make(
                'div', {}, 'keyframes: ', swatch('var(--s-map)', 'stereo'),
                data.keyframes.camera.includes(1) ? swatch('var(--truth)', 'fisheye') : '') :
            '',
        data.truth.count && !hidden.has('truth') ?
            make('div', {}, swatch('var(--ink)', 'truth')) :
            '',
        data.loops.some(loop => loop.outcome === 'accepted') && !hidden.has('loops') ?
            make('div', {}, swatch('var(--s-lost)', 'loops that were closed')) :
            '',
        factor && !hidden.has('error ellipses') ?
            make(
                'div', {},
                swatch(
                    'var(--truth)', `error ellipses: 1 sigma, ${number(factor)} times as large`)) :
            '');
  };
  const mark = i => {
    const lines = new LineSet();
    if (i >= 0 && hasPose(i))
      addFrustum(
          lines, positionOf(frames, i), frames.rotation.subarray(4 * i, 4 * i + 4),
          2.2 * keyframeSize, bytes('--s-lost'));
    scene.set('chosen', 'lines', lines.positions, lines.colors);
    scene.set(
        'chosen-point', 'points', lines.positions.slice(0, 3),
        lines.positions.length ? [...bytes('--s-lost'), 255] : [], 11);
  };
  scene.fit = () => {
    scene.touched = false;
    scene.target = extent.middle;
    scene.distance = extent.size * 1.15;
    scene.look(-1.2, 0.75);
  };
  scene.after = () => {
    const length = roundUp(60 * scene.metresPerPixel());
    bar.style.width = length / scene.metresPerPixel() + 'px';
    barText.textContent =
        (length < 1 ? withUnit(length * 1000, 'mm') : withUnit(length, 'm')) + ' at the middle';
  };
  scene.pick = (x, y) => {
    let best = -1, near = 18;
    for (let i = 0; i < frames.count; ++i) {
      if (!hasPose(i)) continue;
      const pixel = scene.pixel(positionOf(frames, i)),
            off = pixel ? Math.hypot(pixel[0] - x, pixel[1] - y) : Infinity;
      if (off < near) {
        near = off;
        best = i;
      }
    }
    selection.set(best);
  };
  const toggle = (name, layerNames, there) => {
    if (!there() && !data.live) return;
    const input = make('input', {
      type: 'checkbox',
      checked: !hidden.has(name),
      change: () => {
        if (input.checked)
          hidden.delete(name);
        else
          hidden.add(name);
        layerNames.forEach(layer => scene.show(layer, input.checked));
        showLegend();
      }
    });
    const label = make('label', {}, input, ' ' + name);
    controls.append(label);
    offers.push(() => { label.hidden = !there(); });  // live, what comes later is offered then
    layers.push(() => layerNames.forEach(layer => scene.show(layer, input.checked)));
  };
  if (scene.gl) {
    colorBy.addEventListener('change', paint);
    pathBy.addEventListener('change', paint);
    themeListeners.push(paint);
    if (data.landmarks.count || data.live)
      controls.append(make('label', {}, 'Landmarks by ', colorBy));
    if (COMPONENTS.length > 1 || data.live) controls.append(make('label', {}, 'Paths by ', pathBy));
    paint();
    toggle('landmarks', ['landmarks'], () => data.landmarks.count);
    toggle('stereo path', ['path0', 'dots0'], () => frames.count);
    toggle('fisheye path', ['path1', 'dots1'], () => frames.camera.includes(1));
    toggle('keyframes', ['keyframes'], () => data.keyframes.count);
    toggle('loops', ['loops'], () => data.loops.some(loop => loop.outcome === 'accepted'));
    toggle('truth', ['truth'], () => data.truth.count);
    toggle('error ellipses', ['ellipses'], () => factor > 0);
    for (const [name, action, title] of [
             ['fit', () => scene.fit(), 'all of it (F)'],
             ['top', () => scene.look(scene.yaw, 1.5699), 'from above (T)'],
             ['side', () => scene.look(scene.yaw, 0.05), 'from the side (E)']])
      controls.append(make('button', {type: 'button', click: action, title}, name));
    if (data.live) controls.append(make('label', {}, follow, ' follow the vehicle'));
    layers.forEach(apply => apply());
    offers.forEach(apply => apply());
    scene.fit();
  }
  mapView.update = () => {
    extent = sceneExtent();
    keyframeSize = 0.025 * extent.size;
    if (scene.gl) paint();
    offers.forEach(apply => apply());
    if (!scene.touched) {
      scene.target = extent.middle;
      scene.distance = extent.size * 1.15;
    }
    if (follow.checked && frames.count) {
      const newest = frames.camera.lastIndexOf(0);
      if (newest >= 0 && hasPose(newest)) scene.target = [...positionOf(frames, newest)];
    }
    scene.draw();
    note.textContent = mapNote();
  };
  selection.listen(i => {
    mark(i);
    showDetail(detail, i);
  });
  if (frames.count && !data.live) section.append(playerBar());
  const note = make('p', {class: 'soft'}, mapNote());
  section.append(note);
  return section;
}

// How much of all there is is shown.
function mapNote() {
  const list = data.landmarks;
  return `${list.count} of ${list.of} landmarks${list.count < list.of ? ', evenly by age' : ''}, ${
             data.keyframes.count} of ${data.keyframes.of} keyframes, ` +
      `${frames.count} of ${frames.of} frames${
             frames.count < frames.of ?
                 ' (every n-th, and all that changed the state)' :
                 ''} are shown. Paths are in the map as it is ${data.live ? 'now' : 'at the end'}.`;
}

// A slider over the frames, and play.
function playerBar() {
  const slider = make('input', {
    type: 'range',
    min: 0,
    max: frames.count - 1,
    value: 0,
    'aria-label': 'Frame',
    input: () => selection.set(Number(slider.value))
  });
  const text = make('span', {class: 'soft', style: 'min-width:11em'}, '');
  const pause = Math.max(30, Math.min(400, 300 * (data.period_s || 0.1)));  // [ms]
  let playing = false, turn = 0;  // how often it was started or stopped
  const advance = mine => {
    if (!playing || mine !== turn) return;
    if (selection.frame >= frames.count - 1) {
      play.click();
      return;
    }
    selection.set(selection.frame + 1);
    // The next one once this one is drawn: a slow machine plays slower, and still listens.
    requestAnimationFrame(() => setTimeout(advance, pause, mine));
  };
  const play = make(
      'button', {
        type: 'button',
        click: () => {
          playing = !playing;
          ++turn;
          play.textContent = playing ? 'pause' : 'play';
          if (playing) setTimeout(advance, pause, turn);
        }
      },
      'play');
  selection.listen(i => {
    slider.value = i;
    text.textContent = `${CAMERAS[frames.camera[i]]}, ${seconds(frames.time[i])}`;
  });
  return make('div', {class: 'player'}, play, slider, text);
}

function showDetail(detail, i) {
  const rows = [
    ['camera', CAMERAS[frames.camera[i]]],
    ['time', `${seconds(frames.time[i])} (${frames.time[i].toFixed(6)} s)`],
    ['state', make('span', {}, swatch(`var(${stateVariable(stateOf(i))})`, stateOf(i)))],
    ['causes', frames.causes[i] ? frames.causes[i].replaceAll(';', ', ') : 'none found'],
    ['pose from', frames.sources[frames.source[i]] || '–'],
    ['predicted by', frames.predictions[frames.prediction[i]] || '–'],
    ['features', number(frames.features[i], 6)],
    ['stereo matches', frames.camera[i] ? '–' : number(frames.stereo_matches[i], 6)],
    ['rows apart by', withUnit(frames.row_error_px[i], 'px')],
    ['inliers', number(frames.inliers[i], 6)],
    ['odometer inliers', number(frames.odometer_inliers[i], 6)],
    [
      'position',
      hasPose(i) ? [...positionOf(frames, i)].map(x => x.toFixed(3)).join(', ') + ' m' : 'none'
    ],
    [
      '1 sigma',
      known(frames.sigma_position[i]) ?
          `${length(frames.sigma_position[i])}, ${withUnit(frames.sigma_rotation_deg[i], '°')}` :
          '–'
    ],
    ['from the truth', length(frames.error_m[i])],
    ['CPU time', withUnit(frames.cpu_ms[i], 'ms', 4)],
    ['behind by', withUnit(frames.behind_ms[i], 'ms', 4)],
    ['component', number(frames.component[i], 9)],
  ].filter(row => row[1] !== '–');
  const pictures = picturesAt(frames.time[i]);
  detail.replaceChildren(
      make('dl', {}, rows.map(([name, value]) => [make('dt', {}, name), make('dd', {}, value)])),
      make('div', {class: 'detail-pictures'}, pictures.map(pictureFigure)),
      pictures.length || data.live || data.served ?
          '' :
          make('p', {class: 'soft'}, 'No image of this frame in the report.'));
}

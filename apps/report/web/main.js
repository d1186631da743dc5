// Puts the page together.

const themeListeners = [];

function setTheme(dark) {
  document.documentElement.classList.toggle('dark', dark);
  for (const listener of themeListeners) listener();
}

function showVerdict() {
  const box = document.getElementById('verdict'), verdict = data.verdict;
  const mark = good => make(
      'span',
      {class: 'mark ' +
           (good === true      ? 'good' :
                good === false ? 'bad' :
                                 '')},
      good === true      ? '✓' :
          good === false ? '!' :
                           '·');
  box.className = verdict.level;
  box.append(
      make('div', {class: 'text'}, verdict.text),
      make(
          'ul', {},
          verdict.reasons.map(
              reason => make('li', {'data-reason': reason.kind}, mark(reason.good), reason.text))));
}

const SECTIONS = [
  ['now', 'Now', nowSection], ['map', 'Map', mapSection], ['timeline', 'Timeline', timelineSection],
  ['coverage', 'Coverage', coverageSection],
  ['calibration', 'Residuals and calibration', calibrationSection],
  ['loops', 'Loops', loopsSection], ['truth', 'Against the truth', truthSection],
  ['time', 'Time', timeSection], ['run', 'What was run', runSection]
];

const KEYS = [
  ['1 … 8', 'to a section'], ['← →', 'the frame before, the next one'],
  ['Home End', 'the first frame, the last'], ['l', 'dark or light'], ['?', 'this list'],
  ['in the map: W A S D', 'fly'], ['arrows', 'turn'], ['+ -', 'closer, farther'],
  ['F T E', 'all of it, from above, from the side'], ['drag', 'turn'],
  ['shift + drag, two fingers', 'move'], ['wheel, pinch', 'closer, farther']
];

function toggleHelp() {
  const help = document.getElementById('help');
  help.hidden = !help.hidden;
  document.getElementById('help-button').setAttribute('aria-expanded', String(!help.hidden));
}

// Makes a section, instead of the one that is there. False if the run has nothing for it; a live
// page keeps a place.
function showSection(id) {
  const [, name, makeSection] = SECTIONS.find(section => section[0] === id);
  const before = document.getElementById(id);
  let section = null;
  selection.forget(id);
  selection.section = id;
  try {
    section = makeSection();
  } catch (error) {
    console.error(id, error);
  }
  selection.section = '';
  if (!section && data.live)
    section = make('section', {}, make('p', {class: 'soft'}, 'Nothing yet.'));
  if (!section) return false;
  section.id = id;
  section.prepend(make('h2', {}, name));
  if (before)
    before.replaceWith(section);
  else
    document.getElementById('main').append(section);
  if (before && selection.frame >= 0)
    for (const [of, listener] of selection.listeners)
      if (of === id) listener(selection.frame);
  return true;
}

function build() {
  setTheme(window.matchMedia('(prefers-color-scheme: dark)').matches);
  showVerdict();
  const main = document.getElementById('main'), nav = document.getElementById('nav');
  main.replaceChildren();
  for (const [id, name] of SECTIONS) {
    if (data.live && !LIVE_SECTIONS.includes(id)) continue;
    if (!showSection(id)) continue;
    nav.append(make('a', {href: '#' + id}, `${nav.children.length + 1} ${name}`));
  }
  document.getElementById('help').append(make(
      'dl', {},
      KEYS.map(([key, what]) => [make('dt', {}, make('kbd', {}, key)), make('dd', {}, what)])));
  document.getElementById('help-button').addEventListener('click', toggleHelp);
  document.getElementById('theme').addEventListener(
      'click', () => setTheme(!document.documentElement.classList.contains('dark')));
  document.getElementById('footer').append(make(
      'p', {class: 'soft'},
      (data.live ?
           'Told by hybrid_slam while it runs. ' :
           'Written by hybrid_slam. Every figure is in summary.json, timing.json or a csv file beside this one. ') +
          'Times are from the first frame on. Positions are in the world of the first keyframe: x right, y down, z forward [m].'));
  window.addEventListener('beforeprint', () => {
    window.wasDark = document.documentElement.classList.contains('dark');
    setTheme(false);
  });
  window.addEventListener('afterprint', () => setTheme(window.wasDark));
  document.addEventListener('keydown', event => {
    if (event.ctrlKey || event.metaKey || event.altKey ||
        /^(INPUT|SELECT|TEXTAREA)$/.test(event.target.tagName))
      return;
    if (event.key === 'l')
      setTheme(!document.documentElement.classList.contains('dark'));
    else if (event.key === '?')
      toggleHelp();
    else if (event.key === 'ArrowRight') {
      selection.step(1);
      event.preventDefault();
    } else if (event.key === 'ArrowLeft') {
      selection.step(-1);
      event.preventDefault();
    } else if (event.key === 'Home' && frames.count)
      selection.set(0);
    else if (event.key === 'End' && frames.count)
      selection.set(frames.count - 1);
    else if (/^[1-9]$/.test(event.key)) {
      const link = nav.children[Number(event.key) - 1];
      if (link) link.click();
    }
  });
  const weakest = data.served ? 0 :
      data.losses.length ? frameNear(data.losses[0].from, CAMERAS.indexOf(data.losses[0].camera)) :
      data.pictures.length ? frameNear(data.pictures[0].time, 0) :
                             -1;
  selection.set(weakest);
  document.documentElement.dataset.ready =
      String(Math.round(performance.now() - begun));  // [ms] that the script took
  // [ms] from the beginning of loading until all of it has been drawn. The map asked for its
  // picture before.
  requestAnimationFrame(
      () => setTimeout(
          () => document.documentElement.dataset.drawn = String(Math.round(performance.now()))));
}

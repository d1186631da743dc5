// The live page: what the server tells of a run goes into the data, and the sections follow.

const live = {
  frames: new Table(frames, FRAME_COLUMNS),
  landmarks: null,
  keyframes: null,
  follow: true,  // the newest frame is the chosen one
  last: 0,       // when something came [ms]
  missed: 0,
  connected: false,
  over: false,
  delays: [],  // from frame to page [ms], of the newest, by both machines' clocks
  delay: 0,    // by how much more than the least of all the newest took [ms]
  least: Infinity,
  due: new Map(),    // when a section may be drawn again [ms]
  stale: new Set(),  // sections that are not as the data are
};

const LIVE_SECTIONS = ['now', 'map', 'timeline', 'loops'];

function applyState(state) {
  const chosen = selection.frame >= 0 ? frames.time[selection.frame] : null;
  for (const key of Object.keys(state.frames)) frames[key] = state.frames[key];
  live.frames = new Table(frames, FRAME_COLUMNS);
  if (state.landmarks) {
    data.landmarks = state.landmarks;
    data.keyframes = state.keyframes;
    live.landmarks = new Table(data.landmarks, LANDMARK_COLUMNS);
    live.keyframes = new Table(data.keyframes, KEYFRAME_COLUMNS);
    findBirths(data.landmarks);
  }
  for (const key of ['losses', 'loops', 'period_s', 'span_s']) data[key] = state[key];
  live.missed = state.missed;
  selection.frame = -1;
  if (frames.count && chosen !== null && !live.follow) selection.set(frameNear(chosen));
  [0, 1].forEach(camera => {
    const newest = frames.camera.lastIndexOf(camera);
    if (newest >= 0) now.frame(newest);
  });
  LIVE_SECTIONS.forEach(id => live.stale.add(id));
}

function applyFrame(told) {
  appendFrame(live.frames, told);
  live.missed = told.missed || 0;
  if (told.told) {
    const delay = Date.now() - 1000 * told.told;
    live.least = Math.min(live.least, delay);
    live.delay = delay - live.least;
    live.delays.push(delay);
    if (live.delays.length > 100) live.delays.shift();
    document.documentElement.dataset.delayMs = quantile(live.delays, 0.5).toFixed(0);
  }
  now.frame(frames.count - 1);
  ['map', 'timeline'].forEach(id => live.stale.add(id));
}

function applyMap(change) {
  if (!live.landmarks) return;
  live.landmarks.erase(change.landmarks.erased);
  live.landmarks.put(change.landmarks);
  data.landmarks.of = change.landmarks.of;
  live.keyframes.erase(change.keyframes.erased);
  live.keyframes.put(change.keyframes);
  data.keyframes.of = change.keyframes.of;
  findBirths(data.landmarks);
  live.stale.add('map');
}

// Sections as the data are. Each has a tenth of the time at most, and nothing is drawn that nobody
// sees.
function refresh() {
  if (document.hidden) return;
  const time = performance.now();
  if (frames.count) {
    start = frames.time[0];
    timeline.from = start;
    timeline.to = Math.max(start + 1, frames.time[frames.count - 1]);
  }
  for (const id of live.stale) {
    if ((live.due.get(id) || 0) > time) continue;
    live.stale.delete(id);
    const begin = performance.now();
    if (id === 'map' && mapView.update)
      mapView.update();
    else if (id !== 'now')
      showSection(id);
    live.due.set(id, time + Math.max(500, 10 * (performance.now() - begin)));
  }
  if (live.follow && frames.count) {
    live.choosing = true;
    selection.set(frames.count - 1);
    live.choosing = false;
  }
}

function showStatus() {
  const silent = (performance.now() - live.last) / 1000, page = document.documentElement;
  let text = `live · ${frames.of} frames · ${data.keyframes.of} keyframes · ${
      data.landmarks.of} landmarks · ${
      data.losses.length ? data.losses.length + ' losses · ' : ''}`;
  let alarm = '';
  if (live.over)
    text = `The run is over${live.over.text ? ': ' + live.over.text : ''}. This is its last state.`;
  else if (!live.connected)
    alarm = 'NO CONNECTION to the run. What is shown is old. Trying again.';
  else if (frames.count && silent > Math.max(3, 5 * (data.period_s || 0)))
    alarm = `NOTHING NEW for ${silent.toFixed(0)} s. What is shown is old.`;
  else if (live.delay > 3000)
    alarm =
        `THIS PAGE IS ${(live.delay / 1000).toFixed(0)} s BEHIND: this machine is too slow for it.`;
  else
    text += `${live.missed ? live.missed + ' left out here · ' : ''}last frame ${
        frames.count ? silent.toFixed(1) + ' s ago' : '–'}`;
  now.status.textContent = alarm || text;
  now.status.classList.toggle('alarm', alarm !== '');
  page.dataset.live = live.over ? 'over' : alarm ? 'alarm' : 'live';
}

function listen() {
  const source = new EventSource('events');
  const on = (name, apply) => source.addEventListener(name, event => {
    live.connected = true;
    if (name === 'state' || name === 'frame') live.last = performance.now();
    apply(decoded(JSON.parse(event.data)));
  });
  on('state', applyState);
  on('frame', applyFrame);
  on('map', applyMap);
  on('picture', showPicture);
  on('loop', loop => {
    data.loops.push(loop);
    live.stale.add('loops').add('map');
  });
  on('end', end => {
    source.close();
    live.over = end;
    LIVE_SECTIONS.forEach(id => live.stale.add(id));
  });
  source.onopen = () => live.connected = true;
  source.onerror = () => {
    live.connected = false;
    // Refused for good: too many watch, say. The browser would not try again.
    if (source.readyState === EventSource.CLOSED && !live.over) setTimeout(listen, 5000);
  };
}

build();
if (data.live) {
  selection.listen(() => {
    if (!live.choosing) live.follow = false;
  });
  document.getElementById('verdict').hidden = true;
  listen();
  setInterval(refresh, 200);
  setInterval(showStatus, 200);
}

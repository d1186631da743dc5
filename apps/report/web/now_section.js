// What a pilot looks at: the state in large letters, why, and what the cameras see.

const STATE_WORDS = {
  map: 'ON THE MAP',
  odometry: 'BY ODOMETRY ONLY',
  relocalised: 'FOUND AGAIN',
  starting: 'STARTING',
  lost: 'LOST'
};

const now = {
  parts: [],    // by camera
  frame: null,  // called with the number of a frame
  status: null
};

const causeWords = causes =>
    causes.replaceAll('_', ' ').replaceAll('=', ' ').split(';').filter(part => part).join(', ');

// The picture and, above it, its features.
function pictureBox(camera) {
  const image = make('img', {alt: `the newest image, ${CAMERAS[camera]}`, hidden: true}),
        dots = make('canvas', {'aria-hidden': 'true'}), caption = make('figcaption', {}),
        box = make(
            'figure', {'data-picture': CAMERAS[camera]},
            make('div', {class: 'now-picture'}, image, dots), caption);
  return {
    box,
    show(picture) {
      image.src = pictureSource(picture);
      image.width = picture.width;
      image.height = picture.height;
      image.hidden = false;
      dots.width = picture.width;
      dots.height = picture.height;
      const pen = dots.getContext('2d'), list = picture.features, size = picture.width / 200;
      pen.fillStyle = camera ? '#ffb000' : '#34e0a1';  // on an image, whatever the page's colours
      pen.strokeStyle = '#000';
      pen.lineWidth = size / 2;
      for (let i = 0; i < list.length; i += 2) {
        pen.beginPath();
        pen.arc(list[i] * picture.width, list[i + 1] * picture.height, size, 0, 7);
        pen.fill();
        pen.stroke();
      }
      caption.textContent = `${CAMERAS[camera]}, ${seconds(picture.time)}${
          list.length ? `: ${list.length / 2} features that are landmarks` : ''}`;
      caption.dataset.time = picture.time;
    }
  };
}

function wordsBox(camera) {
  const state = make('strong', {class: 'now-state'}, '–'),
        cause = make('div', {class: 'now-cause'}), facts = make('div', {class: 'soft'}),
        box = make(
            'div', {class: 'now-camera', 'data-now': CAMERAS[camera]},
            make('span', {class: 'soft'}, camera ? 'fisheye' : 'vehicle'), state, cause, facts);
  return {
    box,
    show(i) {
      const name = stateOf(i);
      state.textContent = STATE_WORDS[name] || `IMAGE LEFT OUT: ${name}`;
      state.dataset.state = name;
      state.style.setProperty('--state', `var(${stateVariable(name)})`);
      cause.textContent = causeWords(frames.causes[i] || '') || 'nothing found wrong';
      cause.classList.toggle('quiet', !frames.causes[i]);
      facts.textContent =
          [
            seconds(frames.time[i]), withUnit(frames.inliers[i], 'inliers', 6),
            known(frames.sigma_position[i]) ? `1 sigma ${length(frames.sigma_position[i])}` : '–'
          ].filter(text => text !== '–')
              .join(' · ');
    }
  };
}

function nowSection() {
  if (!data.live && !data.served) return null;
  now.parts = CAMERAS.map((_, camera) => ({words: wordsBox(camera), picture: pictureBox(camera)}));
  now.status = make('p', {id: 'now-status', role: 'status'});
  now.frame = i => {
    const part = now.parts[frames.camera[i]];
    part.words.box.hidden = false;
    part.words.show(i);
  };
  now.parts[1].words.box.hidden = now.parts[1].picture.box.hidden = !frames.camera.includes(1);
  if (data.served)
    selection.listen(i => {
      const time = frames.time[i];
      CAMERAS.forEach((_, camera) => {
        const same = frameNear(time, camera);
        if (same >= 0 && Math.abs(frames.time[same] - time) < 1e-3) now.frame(same);
      });
      served.show(time);
    });
  return make(
      'section', {}, now.status,
      make(
          'div', {class: 'now'}, make('div', {}, now.parts.map(part => part.words.box)),
          make('div', {class: 'now-pictures'}, now.parts.map(part => part.picture.box))));
}

function showPicture(picture) {
  const part = now.parts[picture.camera];
  part.picture.box.hidden = false;
  part.picture.show(picture);
}

// The images of a finished run, from the server that has it. One moment at a time: if another was
// chosen meanwhile, that is the next.
const served = {
  wanted: null,
  busy: false,
  async show(time) {
    this.wanted = time;
    if (this.busy) return;
    this.busy = true;
    while (this.wanted !== null) {
      const asked = this.wanted;
      this.wanted = null;
      for (const camera of [0, 1].filter(each => frames.camera.includes(each))) {
        const answer = await fetch(`picture?at=${camera}:${asked}`).catch(() => null);
        const picture = answer && answer.ok ? decoded(await answer.json()) : null;
        if (picture) showPicture(picture);
        else if (!answer)
          now.status.textContent = 'The server does not answer.';
      }
    }
    this.busy = false;
  }
};

// What the sections are made of. A section is one function; null where a run has nothing for it.

function tiles(entries) {
  return make(
      'div', {class: 'tiles'},
      entries.filter(entry => entry[1] !== '–')
          .map(
              ([name, text, key]) => make(
                  'div', {class: 'tile'}, make('b', {'data-figure': key || undefined}, text),
                  make('span', {}, name))));
}

function table(head, rows, numeric = []) {
  return make(
      'div', {class: 'wide'},
      make(
          'table', {},
          make(
              'thead', {},
              make(
                  'tr', {},
                  head.map(
                      (text, k) =>
                          make('th', {class: numeric.includes(k) ? 'n' : undefined}, text)))),
          make(
              'tbody', {},
              rows.map(
                  row => make(
                      'tr', {},
                      row.map(
                          (text, k) => make(
                              'td', {class: numeric.includes(k) ? 'n' : undefined}, text)))))));
}

const swatch = (color, text) => make(
    'span', {style: 'white-space:nowrap'},
    make('span', {class: 'swatch', style: 'background:' + color}), text + '  ');

function pictureFigure(picture) {
  const choose = () => selection.set(frameNear(picture.time, CAMERAS.indexOf(picture.camera)));
  return make(
      'figure', {},
      make(
          'button', {class: 'picture', type: 'button', click: choose, title: 'Choose this frame'},
          make('img', {
            src: pictureSource(picture),
            width: picture.width,
            height: picture.height,
            alt: `${picture.camera} at ${seconds(picture.time)}: ${picture.why}`
          })),
      make('figcaption', {}, `${picture.camera}, ${seconds(picture.time)}: ${picture.why}`));
}

// Lists of the data that grow and change while a run goes on.

const FRAME_COLUMNS = {
  time: 1,
  camera: 1,
  state: 1,
  source: 1,
  prediction: 1,
  position: 3,
  rotation: 4,
  features: 1,
  stereo_matches: 1,
  inliers: 1,
  odometer_inliers: 1,
  sigma_position: 1,
  sigma_rotation_deg: 1,
  row_error_px: 1,
  cpu_ms: 1,
  behind_ms: 1,
  error_m: 1,
  component: 1
};
const LANDMARK_COLUMNS = {
  id: 1,
  time: 1,
  position: 3,
  camera: 1,
  views: 1,
  born: 1,
  sigma: 1
};
const KEYFRAME_COLUMNS = {
  id: 1,
  time: 1,
  camera: 1,
  component: 1,
  landmarks: 1,
  distance_m: 1,
  resolution_mm_per_px: 1,
  rms_sigmas: 1,
  position: 3,
  rotation: 4,
  covariance: 6
};

// A list {count, column: typed array, ...}: its arrays get room to grow, and always end where the
// list does. columns: how many numbers each has per row.
class Table {
  constructor(list, columns) {
    this.list = list;
    this.columns = Object.entries(columns);
    this.room = Object.fromEntries(this.columns.map(([key]) => [key, list[key]]));
    this.places = new Map();  // of the rows, by their ids
    if (list.id) list.id.forEach((id, row) => this.places.set(id, row));
  }

  resize(count) {
    for (const [key, width] of this.columns) {
      if (this.room[key].length < count * width) {
        const larger = new this.room[key].constructor(Math.max(64, 2 * count) * width);
        larger.set(this.list[key]);
        this.room[key] = larger;
      }
      this.list[key] = this.room[key].subarray(0, count * width);
    }
    this.list.count = count;
  }

  // values: {column: number or array}; null, or none at all, is NaN where there can be one.
  append(values) {
    const row = this.list.count;
    this.resize(row + 1);
    for (const [key, width] of this.columns) {
      const value = values[key];
      for (let k = 0; k < width; ++k) {
        const number = Array.isArray(value) ? value[k] : value;
        this.list[key][width * row + k] = known(number) ? number : NaN;
      }
    }
  }

  // Rows of another list, with ids; those that are here already become as they are there.
  put(other) {
    for (let i = 0; i < other.count; ++i) {
      const id = other.id[i];
      if (!this.places.has(id)) {
        this.places.set(id, this.list.count);
        this.resize(this.list.count + 1);
      }
      const row = this.places.get(id);
      for (const [key, width] of this.columns)
        this.list[key].set(other[key].subarray(width * i, width * i + width), width * row);
    }
  }

  // The last row takes the place of one that goes.
  erase(ids) {
    for (const id of ids) {
      const row = this.places.get(id), last = this.list.count - 1;
      if (row === undefined) continue;
      this.places.delete(id);
      if (row !== last) {
        for (const [key, width] of this.columns)
          this.list[key].copyWithin(width * row, width * last, width * last + width);
        this.places.set(this.list.id[row], row);
      }
      this.resize(last);
    }
  }
}

// The number of a name in a list of names, which gets it if it does not have it.
function numberOf(names, name) {
  if (!names.includes(name)) names.push(name);
  return names.indexOf(name);
}

// A frame as the server tells it, at the end of the frames.
function appendFrame(table, told) {
  frames.causes[frames.count] = told.causes || undefined;
  if (!told.causes) delete frames.causes[frames.count];
  table.append({
    ...told,
    state: numberOf(frames.states, told.state),
    source: numberOf(frames.sources, told.source),
    prediction: numberOf(frames.predictions, told.prediction)
  });
  frames.of += 1;
}

// Times of birth as the colours want them: from the first landmark to the last.
function findBirths(list) {
  let first = Infinity, last = -Infinity;
  for (const time of list.time) {
    first = Math.min(first, time);
    last = Math.max(last, time);
  }
  list.born_from = first;
  list.born_to = last;
  for (let i = 0; i < list.count; ++i)
    list.born[i] = last > first ? 65535 * (list.time[i] - first) / (last - first) : 0;
}

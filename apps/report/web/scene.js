// The map to turn and fly in: points and lines by WebGL, drawn when something changed.

const VERTEX =
    `attribute vec3 position; attribute vec4 color; uniform mat4 view; uniform float size; varying vec4 tint;
void main() { gl_Position = view * vec4(position, 1.0); gl_PointSize = size; tint = color; }`;
const FRAGMENT = `precision mediump float; varying vec4 tint; uniform bool round;
void main() { if (round && length(gl_PointCoord - 0.5) > 0.5) discard; gl_FragColor = tint; }`;

const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const plus = (a, b, s = 1) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross =
    (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = a => {
  const n = Math.hypot(...a) || 1;
  return a.map(x => x / n);
};

// Column-major, as WebGL wants it.
function multiplied(a, b) {
  const c = new Float32Array(16);
  for (let i = 0; i < 4; ++i)
    for (let j = 0; j < 4; ++j)
      for (let k = 0; k < 4; ++k) c[4 * j + i] += a[4 * k + i] * b[4 * j + k];
  return c;
}

// Rotates v by the quaternion (x, y, z, w).
function turned(q, v) {
  const u = [q[0], q[1], q[2]], t = cross(u, v).map(x => 2 * x);
  return plus(plus(v, t, q[3]), cross(u, t));
}

class Scene {
  constructor(canvas, up) {
    this.canvas = canvas;
    this.gl = canvas.getContext('webgl', {antialias: true, preserveDrawingBuffer: true});
    this.layers = new Map();
    this.up = up;  // unit: away from the ground
    this.target = [0, 0, 0];
    this.distance = 1;
    this.yaw = -0.6;
    this.pitch = 0.7;
    this.side = unit(Math.abs(up[0]) < 0.9 ? cross([1, 0, 0], up) : cross([0, 0, 1], up));
    this.front = cross(up, this.side);
    this.pending = false;
    this.touched = false;  // somebody has chosen the view
    this.drawn = false;    // once
    if (this.gl) this.prepare();
  }

  prepare() {
    const gl = this.gl, program = gl.createProgram();
    for (const [type, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    gl.useProgram(program);
    this.places = {
      position: gl.getAttribLocation(program, 'position'),
      color: gl.getAttribLocation(program, 'color'),
      view: gl.getUniformLocation(program, 'view'),
      size: gl.getUniformLocation(program, 'size'),
      round: gl.getUniformLocation(program, 'round')
    };
    gl.enableVertexAttribArray(this.places.position);
    gl.enableVertexAttribArray(this.places.color);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    new ResizeObserver(() => this.draw()).observe(this.canvas);
    this.listen();
  }

  // kind: 'points' or 'lines'; positions: 3 floats each, colors: 4 bytes each.
  set(name, kind, positions, colors, size = 1) {
    if (!this.gl) return;
    const gl = this.gl, old = this.layers.get(name);
    const layer = {
      kind,
      size,
      count: positions.length / 3,
      shown: old ? old.shown : true,
      position: old ? old.position : gl.createBuffer(),
      color: old ? old.color : gl.createBuffer()
    };
    gl.bindBuffer(gl.ARRAY_BUFFER, layer.position);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(positions), gl.STATIC_DRAW);
    gl.bindBuffer(gl.ARRAY_BUFFER, layer.color);
    gl.bufferData(gl.ARRAY_BUFFER, new Uint8Array(colors), gl.STATIC_DRAW);
    this.layers.set(name, layer);
    this.draw();
  }
  show(name, shown) {
    const layer = this.layers.get(name);
    if (layer) {
      layer.shown = shown;
      this.draw();
    }
  }
  draw() {
    if (!this.pending && this.gl) {
      this.pending = true;
      requestAnimationFrame(() => this.render());
    }
  }

  // Unit vectors of the view: right, up, towards the eye.
  axes() {
    const flat = plus(this.side.map(x => x * Math.cos(this.yaw)), this.front, Math.sin(this.yaw));
    const back = plus(flat.map(x => x * Math.cos(this.pitch)), this.up, Math.sin(this.pitch));
    const right = unit(cross(this.up, flat));
    return [right, cross(back, right), back];
  }
  eye() {
    return plus(this.target, this.axes()[2], this.distance);
  }

  matrix() {
    const [right, up, back] = this.axes(), eye = this.eye();
    const view = new Float32Array([
      right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0,
      -dot(right, eye), -dot(up, eye), -dot(back, eye), 1
    ]);
    const near = this.distance / 200, far = this.distance * 200, f = 1 / Math.tan(0.4),
          aspect = this.canvas.clientWidth / Math.max(1, this.canvas.clientHeight);
    const lens = new Float32Array([
      f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0,
      2 * far * near / (near - far), 0
    ]);
    return multiplied(lens, view);
  }

  render() {
    this.pending = false;
    const gl = this.gl, ratio = Math.min(2, window.devicePixelRatio || 1);
    const width = Math.round(this.canvas.clientWidth * ratio),
          height = Math.round(this.canvas.clientHeight * ratio);
    if (!width || !height) return;
    if (this.canvas.width !== width || this.canvas.height !== height) {
      this.canvas.width = width;
      this.canvas.height = height;
    }
    const back = (cssColor('--map-back').match(/[0-9a-f]{2}/gi) || [
                   'ff', 'ff', 'ff'
                 ]).map(hex => parseInt(hex, 16) / 255);
    gl.viewport(0, 0, width, height);
    gl.clearColor(back[0], back[1], back[2], 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.uniformMatrix4fv(this.places.view, false, this.matrix());
    for (const layer of this.layers.values()) {
      if (!layer.shown || !layer.count) continue;
      gl.bindBuffer(gl.ARRAY_BUFFER, layer.position);
      gl.vertexAttribPointer(this.places.position, 3, gl.FLOAT, false, 0, 0);
      gl.bindBuffer(gl.ARRAY_BUFFER, layer.color);
      gl.vertexAttribPointer(this.places.color, 4, gl.UNSIGNED_BYTE, true, 0, 0);
      gl.uniform1f(this.places.size, layer.size * ratio);
      gl.uniform1i(this.places.round, layer.kind === 'points' ? 1 : 0);
      gl.drawArrays(layer.kind === 'points' ? gl.POINTS : gl.LINES, 0, layer.count);
    }
    if (!this.drawn) gl.finish();  // who measures the first picture measures all of it
    this.drawn = true;
    if (this.after) this.after();
  }

  // Where a point is drawn [CSS px]; null behind the eye.
  pixel(point) {
    const m = this.matrix(), at4 = [
      0, 1, 2, 3
    ].map(i => m[i] * point[0] + m[4 + i] * point[1] + m[8 + i] * point[2] + m[12 + i]);
    if (at4[3] <= 0) return null;
    return [
      (at4[0] / at4[3] + 1) / 2 * this.canvas.clientWidth,
      (1 - at4[1] / at4[3]) / 2 * this.canvas.clientHeight
    ];
  }
  metresPerPixel() {
    return 2 * Math.tan(0.4) * this.distance / Math.max(1, this.canvas.clientHeight);
  }

  turn(x, y) {
    this.yaw -= x;
    this.pitch = Math.min(1.57, Math.max(-1.57, this.pitch + y));
    this.draw();
  }
  move(x, y) {
    const [right, up] = this.axes();
    this.target = plus(plus(this.target, right, x), up, y);
    this.draw();
  }
  fly(forward, right) {  // along the ground
    const axes = this.axes(), flat = unit(cross(this.up, axes[0]));
    this.target = plus(plus(this.target, flat, -forward), axes[0], right);
    this.draw();
  }
  zoom(factor) {
    this.distance = Math.min(1e6, Math.max(1e-3, this.distance * factor));
    this.draw();
  }
  look(yaw, pitch) {
    this.yaw = yaw;
    this.pitch = pitch;
    this.draw();
  }

  listen() {
    const held = new Map(), canvas = this.canvas;
    let moved = 0;
    for (const kind of ['pointerdown', 'wheel', 'keydown'])
      canvas.addEventListener(kind, () => this.touched = true, {passive: true});
    canvas.addEventListener('contextmenu', event => event.preventDefault());
    canvas.addEventListener('pointerdown', event => {
      held.set(event.pointerId, [event.clientX, event.clientY]);
      canvas.setPointerCapture(event.pointerId);
      moved = 0;
    });
    canvas.addEventListener('pointermove', event => {
      const last = held.get(event.pointerId);
      if (!last) return;
      const x = event.clientX - last[0], y = event.clientY - last[1];
      moved += Math.abs(x) + Math.abs(y);
      if (held.size === 2) {
        const other = [...held].find(([id]) => id !== event.pointerId)[1];
        const before = Math.hypot(last[0] - other[0], last[1] - other[1]),
              now = Math.hypot(event.clientX - other[0], event.clientY - other[1]);
        this.zoom(before / Math.max(1, now));
        this.move(-x / 2 * this.metresPerPixel(), y / 2 * this.metresPerPixel());
      } else if (event.shiftKey || event.buttons & 6)
        this.move(-x * this.metresPerPixel(), y * this.metresPerPixel());
      else
        this.turn(x * 0.008, y * 0.008);
      held.set(event.pointerId, [event.clientX, event.clientY]);
    });
    const release = event => {
      if (held.delete(event.pointerId) && event.type === 'pointerup' && moved < 5 && this.pick) {
        const box = canvas.getBoundingClientRect();
        this.pick(event.clientX - box.left, event.clientY - box.top);
      }
    };
    canvas.addEventListener('pointerup', release);
    canvas.addEventListener('pointercancel', release);
    canvas.addEventListener('wheel', event => {
      event.preventDefault();
      this.zoom(Math.exp(Math.sign(event.deltaY) * 0.12));
    }, {passive: false});
    canvas.addEventListener('keydown', event => {
      const step = this.distance * 0.06;
      const actions = {
        w: () => this.fly(step, 0),
        s: () => this.fly(-step, 0),
        a: () => this.fly(0, -step),
        d: () => this.fly(0, step),
        ArrowUp: () => this.turn(0, 0.06),
        ArrowDown: () => this.turn(0, -0.06),
        ArrowLeft: () => this.turn(0.06, 0),
        ArrowRight: () => this.turn(-0.06, 0),
        '+': () => this.zoom(0.85),
        '-': () => this.zoom(1.18),
        f: () => this.fit && this.fit(),
        t: () => this.look(this.yaw, 1.5699),
        e: () => this.look(this.yaw, 0.05),
      };
      const action = event.ctrlKey || event.metaKey || event.altKey ? null : actions[event.key];
      if (action) {
        event.preventDefault();
        event.stopPropagation();
        action();
      }
    });
  }
}

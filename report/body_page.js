// A body in three dimensions: its surface, coloured by temperature or displacement, with magnified
// displacement; sensors as numbered dots, output points, axes and scale. Behind a gateway also the
// machine's present state, computed from its temperatures. Drawn by three.js.
'use strict';

const body = JSON.parse(document.getElementById('body').textContent);
const place = id => document.getElementById(id);
const make = (tag, text, className) => {
  const element = document.createElement(tag);
  element.textContent = text;
  element.className = className || '';
  return element;
};
const nodes_mm = new Float32Array(body.nodes_mm);
const count = nodes_mm.length / 3;
for (const state of body.states) {
  state.rise_K = new Float32Array(state.rise_K);
  state.moved_um = new Float32Array(state.moved_um);
}

// ------------------------------------------------------------------ states and quantities

const livePeriod_ms = 2000;
const smoothEdges_max = 50000;  // triangles; edges of larger bodies are not smoothed
const shownOfSize = 0.08;  // largest magnified displacement of a group, relative to the size
const colours = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]];
const quantities = {
  rise: {name: 'temperature', unit: 'K', of: (state, i) => state.rise_K[i]},
  moved: {name: 'displacement', unit: '\u00b5m',
          of: (state, i) => Math.hypot(state.moved_um[3 * i], state.moved_um[3 * i + 1], state.moved_um[3 * i + 2])},
};
['x', 'y', 'z'].forEach((axis, k) => {
  quantities[axis] = {name: 'displacement in ' + axis, unit: '\u00b5m', of: (state, i) => state.moved_um[3 * i + k]};
});

const groups = new Map();
for (const state of body.states) {
  if (!groups.has(state.group)) groups.set(state.group, []);
  groups.get(state.group).push(state);
}
const oneWarm = body.states.filter(state => state.input);
let quantity = quantities.rise;
let shown = [];     // the states of the chosen group
let range = [0, 1];
let factor = 0;

// ------------------------------------------------------------------ the scene

THREE.Object3D.DefaultUp.set(0, 0, 1);
const view = place('view');
const renderer = new THREE.WebGLRenderer({antialias: body.triangles.length < 3 * smoothEdges_max, alpha: true, preserveDrawingBuffer: true});
view.append(renderer.domElement);
const scene = new THREE.Scene();
const camera = new THREE.PerspectiveCamera(35, 1, 1, 1e6);
// Triangles do not share vertices: each has one brightness, computed when it moves. This leaves so few
// operations per pixel that 200,000 triangles can be rotated without a graphics card.
const triangles = new Uint32Array(body.triangles);
const geometry = new THREE.BufferGeometry();
const positions = new THREE.BufferAttribute(new Float32Array(3 * triangles.length), 3);
const tints = new THREE.BufferAttribute(new Float32Array(3 * triangles.length), 3);
geometry.setAttribute('position', positions);
geometry.setAttribute('color', tints);
for (let i = 0; i < 3 * triangles.length; ++i)
  positions.array[i] = nodes_mm[3 * triangles[Math.floor(i / 3)] + i % 3];
geometry.computeBoundingBox();
geometry.computeBoundingSphere();
geometry.boundingSphere.radius *= 1 + 2 * shownOfSize;
const mesh = new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({vertexColors: THREE.VertexColors}));
scene.add(mesh);

const low = geometry.boundingBox.min;
const high = geometry.boundingBox.max;
const size_mm = high.distanceTo(low);
const labels = [];

function label(text, at, className) {
  const element = make('span', text, 'label ' + className);
  view.append(element);
  const shownLabel = {element: element, at: at};
  labels.push(shownLabel);
  return shownLabel;
}

function line(from, to, colour) {
  const drawn = new THREE.BufferGeometry().setFromPoints([from, to]);
  scene.add(new THREE.Line(drawn, new THREE.LineBasicMaterial({color: colour})));
}

function addAxesAndScale() {
  const corner = low.clone().subScalar(0.04 * size_mm);
  [['X', 0xc53030], ['Y', 0x2f855a], ['Z', 0x2b6cb0]].forEach(([name, colour], k) => {
    const end = corner.clone();
    end.setComponent(k, end.getComponent(k) + 0.15 * size_mm);
    line(corner, end, colour);
    label(name, end, 'axis');
  });
  const decade = 10 ** Math.floor(Math.log10(0.4 * (high.x - low.x)));
  const length = [5, 2, 1].map(step => step * decade).find(value => value <= 0.4 * (high.x - low.x));
  const from = new THREE.Vector3(high.x - length, corner.y, low.z);
  const to = new THREE.Vector3(high.x, corner.y, low.z);
  line(from, to, 0x718096);
  label(length + ' mm', from.clone().lerp(to, 0.5), 'scale');
}

function nearestNode(at) {
  let nearest = 0, least = Infinity;
  for (let i = 0; i < count; ++i) {
    const distance = Math.hypot(nodes_mm[3 * i] - at.x, nodes_mm[3 * i + 1] - at.y, nodes_mm[3 * i + 2] - at.z);
    if (distance < least) [nearest, least] = [i, distance];
  }
  return nearest;
}

// A point moves with the nearest surface.
function addPoints() {
  const list = place('points');
  let number = 0;
  for (const point of body.points) {
    const text = point.is_sensor ? String(++number) : '';
    const at = new THREE.Vector3(...point.at_mm);
    const shownLabel = label(text, at.clone(), point.is_sensor ? 'sensor' : 'tool');
    Object.assign(shownLabel, {rest: at, node: nearestNode(at)});
    const item = make('li', point.name + ' at ' + point.at_mm.map(value => +value.toFixed(1)).join(', ') + ' mm');
    item.prepend(make('span', text, 'label ' + (point.is_sensor ? 'sensor' : 'tool')));
    list.append(item);
  }
}

// Dims labels hidden by the body. Not in every frame, since every triangle is tested.
const ray = new THREE.Raycaster();
function dimHidden() {
  for (const shownLabel of labels) {
    const way = shownLabel.at.clone().sub(camera.position);
    ray.set(camera.position, way.clone().normalize());
    const [first] = ray.intersectObject(mesh);
    const hidden = Boolean(first) && first.distance < way.length() - 0.01 * size_mm;
    shownLabel.element.classList.toggle('behind', hidden);
  }
}

function lookAtAll() {
  const middle = low.clone().lerp(high, 0.5);
  controls.target.copy(middle);
  camera.position.copy(middle).add(new THREE.Vector3(1.1, -1.5, 0.9).multiplyScalar(size_mm));
  camera.near = size_mm / 100;
  camera.far = size_mm * 20;
  controls.update();
  dimHidden();
}

function render() {
  renderer.render(scene, camera);
  const width = view.clientWidth, height = view.clientHeight;
  for (const {element, at} of labels) {
    const on = at.clone().project(camera);
    element.hidden = Math.abs(on.z) > 1;
    element.style.transform = 'translate(' + (0.5 + 0.5 * on.x) * width + 'px,' + (0.5 - 0.5 * on.y) * height + 'px)';
  }
}

function resize() {
  renderer.setPixelRatio(Math.min(2, window.devicePixelRatio));
  renderer.setSize(view.clientWidth, view.clientHeight);
  camera.aspect = view.clientWidth / view.clientHeight;
  camera.updateProjectionMatrix();
  render();
}

// ------------------------------------------------------------------ drawing of a state

// Colour range and magnification are common to the group, so that its states can be compared.
function measureGroup() {
  let largest = 0;
  range = [Infinity, -Infinity];
  for (const state of shown) {
    for (let i = 0; i < count; ++i) {
      const value = quantity.of(state, i);
      if (value < range[0]) range[0] = value;
      if (value > range[1]) range[1] = value;
      largest = Math.max(largest, quantities.moved.of(state, i));
    }
  }
  if (range[0] === range[1]) range[1] = range[0] + 1;
  factor = largest > 0 ? shownOfSize * size_mm / (1e-3 * largest) : 0;
  factor = factor > 0 ? Number(factor.toPrecision(1)) : 0;
  // Values far below the range are rounding errors.
  const text = value => Math.abs(value) < 1e-3 * (range[1] - range[0]) ? '0' : value.toPrecision(3);
  place('low').textContent = text(range[0]) + ' ' + quantity.unit;
  place('high').textContent = text(range[1]) + ' ' + quantity.unit;
  place('factor').textContent = factor > 0 ? 'displacement drawn \u00d7 ' + factor.toLocaleString('en') : 'nothing moves';
}

// Brightness, 0.6 to 1, by a lamp above, to the right and in front.
const lamp = [0.35, -0.55, 0.75].map(each => each / Math.hypot(0.35, 0.55, 0.75));
function lightOn(points, first) {
  const [a, b, c] = [0, 1, 2].map(corner => 3 * triangles[first + corner]);
  const u = [0, 1, 2].map(k => points[b + k] - points[a + k]);
  const v = [0, 1, 2].map(k => points[c + k] - points[a + k]);
  const normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
  const towards = normal[0] * lamp[0] + normal[1] * lamp[1] + normal[2] * lamp[2];
  return 0.8 + 0.2 * towards / (Math.hypot(...normal) || 1);
}

function draw(state) {
  const moved_mm = new Float32Array(3 * count);
  const colour = new Float32Array(3 * count);
  for (let i = 0; i < count; ++i) {
    const share = (quantity.of(state, i) - range[0]) / (range[1] - range[0]) * (colours.length - 1);
    const from = Math.min(colours.length - 2, Math.max(0, Math.floor(share)));
    for (let k = 0; k < 3; ++k) {
      moved_mm[3 * i + k] = nodes_mm[3 * i + k] + 1e-3 * factor * state.moved_um[3 * i + k];
      colour[3 * i + k] = (colours[from][k] + (share - from) * (colours[from + 1][k] - colours[from][k])) / 255;
    }
  }
  for (let first = 0; first < triangles.length; first += 3) {
    const light = lightOn(moved_mm, first);
    for (let at = 3 * first; at < 3 * first + 9; ++at) {
      const value = 3 * triangles[Math.floor(at / 3)] + at % 3;
      positions.array[at] = moved_mm[value];
      tints.array[at] = light * colour[value];
    }
  }
  positions.needsUpdate = tints.needsUpdate = true;
  for (const {at, rest, node} of labels.filter(each => each.rest))
    at.set(...['x', 'y', 'z'].map((axis, k) => rest[axis] + 1e-3 * factor * state.moved_um[3 * node + k]));
  dimHidden();
  place('when').textContent = state.time_s === null ? state.name : state.name + ' after ' + timeText(state.time_s);
  place('outputs').textContent = state.outputs_um.length === 0 ? '' : 'tool against work: ' + body.outputs.map(
    (name, i) => name.replace(/_[a-z]+$/, '') + ' ' + state.outputs_um[i].toFixed(1) + (name.endsWith('_urad') ? ' \u00b5rad' : ' \u00b5m')).join(', ');
  render();
}

const timeText = time_s => time_s < 3600 ? (time_s / 60).toFixed(1) + ' min' : (time_s / 3600).toFixed(2) + ' h';
const drawChosen = () => draw(shown[place('time').value]);

function choose() {
  quantity = quantities[place('quantity').value];
  clearTimeout(liveTimer);
  if (place('group').value === '') return followMachine();
  const before = shown;
  shown = groups.get(place('group').value);
  const time = place('time');
  time.max = shown.length - 1;
  if (shown !== before) time.value = time.max;  // the end, where it is warmest
  place('times').hidden = shown.length < 2;
  measureGroup();
  drawChosen();
}

// Displacement is linear in the inputs' temperatures: the machine's state is the sum of the shapes with
// one input 1 K warm, each times that input's rise since the reference.
function sumOf(inputs) {
  const state = {name: 'now', time_s: null, rise_K: new Float32Array(count), moved_um: new Float32Array(3 * count),
                 outputs_um: body.outputs.map(() => 0)};
  const lost = [];
  for (const shape of oneWarm) {
    const input = inputs.find(each => each.name === shape.input);
    const rise_K = input ? input.temp_degC - input.reference_degC : NaN;
    // An input without a good sensor has an old temperature.
    if (!input || !(input.good || input.estimated) || input.temp_degC === null || input.reference_degC === null ||
        !isFinite(rise_K)) {
      lost.push(shape.input);
      continue;
    }
    for (let i = 0; i < count; ++i) state.rise_K[i] += rise_K * shape.rise_K[i];
    for (let i = 0; i < 3 * count; ++i) state.moved_um[i] += rise_K * shape.moved_um[i];
    body.outputs.forEach((_, i) => { state.outputs_um[i] += rise_K * shape.outputs_um[i]; });
  }
  if (lost.length) {
    state.name = 'now, without ' + lost.join(', ') + ' (not known)';
    state.outputs_um = [];  // undefined with a partial sum
  }
  return state;
}

let liveTimer = 0;
async function followMachine() {
  place('times').hidden = true;
  try {
    const status = await (await fetch('/api/status')).json();
    if (!status.inputs) throw new Error('no temperatures');
    shown = [sumOf(status.inputs)];
    measureGroup();
    draw(shown[0]);
  } catch (error) {
    place('when').textContent = 'the machine does not answer; this state is old';
  }
  if (place('group').value === '') liveTimer = setTimeout(followMachine, livePeriod_ms);
}

let player = 0;
function play() {
  const runs = player !== 0;
  clearInterval(player);
  place('play').textContent = runs ? 'play' : 'stop';
  player = runs ? 0 : setInterval(() => {
    place('time').value = (Number(place('time').value) + 1) % shown.length;
    drawChosen();
  }, 250);
}

// ------------------------------------------------------------------ start

place('title').textContent = document.title = body.title;
place('note').textContent = body.note;
if (location.protocol.startsWith('http') && oneWarm.length) place('group').append(new Option('the machine now', ''));
for (const name of groups.keys()) place('group').append(new Option(name, name));
for (const [key, each] of Object.entries(quantities)) place('quantity').append(new Option(each.name, key));
place('ramp').style.background = 'linear-gradient(to right,' + colours.map(rgb => 'rgb(' + rgb + ')') + ')';
const controls = new THREE.OrbitControls(camera, renderer.domElement);
addAxesAndScale();
addPoints();
lookAtAll();
controls.addEventListener('change', render);
controls.addEventListener('end', dimHidden);
place('group').addEventListener('change', choose);
place('quantity').addEventListener('change', choose);
place('time').addEventListener('input', drawChosen);
place('play').addEventListener('click', play);
place('whole').addEventListener('click', lookAtAll);
window.addEventListener('resize', resize);
resize();
choose();

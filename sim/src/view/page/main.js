// The page: what comes from a simulation or from a run that is over, what the pointer and the keys do, and what is said about it.

import { Body, COLOURS } from './body.js';
import { LABELS, short, viridis } from './colour.js';
import { decode } from './picture.js';
import { plot } from './plot.js';
import { Clock } from './clock.js';
import { open } from './source.js';
import * as THREE from './three.js';

const get = (id) => document.getElementById(id);
const canvas = get('view');
const body = new Body(canvas);
/** The body of the simulation beside, if there is one. */
let second = null;

let state = null;
let last = null;
let source = null;
let page = null;
/** Of a run that is over. */
let clock = null;
let generation = null;
let stamp = 0;
const sent_at = new Map();
const hands = new Map();
const latencies = [];
const arrivals = [];
const parked = new Set();

// ---------------------------------------------------------------- the server

function lost() {
  hands.clear();
  parked.clear();
  undrawn = 0;
  clock?.forget();
  status('no connection: trying again', true);
}

function say(request) { source.say(request); }

function told(message) {
  if (message.kind === 'welcome') { page = message.page; generation = null; return; }
  if (message.kind === 'state') { state = message; describe(); return; }
  if (message.kind === 'kept') command(message.command);
  clock?.forget();
  notice(message.text, message.level);
}

function seen(buffer) {
  const { text, blocks, beside } = decode(buffer);
  if (beside) { begin_pair(); text.beside = beside.text; }
  const is_first = generation !== text.generation;
  if (is_first) {
    generation = text.generation;
    body.clear(text.quantum_mm);
    second?.clear(text.beside.quantum_mm);
    get('about').textContent =
      `Positions of outlines are rounded to ${short(text.quantum_mm / 2)} mm. 3D by three.js (MIT).`;
    if (!clock) plots.forEach((one) => one.plot.clear());
    hands.clear();
    parked.clear();
  }
  body.take(blocks);
  second?.take(beside.blocks);
  if (is_first) offer_grey();
  if (second && is_first) compare();
  undrawn += 1;
  const is_new = !last || last.step !== text.step || last.generation !== text.generation;
  last = text;
  arrivals.push(performance.now());
  if (arrivals.length > 60) arrivals.shift();
  if (is_new && text.step > 0 && !clock) plots.forEach((one) => one.plot.add(one.row(text)));
  const points = new Map([...hands].map(([id, hand]) => [id, hand.point]));
  for (const [of, said] of sides()) {
    for (const tool of said.tools) tool.is_mine = tool.page === page;
    of.hold(said.tools, points);
  }
  for (const tool of text.tools) {
    const at = tool.is_mine && sent_at.get(tool.stamp);
    if (at) pending.push([tool.stamp, at]);
  }
  figures();
  mark();
}

/** Says which frame of a run is shown. */
function mark() {
  if (!clock || !last) return;
  clock.came(last.frame);
  get('seek').value = last.frame;
  get('seek').setAttribute('aria-valuetext', `${short(last.time_s)} s`);
  get('seek_out').textContent = `${last.time_s.toFixed(3)} s`;
  plots.forEach((one) => one.plot.mark(last.step - 1));
}

// ---------------------------------------------------------------- two beside each other

/** The bodies with what was said of them last. */
const sides = () => (second && last?.beside ? [[body, last], [second, last.beside]] : last ? [[body, last]] : []);

function begin_pair() {
  if (second) return;
  second = new Body(get('view_beside'), body);
  second.canvas.parentElement.hidden = false;
  document.body.classList.add('two');
  // The first has another size now.
  body.was_sized = false;
  lead_from(second);
  plots[0].series.push({ name: 'beside', colour: '#0072b2' });
  plots[0].plot.name();
}

/** Offers grey values for the cut where there are some, and shows them. */
function offer_grey() {
  const option = document.querySelector('#cut_shows [value=grey]');
  const voxels = body.cut.voxels;
  option.hidden = option.disabled = !voxels?.grey;
  if (voxels?.grey) option.textContent = `grey, ${short(voxels.range[0])} to ${short(voxels.range[1])}`;
  body.cut_shows = voxels?.grey ? 'grey' : 'label';
  get('cut_shows').value = body.cut_shows;
}

/** Says whether the difference of displacements can be seen. */
function compare() {
  const option = document.querySelector('#colour [value=difference]');
  option.hidden = false;
  option.disabled = !body.is_alike;
  if (option.disabled && body.colour === 'difference') { get('colour').value = 'label'; get('colour').onchange({ target: get('colour') }); }
  warn([]);
}

// ---------------------------------------------------------------- words and numbers

function status(text, is_bad) {
  get('status').textContent = text;
  get('status').classList.toggle('bad', Boolean(is_bad));
}

function notice(text, level) {
  const line = document.createElement('p');
  line.className = level;
  line.textContent = text;
  get('notices').append(line);
  while (get('notices').children.length > 4) get('notices').firstChild.remove();
  setTimeout(() => line.remove(), level === 'error' ? 12000 : 6000);
}

function command(line) { get('command').textContent = line; }

function describe() {
  get('scene').textContent = state.scene;
  document.title = `${state.scene} – yawara`;
  document.body.classList.toggle('over', Boolean(state.playback));
  if (state.playback) begin_playback(state.playback);
  get('pause').setAttribute('aria-pressed', String(state.paused));
  get('pause').textContent = state.paused ? 'Go on' : 'Pause';
  command(state.command);
  if (state.beside) {
    begin_pair();
    [body, second].forEach((one, i) => { one.canvas.nextElementSibling.textContent = i ? state.beside.changes.join(', ') : 'as it is'; });
  }
  body.labels = state.labels;
  const legend = get('legend');
  legend.replaceChildren(...state.labels.map(({ label, name }, number) => {
    const row = document.createElement('li');
    const box = document.createElement('label');
    const check = document.createElement('input');
    check.type = 'checkbox';
    check.checked = !body.hidden.has(number);
    check.onchange = () => {
      if (check.checked) body.hidden.delete(number); else body.hidden.add(number);
      body.paint();
    };
    const mark = document.createElement('i');
    mark.style.background = LABELS[number % LABELS.length];
    box.append(check, mark, name || `label ${label}`);
    row.append(box);
    return row;
  }));
  get('plan').tBodies[0].replaceChildren(...state.plan.map((row) => {
    const line = document.createElement('tr');
    line.className = row.runs ? '' : 'off';
    const other = state.beside?.plan.find((one) => one.stage === row.stage);
    const choice = other && other.choice !== row.choice ? `${row.choice} | beside: ${other.choice}` : row.choice;
    for (const text of [row.stage, choice, row.why]) {
      const cell = document.createElement('td');
      cell.textContent = text;
      line.append(cell);
    }
    return line;
  }));
  warn([]);
  get('stages').replaceChildren(...state.stages.map(({ key, value, choices }) => {
    const select = document.createElement('select');
    select.dataset.key = key;
    select.dataset.was = value;
    for (const one of choices.includes(value) ? choices : [value, ...choices]) select.append(new Option(one, one, false, one === value));
    return labelled(key.replace('stages.', ''), select);
  }), ...state.numbers.map(({ key, value }) => {
    const input = document.createElement('input');
    input.type = 'number';
    input.step = 'any';
    input.size = 8;
    input.dataset.key = key;
    input.dataset.was = value ?? '';
    input.value = value ?? '';
    return labelled(key, input);
  }));
  get('materials').replaceChildren(...state.materials.map(({ name, young_modulus_pa: pa }, i) => {
    const input = document.createElement('input');
    input.type = 'range';
    [input.min, input.max, input.step] = [2, 6, 0.05];
    input.value = Math.log10(pa);
    input.dataset.key = `materials.${i}.young_modulus_pa`;
    input.dataset.was = input.value;
    const out = document.createElement('output');
    const show = () => { out.textContent = `E = ${short(10 ** Number(input.value) / 1000)} kPa`; };
    input.oninput = show;
    show();
    const label = document.createElement('label');
    label.append(name || `material ${i}`, out, input);
    return label;
  }));
}

function begin_playback({ frames, rows }) {
  clock = new Clock(frames, (frame) => say({ do: 'seek', frame }));
  clock.speed = Number(get('speed').value);
  get('seek').max = clock.last;
  canvas.setAttribute('aria-label', 'The body as it was. With the keyboard: Space plays, N and B go to the next frame and back, Home and End to the first and last, arrows turn the view.');
  plots.forEach((one) => one.plot.show(rows.map(one.row)));
  mark();
}

function labelled(text, input) {
  const label = document.createElement('label');
  label.append(text, input);
  return label;
}

function warn(more) {
  const plan = [...(state?.warnings ?? []), ...(state?.beside?.warnings ?? []).map((text) => `beside: ${text}`)];
  if (second && !body.is_alike) plan.push('no difference of displacement: the bodies have no outlines, or these do not rest at the same points (another image, other cells or a finer mesh)');
  const lines = [...plan.map((text) => [text, '']), ...more.map((text) => [text, 'bad'])];
  get('warnings').replaceChildren(...lines.map(([text, kind]) => {
    const line = document.createElement('li');
    line.textContent = text;
    line.className = kind;
    return line;
  }));
}

const plots = [
  { row: (r) => [r, r.beside].filter(Boolean).map((one) => Math.hypot(...one.force_n)), title: 'force', unit: 'N', series: [{ name: 'force', colour: '#d55e00' }] },
  { row: (r) => [r.error_estimate === null ? null : 100 * r.error_estimate], title: 'estimated error of energy', unit: '%', series: [{ name: 'error', colour: '#cc79a7' }] },
  { row: (r) => [r.vertices], title: 'vertices', unit: '', series: [{ name: 'vertices', colour: '#0072b2' }] },
  {
    row: (r) => [r.times_ms.tool, r.times_ms.solve, r.times_ms.indicator, r.times_ms.remesh, r.times_ms.inverse],
    title: 'time of a step', unit: 'ms', stacked: true,
    series: [['tools', '#7a7a7a'], ['equilibrium', '#0072b2'], ['indicator', '#e69f00'], ['mesh', '#009e73'], ['inverse', '#cc79a7']].map(([name, colour]) => ({ name, colour })),
  },
  { row: (r) => [r.iterations], title: 'iterations', unit: '', series: [{ name: 'iterations', colour: '#009e73' }] },
  { row: (r) => [r.residual], title: 'residual', unit: '', log: true, series: [{ name: 'residual', colour: '#56b4e9' }] },
].map((one) => ({ ...one, plot: plot(get('plots'), one, (row) => clock.go_to_step(row + 1)) }));

function figures() {
  const force = Math.hypot(...last.force_n);
  get('force').textContent = `${force.toFixed(3)} N`;
  const both = (say) => sides().map(([, said]) => say(said)).join(' | ');
  if (last.beside) {
    const away = Math.hypot(...last.force_n.map((x, i) => x - last.beside.force_n[i]));
    get('force_beside').textContent = `${Math.hypot(...last.beside.force_n).toFixed(3)} N`;
    get('force_difference').textContent = `${away.toFixed(3)} N${force > 1e-3 ? ` (${short(100 * away / force)} %)` : ''}`;
  }
  const mine = last.tools.find((tool) => tool.hand !== null) ?? last.tools[0];
  get('torque').textContent = `${(mine ? Math.hypot(...mine.torque_n_m) : 0).toFixed(4)} N m`;
  const s = mine?.stiffness_n_m;
  const size = mine ? Math.hypot(...mine.force_n) : 0;
  let felt = null;
  if (s && size > 1e-6) {
    const f = mine.force_n.map((x) => x / size);
    felt = s.reduce((sum, row, i) => sum + f[i] * row.reduce((a, x, j) => a + x * f[j], 0), 0);
  }
  get('stiffness').textContent = felt === null ? '–' : `${short(felt)} N/m`;
  get('error').textContent = mine?.force_error_n == null ? '–' : `± ${short(mine.force_error_n)} N`;
  get('n_step').textContent = last.step;
  get('n_vertices').textContent = both((said) => `${said.vertices}${said.waiting ? `, ${said.waiting} wait` : ''}`);
  get('n_rate').textContent = last.at_rest ? 'at rest' : `${last.steps_per_s.toFixed(0)} /s`;
  while (arrivals.at(-1) - arrivals[0] > 2000) arrivals.shift();
  const span = arrivals.at(-1) - arrivals[0];
  get('n_pictures').textContent = arrivals.length > 2 && !last.at_rest ? `${((arrivals.length - 1) / span * 1000).toFixed(0)} /s` : '–';
  const failed = sides().map(([, said]) => said).filter((said) => !said.converged);
  for (const [of, said] of sides()) of.canvas.nextElementSibling.classList.toggle('bad', !said.converged);
  if (failed.length) {
    const [{ failure }] = failed;
    const where = failure ? ` at ${failure.place_mm.map((x) => x.toFixed(0)).join(', ')} mm` : '';
    status(`step ${last.step} did not converge${last.converged ? ' beside' : ''}${where}`, true);
    warn(failed.flatMap((said) => said.failure?.advice ?? []));
  } else if (clock) status(`${short(last.time_s)} s: step ${last.step} of ${state.playback.rows.length}`);
  else status(state?.paused ? 'paused' : last.at_rest ? 'at rest: take hold of it' : both((said) => `${said.vertices} vertices, ${said.tets} tetrahedra`));
}

function overlay() {
  const is_shown = (tool) => Math.hypot(...tool.force_n) > 1e-4 && !tool.reference_mm.includes(null);
  const shown = sides().flatMap(([of, said]) => said.tools.filter(is_shown).map((tool) => [of, tool]));
  const labels = get('labels');
  while (labels.children.length < shown.length) labels.append(document.createElement('div'));
  while (labels.children.length > shown.length) labels.lastChild.remove();
  shown.forEach(([of, tool], i) => {
    const pane = of.canvas.parentElement;
    const [x, y] = of.project(tool.reference_mm);
    const line = labels.children[i];
    line.textContent = `${Math.hypot(...tool.force_n).toFixed(2)} N`;
    line.style.transform = `translate(${Math.round(pane.offsetLeft + x + 14)}px, ${Math.round(pane.offsetTop + y - 30)}px)`;
  });
}

function bar() {
  const of = COLOURS[body.colour];
  get('bar').hidden = body.colour === 'label';
  if (body.colour === 'label') return;
  const pen = get('ramp').getContext('2d');
  for (let x = 0; x < 220; x += 1) {
    pen.fillStyle = `rgb(${viridis(x / 219).map((c) => Math.round(255 * c)).join(' ')})`;
    pen.fillRect(x, 0, 1, 12);
  }
  get('low').textContent = '0';
  get('middle').textContent = short(body.range / 2);
  get('high').textContent = short(body.range);
  get('what').textContent = of.unit ? `${of.name}, ${of.unit}` : of.name;
}

// ---------------------------------------------------------------- hands

const tool_kind = () => (clock ? 'look' : null) ?? document.querySelector('input[name=tool]:checked').value;

function free_hand() {
  for (let id = 0; id < 10; id += 1) if (!hands.has(id)) return id;
  return null;
}

/** How far a blade comes out of the body, mm. */
const OUTSIDE_MM = 20;

/** Takes hold of what is under the pointer, in either picture; the hand's number, or null. */
function take(x, y, pointer, of = body) {
  const kind = tool_kind();
  const hit = kind === 'look' ? null : of.pick(x, y);
  const id = hit && free_hand();
  if (!hit || id === null) return null;
  const radius = Number(get('radius').value);
  const hand = { of, pointer, kind, radius, move: new THREE.Vector3(), away: new THREE.Vector3(), normal: hit.normal };
  if (kind === 'grab') {
    hand.start = hit.point.clone();
    say({ do: 'grab', hand: id, rest_mm: hit.rest.toArray(), radius_mm: radius });
  } else if (kind === 'sew') {
    hand.start = hit.point.clone();
    say({ do: 'sew', hand: id, centre_mm: hand.start.toArray(), radius_mm: radius });
  } else if (kind === 'cut') {
    // A blade along the view; what it sweeps over is cut as deep as the slider says.
    const depth = Number(get('depth').value);
    const into = of.looking();
    hand.start = hit.point.clone().addScaledVector(into, depth);
    const edge = into.multiplyScalar(-(depth + OUTSIDE_MM));
    say({ do: 'cut', hand: id, tip_mm: hand.start.toArray(), edge_mm: edge.toArray() });
  } else {
    hand.start = hit.point.clone().addScaledVector(hit.normal, radius + 1.5);
    say({ do: 'press', hand: id, centre_mm: hand.start.toArray(), radius_mm: radius });
  }
  hand.grip = of.on_plane(x, y, hit.point);
  hand.through = hit.point.clone();
  hand.point = hand.start.clone();
  hands.set(id, hand);
  lead(id, hand);
  return id;
}

function lead(id, hand) {
  const move = hand.move.clone().add(hand.away);
  if (hand.kind === 'press') move.addScaledVector(hand.normal, -(Number(get('depth').value) + 1.5));
  hand.point = hand.start.clone().add(move);
  stamp = (stamp + 1) % 4294967296;
  sent_at.set(stamp, performance.now());
  if (sent_at.size > 400) sent_at.delete(sent_at.keys().next().value);
  say({ do: 'move', hand: id, move_mm: move.toArray(), stamp });
}

function let_go(id) {
  say({ do: 'release', hand: id });
  hands.delete(id);
  parked.delete(id);
}

const hand_of = (pointer) => [...hands.keys()].find((id) => hands.get(id).pointer === pointer && !parked.has(id));
const waiting_moves = new Set();

function up(event) {
  const id = hand_of(event.pointerId);
  if (id === undefined) return;
  if (event.shiftKey) { parked.add(id); notice('the hand stays; Release lets go of all'); } else let_go(id);
  if (![...hands.keys()].some((one) => !parked.has(one))) body.controls.enabled = true;
}
/** Has the pointer take hold of a body. */
function lead_from(of) {
  const { canvas } = of;
  canvas.addEventListener('pointerdown', (event) => {
    if (event.button !== 0) return;
    const id = take(event.clientX, event.clientY, event.pointerId, of);
    if (id === null) return;
    canvas.focus({ preventScroll: true });
    body.controls.enabled = false;
    canvas.setPointerCapture(event.pointerId);
    event.stopImmediatePropagation();
  }, { capture: true });

  canvas.addEventListener('pointermove', (event) => {
    const id = hand_of(event.pointerId);
    if (id === undefined) return;
    const hand = hands.get(id);
    const at = of.on_plane(event.clientX, event.clientY, hand.through);
    if (!at) return;
    hand.move = at.sub(hand.grip);
    waiting_moves.add(id);
  }, { capture: true });

  canvas.addEventListener('pointerup', up);
  canvas.addEventListener('pointercancel', up);

  canvas.addEventListener('wheel', (event) => {
    const id = [...hands.keys()].find((one) => !parked.has(one));
    if (id === undefined) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    const hand = hands.get(id);
    hand.away.addScaledVector(body.camera.getWorldDirection(new THREE.Vector3()), -0.03 * event.deltaY);
    waiting_moves.add(id);
  }, { capture: true, passive: false });
}
lead_from(body);

canvas.addEventListener('keydown', (event) => {
  const place = canvas.getBoundingClientRect();
  const key = event.key.toLowerCase();
  const way_of = { n: 1, b: -1, home: -Infinity, end: Infinity }[key];
  if (clock && key === ' ') get('play').click();
  else if (clock && way_of) clock.go(clock.wanted + way_of);
  else if (clock && 'g escape'.split(' ').includes(key)) return;
  else if (key === 'g') {
    if (take(place.left + place.width / 2, place.top + place.height / 2, 'keys') === null) notice('nothing is in the middle of the view', 'error');
  } else if (key === ' ') get('pause').click();
  else if (key === 'n') get('step').click();
  else if (key === 'escape') get('release').click();
  else {
    const id = hand_of('keys');
    const right = new THREE.Vector3().setFromMatrixColumn(body.camera.matrixWorld, 0);
    const above = new THREE.Vector3().setFromMatrixColumn(body.camera.matrixWorld, 1);
    const ahead = body.camera.getWorldDirection(new THREE.Vector3());
    const ways = { arrowleft: [right, -2], arrowright: [right, 2], arrowup: [above, 2], arrowdown: [above, -2], pageup: [ahead, 2], pagedown: [ahead, -2] };
    const way = ways[key];
    if (!way) return;
    if (id === undefined) turn(key);
    else { hands.get(id).move.addScaledVector(...way); waiting_moves.add(id); }
  }
  event.preventDefault();
});

/** Turns the view by keys. */
function turn(key) {
  const by = { arrowleft: [0.1, 0], arrowright: [-0.1, 0], arrowup: [0, -0.1], arrowdown: [0, 0.1] }[key];
  const offset = body.camera.position.clone().sub(body.controls.target);
  if (by) {
    const spherical = { r: offset.length(), az: Math.atan2(offset.y, offset.x) + by[0], up: Math.acos(offset.z / offset.length()) + by[1] };
    const up = Math.min(Math.max(spherical.up, 0.05), Math.PI - 0.05);
    offset.set(Math.sin(up) * Math.cos(spherical.az), Math.sin(up) * Math.sin(spherical.az), Math.cos(up)).multiplyScalar(spherical.r);
  } else offset.multiplyScalar(key === 'pageup' ? 0.9 : 1.1);
  body.camera.position.copy(body.controls.target).add(offset);
  body.controls.update();
  body.is_stale = true;
}

// ---------------------------------------------------------------- what is pressed

get('pause').onclick = () => say({ do: 'pause', on: !state?.paused });
get('step').onclick = () => say({ do: 'step' });
get('reset').onclick = () => say({ do: 'reset' });
get('release').onclick = () => { [...hands.keys()].forEach(let_go); body.controls.enabled = true; };
get('play').onclick = () => clock?.play(!clock.plays);
get('back').onclick = () => clock?.go(clock.wanted - 1);
get('next').onclick = () => clock?.go(clock.wanted + 1);
get('seek').oninput = ({ target }) => clock?.go(Number(target.value));
get('speed').onchange = ({ target }) => { if (clock) clock.speed = Number(target.value); };
get('save').onclick = () => say({ do: 'save' });
get('shot').onclick = () => {
  const link = document.createElement('a');
  link.href = shot().toDataURL('image/png');
  link.download = `${state?.scene ?? 'yawara'}-${last?.step ?? 0}.png`;
  link.click();
};
/** The picture, or both as they stand. */
function shot() {
  if (!second) return canvas;
  const [a, b] = [body, second].map((one) => one.canvas);
  const is_row = b.parentElement.offsetLeft > 0;
  const both = document.createElement('canvas');
  both.width = is_row ? a.width + b.width : Math.max(a.width, b.width);
  both.height = is_row ? Math.max(a.height, b.height) : a.height + b.height;
  const pen = both.getContext('2d');
  pen.drawImage(a, 0, 0);
  pen.drawImage(b, is_row ? a.width : 0, is_row ? 0 : a.height);
  return both;
}
get('copy').onclick = async () => {
  try { await navigator.clipboard.writeText(get('command').textContent); notice('copied'); } catch { notice('this browser keeps pages from copying: mark the line below', 'error'); }
};
get('colour').onchange = ({ target }) => { body.colour = target.value; body.range = 0; body.paint(); };
get('lines').onchange = ({ target }) => { body.shows_lines = target.checked; body.pair.forEach((one) => { one.place(); one.is_stale = true; }); };
get('cut').onchange = ({ target }) => { body.is_cut = target.checked; body.slice(); };
get('cut_shows').onchange = ({ target }) => { body.cut_shows = target.value; body.slice(); };
get('where').oninput = ({ target }) => { body.where = Number(target.value); body.slice(); };
get('opacity').oninput = ({ target }) => { body.opacity = target.value / 100; get('opacity_out').textContent = `${target.value} %`; body.paint(); };
get('radius').oninput = ({ target }) => { get('radius_out').textContent = `${target.value} mm`; };
get('depth').oninput = ({ target }) => {
  get('depth_out').textContent = `${target.value} mm`;
  for (const [id, hand] of hands) if (hand.kind === 'press') waiting_moves.add(id);
};
get('apply').onclick = () => {
  const changes = [];
  for (const input of document.querySelectorAll('#change [data-key]')) {
    if (input.value === input.dataset.was || input.value === '') continue;
    const value = input.type === 'range' ? Number((10 ** Number(input.value)).toPrecision(3)) : input.value;
    const is_whole = /^-?\d+$/.test(input.value);
    const text = input.dataset.key.endsWith('_pa') && Number.isInteger(value) ? `${value}.0` : input.type === 'number' && !is_whole ? String(Number(value)) : value;
    changes.push(`${input.dataset.key}=${text}`);
  }
  if (changes.length) say({ do: 'set', changes }); else notice('nothing is changed');
};
matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => { body.pair.forEach((one) => { one.is_stale = true; }); });

// ---------------------------------------------------------------- pictures

const pending = [];
let undrawn = 0;
let plotted = 0;
let drawn = 0;

function tick(now) {
  if (!clock) return;
  clock.tick(Math.min(now - drawn, 250));
  get('play').setAttribute('aria-pressed', String(clock.plays));
  get('play').textContent = clock.plays ? 'Pause' : 'Play';
}

function draw(now) {
  tick(now);
  drawn = now;
  for (const id of waiting_moves) if (hands.has(id)) lead(id, hands.get(id));
  waiting_moves.clear();
  const drawn_now = body.pair.filter((one) => one.draw());
  if (drawn_now.length) {
    if (undrawn) say({ do: 'drawn', count: undrawn });
    undrawn = 0;
    overlay();
    bar();
    for (const [id, at] of pending.splice(0)) {
      if (!sent_at.delete(id)) continue;
      latencies.push(performance.now() - at);
      if (latencies.length > 200) latencies.shift();
      const sorted = [...latencies].sort((a, b) => a - b);
      get('n_latency').textContent = `${sorted[sorted.length >> 1].toFixed(0)} ms`;
    }
  }
  if (now - plotted > 100) { plotted = now; plots.forEach((one) => one.plot.draw()); }
  requestAnimationFrame(draw);
}

// For scripts and tests: where the page stands, and where the body is on the screen.
window.yawara = {
  get last() { return last; },
  get state() { return state; },
  get latencies() { return [...latencies]; },
  get socket() { return source.socket; },
  get clock() { return clock; },
  body,
  get beside() { return second; },
};

source = open({ told, seen, lost });
requestAnimationFrame(draw);

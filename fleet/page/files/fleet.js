// Page of a store of machines: all machines, one machine, or one place compared with its sisters, selected by the
// address after #. The store answers in JSON.
'use strict';

const reloadMs = 60000;
const spans = [['8 h', 28800], ['day', 86400], ['week', 604800], ['month', 2592000], ['year', 31536000]];
const order = ['bad', 'warning', 'unknown', 'good'];
const svgSpace = 'http://www.w3.org/2000/svg';

const view = document.getElementById('view');
const make = (tag, text, attributes = {}) => {
  const element = document.createElement(tag);
  if (text !== undefined && text !== null) element.textContent = text;
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  return element;
};
const draw = (tag, attributes, text) => {
  const element = document.createElementNS(svgSpace, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  if (text !== undefined) element.textContent = text;
  return element;
};
const isNumber = value => typeof value === 'number' && isFinite(value);
const fixed = (value, digits) => isNumber(value) ? value.toFixed(digits).replace('-', '\u2212') : '\u2013';
const link = (...parts) => '#/' + parts.map(encodeURIComponent).join('/');
const ago = at_s => {
  if (!isNumber(at_s)) return 'never';
  const s = Math.max(0, Date.now() / 1000 - at_s);
  return s < 3600 ? Math.floor(s / 60) + ' min ago' : s < 172800 ? Math.floor(s / 3600) + ' h ago'
    : Math.floor(s / 86400) + ' d ago';
};
const clock = at_s => new Date(at_s * 1000).toLocaleString([], {dateStyle: 'short', timeStyle: 'short', hour12: false});
const placeName = column => column.replace(/_(degC|um|urad|rpm|mm|on)$/, '').replace(/_/g, ' ');
const unitOf = column => {
  const unit = (column.match(/_(degC|um|urad|rpm|mm)$/) || [])[1];
  return {degC: '\u00b0C', um: '\u00b5m', urad: '\u00b5rad'}[unit] || unit || '';
};

async function ask(path) {
  const answer = await fetch(path);
  const value = await answer.json();
  if (!answer.ok) throw new Error(value.error);
  return value;
}

function title(parts, summary) {
  const where = document.getElementById('where');
  where.replaceChildren();
  parts.forEach(([text, href]) => where.append(' \u203a ', href ? make('a', text, {href: href}) : text));
  document.title = parts.length ? parts.map(part => part[0]).join(' \u203a ') : 'machines';
  document.getElementById('summary').textContent = summary;
}

// ------------------------------------------------------------------ all machines

let hall = null;  // selected; null: all

function cell(label, text, className) {
  return make('td', text, Object.assign({'data-label': label}, className ? {class: className} : {}));
}

function machineRow(machine) {
  const row = make('tr');
  const name = make('th', null, {scope: 'row'});
  name.append(make('a', machine.name, {href: link(machine.name)}));
  const off = Math.abs(machine.remainder_um);
  row.append(name,
    make('td', machine.verdict, {class: 'verdict ' + machine.level}),
    cell('hall', machine.hall || '\u2013'),
    cell('type', machine.type),
    cell('probed', isNumber(machine.remainder_um) ? fixed(off, 1) +
         (isNumber(machine.claimed_um) ? ' of \u00b1' + fixed(machine.claimed_um, 1) : '') +
         ' \u00b5m, ' + ago(machine.probed_s) : 'never', 'number'),
    cell('outside', machine.outside_days + ' d', 'number'),
    cell('rank', isNumber(machine.rank) ? machine.rank + ' of ' + machine.ranked : '\u2013', 'number'),
    cell('release', machine.release ? machine.release + ' ' + machine.release_step.replace(/_/g, ' ') : '\u2013'),
    cell('sent', ago(machine.seen_s), 'number'));
  return row;
}

function hallBar(machines, show) {
  const bar = make('nav', null, {'aria-label': 'hall'});
  for (const name of [null, ...[...new Set(machines.map(machine => machine.hall))].sort()]) {
    const all = machines.filter(machine => name === null || machine.hall === name);
    const wrong = all.filter(machine => machine.level === 'bad').length;
    const button = make('button', (name === null ? 'all' : name || 'no hall') + ' ', {'aria-pressed': hall === name});
    button.append(make('span', wrong ? '\u00a0' + wrong + ' of ' + all.length : '\u00a0' + all.length,
                       {class: wrong ? 'bad' : 'note'}));
    button.addEventListener('click', () => { hall = name; show(machines); });
    bar.append(button);
  }
  return bar;
}

function showMachines(machines) {
  const shown = machines.filter(machine => hall === null || machine.hall === hall);
  shown.sort((a, b) => order.indexOf(a.level) - order.indexOf(b.level) || a.name.localeCompare(b.name));
  const count = level => machines.filter(machine => machine.level === level).length;
  title([], machines.length + ' machines, ' + count('bad') + ' depart, ' + count('warning') + ' to look at, ' +
        count('unknown') + ' unknown');
  const section = make('section');
  const table = make('table', null, {id: 'machines'});
  const head = make('thead');
  const names = make('tr');
  for (const [text, number] of [['machine'], ['verdict'], ['hall'], ['type'], ['error at last probing, of claimed', 1],
                                ['outside in 30 d', 1], ['rank', 1], ['release'], ['sent', 1]])
    names.append(make('th', text, number ? {scope: 'col', class: 'number'} : {scope: 'col'}));
  head.append(names);
  const body = make('tbody');
  body.append(...shown.map(machineRow));
  table.append(head, body);
  section.append(hallBar(machines, showMachines), table);
  view.replaceChildren(section);
  performance.mark('machines shown');
}

// ------------------------------------------------------------------ one machine

// Departures with their subjects: {"sisters": {"z_um": {"departs", "subjects": [...]}}, "own_past": ...}
const whatDeparts = night => Object.entries(night.departure || {}).flatMap(([kind, outputs]) =>
  Object.entries(outputs || {}).filter(([, output]) => output.departs).map(([name, output]) =>
    'departs from its ' + kind.replace('_', ' ') + ' in ' + placeName(name) + ': ' + (output.subjects || []).slice(0, 3).map(part =>
      part.subject + ' ' + fixed(100 * part.share, 0) + ' % (' + fixed(part.effect_um, 1) + ' \u00b5m)').join(', '))).join('; ');

function section(heading, ...parts) {
  const made = make('section');
  made.append(make('h2', heading), ...parts);
  return made;
}

function monthTable(months) {
  if (!months.length) return make('p', 'no night evaluated yet', {class: 'note'});
  const table = make('table');
  const head = make('tr');
  for (const text of ['month', 'left (median)', 'claimed', 'nights', 'departs'])
    head.append(make('th', text, {scope: 'col', class: text === 'month' ? '' : 'number'}));
  const rows = months.map(month => {
    const row = make('tr');
    const late = month.remainder_um > 3 * month.claimed_um;
    row.append(make('th', month.month, {scope: 'row'}),
      make('td', fixed(month.remainder_um, 1) + ' \u00b5m', {class: 'number' + (late ? ' warning' : '')}),
      make('td', fixed(month.claimed_um, 1) + ' \u00b5m', {class: 'number'}), make('td', month.nights, {class: 'number'}),
      make('td', month.departing, {class: 'number' + (month.departing ? ' bad' : '')}));
    return row;
  });
  table.append(head, ...rows);
  return table;
}

function releaseList(releases) {
  const list = make('ol');
  for (const release of releases) {
    const entry = make('li', 'release ' + release.id + ', model ' + release.model + (release.note ? ': ' + release.note : ''));
    const steps = make('ol');
    const all = release.steps || [];
    const isOldScore = (step, i) => step.step === 'candidate' && all[i + 1] && all[i + 1].step === 'candidate';
    for (const step of all.filter((step, i) => !isOldScore(step, i))) {
      const line = make('li');
      line.append(make('time', clock(step.at_s)), step.step.replace(/_/g, ' ') + ' by ' + step.who +
                  (step.detail ? ', ' + step.detail : ''));
      steps.append(line);
    }
    entry.append(steps);
    list.append(entry);
  }
  return releases.length ? list : make('p', 'no model was offered', {class: 'note'});
}

function showMachine(machine, verdict) {
  title([[machine.name]], machine.type + (machine.hall ? ', ' + machine.hall : ''));
  const columns = machine.columns || [];
  const places = make('div', null, {class: 'places'});
  for (const column of columns)
    places.append(make('a', placeName(column) + (unitOf(column) === '\u00b0C' ? '' : ' (' + (unitOf(column) || 'signal') + ')'),
                       {href: link(machine.name, column)}));
  const events = make('ol');
  for (const event of machine.events) {
    const line = make('li', null);
    line.append(make('time', clock(event.at_s)), make('span', event.what, {class: event.kind === 'fault' ? 'bad' : ''}));
    events.append(line);
  }
  const night = machine.night;
  const words = night ? 'night of ' + night.night + ': ' + (night.error || whatDeparts(night) ||
    (night.departs ? 'departs from its sisters' : night.departs === false ? 'as its sisters' : 'not compared')) : 'no night yet';
  const findings = make('ol');
  for (const finding of (night && night.diagnosis) || [])
    findings.append(make('li', finding.evidence || finding.cause + ' ' + finding.subject));
  const two = make('div', null, {class: 'two'});
  const left = make('div');
  const right = make('div');
  left.append(section('Months', monthTable(machine.months)), section('Releases', releaseList(machine.releases)));
  right.append(section('Events', events));
  two.append(left, right);
  view.replaceChildren(section('Verdict', make('p', verdict ? verdict.verdict : '', {class: 'verdict ' + (verdict ? verdict.level : '')}),
                               make('p', words), findings),
                       section('Curves compared with the sisters', columns.length ? places
                         : make('p', 'no data sent yet', {class: 'note'})), two);
}

// ------------------------------------------------------------------ one place

let span = spans[1];

function ticks(low, high, count) {
  const rough = (high - low) / count;
  const power = Math.pow(10, Math.floor(Math.log10(rough)));
  const step = [1, 2, 5, 10].map(each => each * power).find(each => each >= rough);
  const found = [];
  for (let value = Math.ceil(low / step) * step; value <= high; value += step) found.push(value);
  return {step: step, at: found};
}

function timeText(at_s) {
  const at = new Date(at_s * 1000);
  return span[1] > 172800 ? at.toLocaleDateString([], {day: 'numeric', month: 'numeric'})
    : at.toLocaleTimeString([], {hour: '2-digit', minute: '2-digit', hour12: false});
}

// A gap of more than two points interrupts the line.
function pathOf(curve, x, y) {
  let text = '';
  curve.at.forEach((point, i) => {
    if (!isNumber(curve.mean[i])) return;
    text += (text && point - curve.at[i - 1] <= 2 ? 'L' : 'M') + x(point).toFixed(1) + ' ' + y(curve.mean[i]).toFixed(1);
  });
  return text;
}

function chart(shown, name, column, cursor) {
  const width = view.clientWidth - 32;
  const height = window.innerWidth <= 700 ? 256 : 352;
  const svg = draw('svg', {viewBox: '0 0 ' + width + ' ' + height, role: 'img', 'aria-label': placeName(column) + ' of ' + name + ' and its sisters'});
  const all = shown.curves.flatMap(curve => curve.mean.filter(isNumber));
  if (!all.length) return make('p', 'no data in this period', {class: 'note'});
  const low = all.reduce((a, b) => Math.min(a, b));
  const high = Math.max(all.reduce((a, b) => Math.max(a, b)), low + 0.1);
  const points = span[1] / shown.step_s;
  const x = point => 48 + (width - 56) * (point + 0.5) / points;
  const y = value => 8 + (height - 32) * (high - value) / (high - low);
  const across = ticks(low, high, 5);
  const digits = Math.max(0, -Math.floor(Math.log10(across.step)));
  for (const value of across.at)
    svg.append(draw('line', {class: 'grid', x1: 48, x2: width - 8, y1: y(value), y2: y(value)}),
               draw('text', {x: 42, y: y(value) + 4, 'text-anchor': 'end'}, fixed(value, digits)));
  const count = width < 500 ? 3 : 8;
  for (let i = 0; i <= count; ++i)
    svg.append(draw('text', {x: 48 + (width - 56) * i / count, y: height - 6, 'text-anchor': i === 0 ? 'start' : i === count ? 'end' : 'middle'},
                    timeText(shown.from_s + span[1] * i / count)));
  for (const curve of shown.curves)  // the machine's own is drawn last, on top
    svg.append(draw('path', {d: pathOf(curve, x, y), class: curve.name === name ? 'own' : ''}));
  const line = draw('line', {class: 'cursor', y1: 8, y2: height - 24, visibility: 'hidden'});
  svg.append(line);
  svg.addEventListener('pointermove', event => {
    const at = (event.clientX - svg.getBoundingClientRect().left) * width / svg.getBoundingClientRect().width;
    const point = Math.round((at - 48) / (width - 56) * points - 0.5);
    const values = shown.curves.map(curve => [curve.name, curve.mean[curve.at.indexOf(point)]]).filter(([, value]) => isNumber(value));
    line.setAttribute('visibility', values.length ? 'visible' : 'hidden');
    line.setAttribute('x1', x(point));
    line.setAttribute('x2', x(point));
    const own = values.find(([each]) => each === name);
    const sisters = values.filter(([each]) => each !== name).map(([, value]) => value).sort((a, b) => a - b);
    cursor.textContent = values.length ? clock(shown.from_s + shown.step_s * (point + 0.5)) + ': ' +
      (own ? fixed(own[1], 2) : '\u2013') + ' ' + unitOf(column) + (sisters.length ? ', sisters ' + fixed(sisters[0], 2) + ' to ' +
      fixed(sisters[sisters.length - 1], 2) + ', median ' + fixed(sisters[Math.floor(sisters.length / 2)], 2) : '') : '';
  });
  return svg;
}

async function showPlace(name, column, mine) {
  title([[name, link(name)], [placeName(column)]], 'sisters in grey');
  const shown = await ask('/api/curves?name=' + encodeURIComponent(name) + '&column=' + encodeURIComponent(column) +
                         '&seconds=' + span[1]);
  if (mine !== asked) return;
  const bar = make('nav', null, {'aria-label': 'time shown'});
  for (const each of spans) {
    const button = make('button', each[0], {'aria-pressed': each === span});
    button.addEventListener('click', () => { span = each; route(); });
    bar.append(button);
  }
  const cursor = make('p', '', {id: 'cursor'});
  const own = shown.curves.find(curve => curve.name === name);
  const sisters = shown.curves.length - (own ? 1 : 0);
  view.replaceChildren(section(placeName(column) + ' [' + unitOf(column) + '] of ' + name + (own ? '' : ' (nothing recorded)') +
                               ' beside ' + sisters + ' sisters', bar, chart(shown, name, column, cursor), cursor));
}

// ------------------------------------------------------------------ selection

let asked = 0;
let machines = null;  // last answer

async function route() {
  const mine = ++asked;
  const [name, column] = location.hash.slice(2).split('/').map(decodeURIComponent);
  try {
    if (column) return await showPlace(name, column, mine);
    if (name) {
      const [machine, all] = await Promise.all([ask('/api/machine?name=' + encodeURIComponent(name)), machines || ask('/api/machines')]);
      machines = all;
      if (mine === asked) showMachine(machine, all.find(each => each.name === name));
      return;
    }
    machines = await ask('/api/machines');
    if (mine === asked) showMachines(machines);
  } catch (error) {
    if (mine === asked) view.replaceChildren(make('p', error.message, {class: 'bad', role: 'alert'}));
  }
}

window.addEventListener('hashchange', route);
setInterval(() => { if (!document.hidden && !location.hash.slice(2)) route(); }, reloadMs);
route();
